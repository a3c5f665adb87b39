// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * A heater, by its section in the machine file.
 */
export type HeaterName = "extruder" | "heater_bed";
