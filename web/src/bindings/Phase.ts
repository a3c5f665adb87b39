// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * How far a connection is.
 */
export type Phase = "identifying" | "synchronising" | "restarting" | "configuring" | "holding" | "ready" | "shutdown" | "failed";
