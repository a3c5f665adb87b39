// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Hertz } from './units';

/**
 * A board.
 */
export type BoardView = { 
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
clock_freq_hz: Hertz, };
