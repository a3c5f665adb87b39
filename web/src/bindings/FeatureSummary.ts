// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm, Seconds } from './units';

/**
 * What a kind of extrusion takes.
 */
export type FeatureSummary = { 
/**
 * Its number in the vertices.
 */
feature: number, 
/**
 * Print time; 0 without a machine.
 */
time_s: Seconds, 
/**
 * Filament laid.
 */
filament_mm: Mm, };
