// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { ErrorCode } from './ErrorCode';

/**
 * What went wrong, from the catalogue.
 */
export type PrinterError = { 
/**
 * The entry in the catalogue.
 */
code: ErrorCode, 
/**
 * The line of the G-code that led to it, if one did.
 */
line: number | null, 
/**
 * What happened, as a sentence.
 */
what_happened: string, 
/**
 * What the machine does now, and what is not in danger.
 */
what_is_safe: string, 
/**
 * What the user should do.
 */
what_to_do: string, };
