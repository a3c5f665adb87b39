// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm } from './units';

/**
 * An object that the file names.
 */
export type ObjectSummary = { 
/**
 * As the file calls it.
 */
name: string, 
/**
 * Its middle on the bed, in G-code's coordinates, where the file gives it.
 */
centre_mm: [Mm, Mm] | null, 
/**
 * Filament laid for it.
 */
filament_mm: Mm, };
