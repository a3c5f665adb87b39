// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * How much a remark matters.
 */
export type FindingSeverity = "info" | "warning" | "blocking" | "error";
