// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { TransformView } from './TransformView';

/**
 * What a job is started with.
 */
export type JobRequest = { 
/**
 * Lines with something blocking in them that the user has confirmed: they are passed over.
 */
confirmed_lines: Array<number>, 
/**
 * Confirm all of them.
 */
confirm_all: boolean, 
/**
 * The print's own number, with which a journal is kept: any that no other print has.
 */
journal: number | null, 
/**
 * The line with which the job begins, paused; `null`: with its file.
 */
start_line: number | null, 
/**
 * What makes up for skew and bed when the file begins (`InterruptionView.transform`, where a print goes on that was
 * interrupted); left out: what is in force.
 */
transform?: TransformView, };
