// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * A fan.
 */
export type FanState = { 
/**
 * Its name.
 */
name: string, 
/**
 * 0 … 1.
 */
speed: number, };
