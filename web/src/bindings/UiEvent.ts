// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { PrinterError } from './PrinterError';
import type { HeaterName } from './HeaterName';
import type { Phase } from './Phase';
import type { Finding } from './Finding';
import type { Mm, Hertz, Seconds, Celsius } from './units';

/**
 * What happened.
 */
export type UiEvent = { "type": "phase", 
/**
 * The new one.
 */
phase: Phase, } | { "type": "identified", 
/**
 * Its firmware's version.
 */
version: string, 
/**
 * Its chip.
 */
mcu: string, 
/**
 * Its clock.
 */
clock_freq_hz: Hertz, } | { "type": "temperature", 
/**
 * Which one.
 */
heater: HeaterName, 
/**
 * What its sensor says.
 */
temperature_c: Celsius, 
/**
 * What it should be; 0 is off.
 */
target_c: Celsius, 
/**
 * The share of time that it is on.
 */
duty: number, 
/**
 * The board has lowered it, or switched it off, because it was out of touch with its host.
 */
standby: boolean, } | { "type": "homed", 
/**
 * 0, 1, 2 for X, Y, Z.
 */
axis: number, 
/**
 * Where it is now.
 */
position_mm: Mm, } | { "type": "progress", 
/**
 * The line of the last move that has been made.
 */
line: number, 
/**
 * Print time so far.
 */
elapsed_s: Seconds, } | { "type": "message", 
/**
 * The text.
 */
text: string, } | { "type": "notice", 
/**
 * What and where.
 */
finding: Finding, } | { "type": "paused" } | { "type": "held", 
/**
 * Why.
 */
error: PrinterError, } | { "type": "resumed" } | { "type": "job-done" } | { "type": "job-cancelled" } | { "type": "error", 
/**
 * What.
 */
error: PrinterError, } | { "type": "dropped", 
/**
 * How many.
 */
count: number, };
