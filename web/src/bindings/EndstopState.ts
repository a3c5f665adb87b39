// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * A limit switch.
 */
export type EndstopState = { 
/**
 * Its name.
 */
name: string, 
/**
 * It is pressed.
 */
triggered: boolean, };
