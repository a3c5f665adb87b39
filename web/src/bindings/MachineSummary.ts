// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { HeaterSummary } from './HeaterSummary';
import type { MeshSummary } from './MeshSummary';
import type { MmPerS2, MmPerS, Mm } from './units';

/**
 * What the page has to know of a machine.
 */
export type MachineSummary = { 
/**
 * The lowest X, Y, Z allowed.
 */
min_mm: [Mm, Mm, Mm], 
/**
 * The highest X, Y, Z allowed.
 */
max_mm: [Mm, Mm, Mm], 
/**
 * How far the head reaches from the middle where the bed is round; `null` where it is not.
 */
bed_radius_mm: Mm | null, 
/**
 * Where each axis finds its endstop.
 */
endstop_mm: [Mm, Mm, Mm], 
/**
 * The fastest move.
 */
max_velocity_mm_s: MmPerS, 
/**
 * The fastest move of Z.
 */
max_z_velocity_mm_s: MmPerS, 
/**
 * The strongest acceleration.
 */
max_accel_mm_s2: MmPerS2, 
/**
 * The fastest move of filament alone.
 */
max_extrude_velocity_mm_s: MmPerS | null, 
/**
 * The longest push of filament in one move.
 */
max_extrude_mm: Mm | null, 
/**
 * The nozzle's bore.
 */
nozzle_mm: Mm | null, 
/**
 * The filament's diameter.
 */
filament_mm: Mm | null, 
/**
 * Heaters.
 */
heaters: Array<HeaterSummary>, 
/**
 * Bed meshes that a print may load.
 */
meshes: Array<MeshSummary>, 
/**
 * Whether there is a part fan.
 */
has_fan: boolean, 
/**
 * Rate of a real serial line, bits per second.
 */
baud: number, };
