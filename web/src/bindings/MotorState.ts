// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Mm } from './units';

/**
 * A motor.
 */
export type MotorState = { 
/**
 * Its name, as in the machine file.
 */
name: string, 
/**
 * Pulses of both directions since power-up.
 */
pulses: number, 
/**
 * Forward less backward pulses since power-up.
 */
count: number, 
/**
 * Steps by which the rotor is behind its pulses.
 */
lost_steps: number, 
/**
 * Where the load stands.
 */
position_mm: Mm, 
/**
 * Current is on.
 */
energised: boolean, };
