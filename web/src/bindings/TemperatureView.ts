// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { HeaterName } from './HeaterName';
import type { Celsius } from './units';

/**
 * A heater's last reading.
 */
export type TemperatureView = { 
/**
 * Which one.
 */
heater: HeaterName, 
/**
 * What its sensor says.
 */
temperature_c: Celsius, 
/**
 * 0 is off.
 */
target_c: Celsius, 
/**
 * The share of time that it is on.
 */
duty: number, 
/**
 * The board has lowered it, or switched it off, because it was out of touch with its host.
 */
standby: boolean, };
