// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * What a job is doing.
 */
export type JobPhase = "none" | "printing" | "pausing" | "paused" | "ending" | "held";
