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
 * The nozzle's height at its first extrusion.
 */
z_mm: Mm, 
/**
 * With this line a print of it can begin: the head is where its first extrusion begins. 0 without extrusion.
 */
line: number, 
/**
 * Print time; 0 without a machine.
 */
time_s: Seconds, };
