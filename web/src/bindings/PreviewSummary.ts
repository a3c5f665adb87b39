// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { PrinterError } from './PrinterError';
import type { Finding } from './Finding';
import type { Blocking } from './Blocking';
import type { LayerSummary } from './LayerSummary';
import type { FeatureSummary } from './FeatureSummary';
import type { ObjectSummary } from './ObjectSummary';
import type { ToolSummary } from './ToolSummary';
import type { Mm, Seconds } from './units';

/**
 * What a file holds, and what is wrong with it.
 */
export type PreviewSummary = { 
/**
 * Whether it can be printed once the blocking lines have been confirmed.
 */
printable: boolean, 
/**
 * What makes it unprintable.
 */
errors: Array<PrinterError>, 
/**
 * Lines to be confirmed.
 */
blocking: Array<Blocking>, 
/**
 * All remarks.
 */
findings: Array<Finding>, 
/**
 * Remarks beyond those listed.
 */
dropped: number, 
/**
 * Lines in the file.
 */
lines: number, 
/**
 * Moves, the pieces of arcs among them.
 */
moves: number, 
/**
 * Filament pushed less filament pulled back.
 */
filament_mm: Mm, 
/**
 * The lowest and highest X, Y, Z reached while extruding.
 */
bounds_mm: [[Mm, Mm, Mm], [Mm, Mm, Mm]] | null, 
/**
 * Vertices, all together.
 */
vertices: number, 
/**
 * Places that lay outside the vertices' range and were moved to its edge.
 */
clamped: number, 
/**
 * Vertices beyond what can be shown, which are left out.
 */
left_out: number, 
/**
 * Layers; those beyond 65 536 are part of the last.
 */
layers: Array<LayerSummary>, 
/**
 * The kinds of extrusion that occur.
 */
features: Array<FeatureSummary>, 
/**
 * The objects that the file names, at most 254; the first has number 1 in the vertices.
 */
objects: Array<ObjectSummary>, 
/**
 * The tools that lay filament.
 */
tools: Array<ToolSummary>, 
/**
 * Print time of the whole, planned for the machine; `null` without one, or where the plan fails.
 */
print_time_s: Seconds | null, 
/**
 * Of it, moving without extruding, and waiting where the file says so.
 */
travel_time_s: Seconds, 
/**
 * What the slicer thought.
 */
slicer_time_s: Seconds | null, 
/**
 * The slicer.
 */
generator: string | null, };
