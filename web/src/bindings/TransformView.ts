// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * What makes up for skew and bed.
 */
export type TransformView = { 
/**
 * The name of the bed's mesh (`[bed_mesh NAME]`); `null` without one.
 */
mesh: string | null, 
/**
 * How far Y leans in X, Z in X and Z in Y, in mm/mm.
 */
skew: [number, number, number], };
