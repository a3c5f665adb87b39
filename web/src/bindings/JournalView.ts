// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Bytes, Seconds } from './units';

/**
 * A journal, as far as it could be read.
 */
export type JournalView = { 
/**
 * The print's own number.
 */
print: number, 
/**
 * It came to its end, one way or another.
 */
has_ended: boolean, 
/**
 * The board that was asked about holds this very print.
 */
is_held: boolean, 
/**
 * The line of the last move that was seen to be made; 0 where none was.
 */
line: number, 
/**
 * Print time then, in s.
 */
elapsed_s: Seconds, 
/**
 * How many bytes could be read; what follows them was torn off or damaged.
 */
readable_bytes: Bytes, };
