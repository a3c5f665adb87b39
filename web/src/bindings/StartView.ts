// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm, Celsius } from './units';

/**
 * How a job begins that does not begin with its file.
 */
export type StartView = { 
/**
 * The line with which it begins.
 */
line: number, 
/**
 * Where its lines have the head before it.
 */
position_mm: [Mm, Mm, Mm], 
/**
 * The height over which the way there leads: above all that has been printed.
 */
clear_z_mm: Mm, 
/**
 * What `resume` heats the nozzle to, 0 where it stays off.
 */
nozzle_c: Celsius, 
/**
 * The same of the bed.
 */
bed_c: Celsius, };
