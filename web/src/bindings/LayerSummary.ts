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
 * Print time; 0 without a machine.
 */
time_s: Seconds, };
