// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm } from './units';

/**
 * What is printed by one tool.
 */
export type ToolSummary = { 
/**
 * Its number in the vertices.
 */
tool: number, 
/**
 * Filament laid.
 */
filament_mm: Mm, };
