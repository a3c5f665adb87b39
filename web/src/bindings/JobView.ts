// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { JobPhase } from './JobPhase';
import type { StartView } from './StartView';
import type { Bytes, Seconds } from './units';

/**
 * A job; the numbers of the last one stay after its end.
 */
export type JobView = { 
/**
 * What it is doing.
 */
status: JobPhase, 
/**
 * The line of the last move that has been made.
 */
line: number, 
/**
 * Print time so far.
 */
elapsed_s: Seconds, 
/**
 * How much of its file has been taken; a double counts bytes exactly up to 2⁵³.
 */
fed_bytes: Bytes, 
/**
 * The least motion that the board had since the print's start, while more of it was to come. `null` before there was
 * any.
 */
queued_least_s: Seconds | null, 
/**
 * It was started with a line in the middle of its file, is paused before that, and waits for the user: Z has to be
 * known (`set-position`, or homed) before `resume`, which does everything else. `null` otherwise.
 */
start: StartView | null, };
