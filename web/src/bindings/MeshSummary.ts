// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm } from './units';

/**
 * A bed's shape that the machine file has, as a grid of heights.
 */
export type MeshSummary = { 
/**
 * What `BED_MESH_PROFILE LOAD=` calls it.
 */
name: string, 
/**
 * X and Y of the first point.
 */
min_mm: [Mm, Mm], 
/**
 * From point to point along X and along Y.
 */
step_mm: [Mm, Mm], 
/**
 * Row by row, the lowest Y first.
 */
heights_mm: Array<Array<Mm>>, };
