// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { ConfigSeverity } from './ConfigSeverity';

/**
 * One remark.
 */
export type ConfigFinding = { 
/**
 * Counted from 1; 0 where something is missing that no line stands for.
 */
line: number, 
/**
 * How much it matters.
 */
severity: ConfigSeverity, 
/**
 * What is wrong and what to write instead.
 */
message: string, };
