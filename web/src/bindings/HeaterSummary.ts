// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { HeaterName } from './HeaterName';
import type { Celsius } from './units';

/**
 * A heater.
 */
export type HeaterSummary = { 
/**
 * Which one.
 */
name: HeaterName, 
/**
 * The highest target.
 */
max_c: Celsius, 
/**
 * Filament may be pushed from here on; `null` for beds.
 */
min_extrude_c: Celsius | null, };
