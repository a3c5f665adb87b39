// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { FindingSeverity } from './FindingSeverity';

/**
 * One remark about a line of G-code.
 */
export type Finding = { 
/**
 * Counted from 1.
 */
line: number, 
/**
 * Bytes of the line, counted from 0: the first, and the one behind the last.
 */
columns: [number, number], 
/**
 * How much it matters.
 */
severity: FindingSeverity, 
/**
 * A stable name.
 */
code: string, 
/**
 * What is wrong and what to do about it.
 */
message: string, };
