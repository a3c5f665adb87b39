// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { TransformView } from './TransformView';
import type { Mm, Seconds } from './units';

/**
 * Where a print was when it was interrupted, for those who go on with it from a line after its board has lost everything.
 */
export type InterruptionView = { 
/**
 * The line of the last move that is known to have been made, 0 where none is.
 */
line: number, 
/**
 * The line to begin with (`JobRequest.start_line`): nothing is left out, and some seconds may be made twice.
 */
start_line: number, 
/**
 * It has not got beyond this line.
 */
reach_line: number, 
/**
 * Print time at `line`.
 */
elapsed_s: Seconds, 
/**
 * The layer of the line, counted from 1.
 */
layer: number, 
/**
 * That layer's height.
 */
layer_z_mm: Mm, 
/**
 * The line with which that layer begins.
 */
layer_line: number, 
/**
 * Where the lines have the nozzle at the end of `line`.
 */
position_mm: [Mm, Mm, Mm], 
/**
 * The lowest and highest Z at which the power may have gone; `null` where Z was being moved by hand or homed.
 */
z_range_mm: [Mm, Mm] | null, 
/**
 * Where Z can stand once its motor has current again, the likeliest first: one of them is to be claimed
 * (`set-position`). Empty where nothing can be said.
 */
z_places_mm: Array<Mm>, 
/**
 * How far such places are apart: whoever has measured Z takes the nearest.
 */
z_pitch_mm: Mm, 
/**
 * How far off the right place is at most. Where there is none: how far from `z_range_mm` Z may stand.
 */
z_error_mm: Mm, 
/**
 * The factors that held, for `set-speed-factor` and `set-flow-factor`.
 */
speed_factor: number, 
/**
 * See `speed_factor`.
 */
flow_factor: number, 
/**
 * What made up for skew and bed before the file's first line, loaded by hand: for `JobRequest.transform`.
 */
transform: TransformView, };
