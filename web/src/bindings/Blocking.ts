// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * A line that has to be confirmed.
 */
export type Blocking = { 
/**
 * Which one.
 */
line: number, 
/**
 * Why.
 */
message: string, };
