// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { MotorState } from './MotorState';
import type { HeaterState } from './HeaterState';
import type { FanState } from './FanState';
import type { EndstopState } from './EndstopState';
import type { Seconds } from './units';

/**
 * The whole machine.
 */
export type VirtualState = { 
/**
 * Seconds since power-up.
 */
time_s: Seconds, 
/**
 * Whether the host has a connection.
 */
connected: boolean, 
/**
 * X, Y, Z, extruder.
 */
motors: Array<MotorState>, 
/**
 * Nozzle, bed.
 */
heaters: Array<HeaterState>, 
/**
 * Fans.
 */
fans: Array<FanState>, 
/**
 * Limit switches.
 */
endstops: Array<EndstopState>, 
/**
 * Why the firmware has stopped everything, if it has.
 */
shutdown: string | null, };
