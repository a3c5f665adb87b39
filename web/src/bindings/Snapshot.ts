// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { PrinterError } from './PrinterError';
import type { Phase } from './Phase';
import type { BoardView } from './BoardView';
import type { TemperatureView } from './TemperatureView';
import type { JobView } from './JobView';
import type { LinkView } from './LinkView';
import type { Mm, Seconds } from './units';

/**
 * Everything that a panel shows, at a moment.
 */
export type Snapshot = { 
/**
 * How far the connection is.
 */
phase: Phase, 
/**
 * What ended the connection or stopped the board.
 */
error: PrinterError | null, 
/**
 * The board, once it has said who it is.
 */
board: BoardView | null, 
/**
 * Each heater that has been read.
 */
temperatures: Array<TemperatureView>, 
/**
 * Where the last planned move ends, in the G-code's coordinates: X, Y, Z and filament. `null` while it is not known.
 */
position_mm: [Mm, Mm, Mm, Mm] | null, 
/**
 * Where the head is now, on the way there, in the same coordinates. `null` while it is not known.
 */
live_mm: [Mm, Mm, Mm, Mm] | null, 
/**
 * How much higher Z's motor stands than `position_mm` has it, once it is there: what makes up for a bed that is not
 * flat.
 */
z_lift_mm: Mm, 
/**
 * Which of X, Y, Z are homed; the position of the others means nothing.
 */
homed: [boolean, boolean, boolean], 
/**
 * The print.
 */
job: JobView, 
/**
 * Motion that the board has and has not made; `null` outside of a run.
 */
queued_s: Seconds | null, 
/**
 * Of what is planned from now on, whoever set it: the page, or an `M220`. 1 is as written.
 */
speed_factor: number, 
/**
 * The same of the extrusion (`M221`).
 */
flow_factor: number, 
/**
 * The part fan, 0 … 1.
 */
fan: number, 
/**
 * Counts of the link.
 */
link: LinkView | null, };
