// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * An axis that can be jogged.
 */
export type JogAxis = "x" | "y" | "z";
