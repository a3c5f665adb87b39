// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { HeaterName } from './HeaterName';
import type { JogAxis } from './JogAxis';
import type { MmPerS, Mm, Celsius } from './units';

/**
 * What the page may ask.
 */
export type UiRequest = { "type": "gcode", 
/**
 * The lines.
 */
text: string, } | { "type": "set-temperature", 
/**
 * Which one.
 */
heater: HeaterName, 
/**
 * 0 is off.
 */
target_c: Celsius, } | { "type": "set-fan", 
/**
 * 0 … 1.
 */
speed: number, } | { "type": "set-speed-factor", 
/**
 * 1 is as written.
 */
factor: number, } | { "type": "set-flow-factor", 
/**
 * 1 is as written.
 */
factor: number, } | { "type": "home", 
/**
 * Which ones.
 */
axes: Array<JogAxis>, } | { "type": "jog", 
/**
 * Which one.
 */
axis: JogAxis, 
/**
 * How far; negative is towards lower positions.
 */
distance_mm: Mm, 
/**
 * How fast.
 */
speed_mm_s: MmPerS, } | { "type": "extrude", 
/**
 * How much; negative pulls it back.
 */
length_mm: Mm, 
/**
 * How fast.
 */
speed_mm_s: MmPerS, } | { "type": "set-position", 
/**
 * Which one.
 */
axis: JogAxis, 
/**
 * Where.
 */
position_mm: Mm, } | { "type": "motors-off" } | { "type": "pause" } | { "type": "resume" } | { "type": "cancel" } | { "type": "emergency-stop" } | { "type": "firmware-restart" };
