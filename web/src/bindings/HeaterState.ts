// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Celsius } from './units';

/**
 * A heater.
 */
export type HeaterState = { 
/**
 * Its name, as in the machine file.
 */
name: string, 
/**
 * The body's true temperature.
 */
temperature_c: Celsius, 
/**
 * The share of time that it is on.
 */
duty: number, };
