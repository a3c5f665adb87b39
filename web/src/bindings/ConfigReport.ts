// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { ConfigFinding } from './ConfigFinding';
import type { MachineSummary } from './MachineSummary';

/**
 * What was found in a `printer.cfg`.
 */
export type ConfigReport = { 
/**
 * Remarks by line.
 */
findings: Array<ConfigFinding>, 
/**
 * The machine; `null` where the file has errors.
 */
machine: MachineSummary | null, };
