// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm, Seconds } from './units';

/**
 * A layer.
 */
export type LayerSummary = { 
/**
 * Its first vertex.
 */
first_vertex: number, 
/**
 * Its first line, for `JobRequest.start_line`: a print that begins there makes the whole layer and nothing of those
 * before. 1 for the first layer.
 */
first_line: number, 
/**
 * The nozzle's height at its first extrusion.
 */
z_mm: Mm, 
/**
 * Print time; 0 without a machine.
 */
time_s: Seconds, };
