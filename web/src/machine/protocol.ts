// What the page and the machine worker say to each other, and the machine as the page sees it.
// Shapes only. Values that come from the planner are described here in the page's own words; machine/planner.ts
// makes them from the planner's.
import type { VirtualState } from '../bindings/VirtualState';
import type { LineErrors } from '../transport/transport';
import type { PortId } from '../transport/web_serial';
import type { Celsius, Mm, Seconds, Share } from '../units';

/** Something that went wrong, in the words of the catalogue: what happened, what is safe, what to do. */
export interface Trouble {
  readonly code: string;
  readonly line: number | null;
  readonly happened: string;
  readonly safe: string;
  readonly todo: string;
}

export type Axis = 'X' | 'Y' | 'Z';
export type HeaterName = 'extruder' | 'heater_bed';

export interface HeaterState {
  readonly name: HeaterName;
  readonly temperature: Celsius;
  /** 0 is off. */
  readonly target: Celsius;
  readonly duty: Share;
  /** The board has lowered it, or switched it off, because it was out of touch with the page. */
  readonly isStandby: boolean;
}

/** The connection to the board, from the first byte on. */
export type Phase =
  | 'identifying'
  | 'synchronising'
  | 'restarting'
  | 'configuring'
  /** The board holds a print whose page is gone. */
  | 'holding'
  | 'ready'
  | 'shutdown'
  | 'failed';

export type JobStatus = 'none' | 'printing' | 'pausing' | 'paused' | 'ending' | 'held';

export interface LinkCounts {
  readonly bytesSent: number;
  readonly bytesReceived: number;
  readonly bytesRetransmitted: number;
  readonly timeouts: number;
  readonly roundTrip: Seconds | null;
  readonly lineErrors: LineErrors;
}

/** A print that begins in the middle of its file, as the board's owner has it. */
export interface StartAt {
  readonly line: number;
  /** Where the lines before have the head. */
  readonly position: readonly [Mm, Mm, Mm];
  /** The height over which the way there leads. */
  readonly clearZ: Mm;
  /** What both are heated to for that, 0 where they stay off. */
  readonly nozzle: Celsius;
  readonly bed: Celsius;
}

/** How late the worker's timers were since the connection began. */
export interface WakeUps {
  /** So many by more than a second: the computer slept, or was very busy. */
  readonly missed: number;
  readonly latest: Seconds;
}

/** The machine now. Sent several times a second. */
export interface Snapshot {
  readonly phase: Phase;
  readonly heaters: readonly HeaterState[];
  /** X, Y, Z, E where the head is now, as far as that is known. */
  readonly position: readonly [Mm, Mm, Mm, Mm] | null;
  /** How much higher Z's motor stands than `position` has it, at rest: what makes up for a bed that is not flat. */
  readonly zLift: Mm;
  /** The bed mesh that is in force, by its name in the machine file. */
  readonly mesh: string | null;
  readonly homed: readonly [boolean, boolean, boolean];
  readonly job: JobStatus;
  /** The print is paused before its first line, which is in the middle of its file. */
  readonly start: StartAt | null;
  /** The line of the last move that has been made. */
  readonly line: number;
  /** Print time made so far. */
  readonly elapsed: Seconds;
  /** Motion that the board has and has not made yet; null while none is being made. */
  readonly queued: Seconds | null;
  /** The least of it since the print's start, while more was to come. */
  readonly queuedLeast: Seconds | null;
  readonly speedFactor: Share;
  readonly flowFactor: Share;
  readonly fan: Share;
  readonly link: LinkCounts | null;
  readonly wakeUps: WakeUps;
}

/** What the page is told in words, in the order in which it happened. */
export type MachineEvent =
  | { readonly kind: 'phase'; readonly phase: Phase }
  | { readonly kind: 'identified'; readonly version: string; readonly mcu: string }
  | { readonly kind: 'message'; readonly text: string }
  | { readonly kind: 'notice'; readonly line: number; readonly severity: string; readonly text: string }
  | { readonly kind: 'homed'; readonly axis: Axis; readonly position: Mm }
  | { readonly kind: 'paused' | 'resumed' | 'done' | 'cancelled' }
  | { readonly kind: 'held' | 'trouble'; readonly trouble: Trouble }
  | { readonly kind: 'dropped'; readonly count: number };

export type Wish =
  | { readonly kind: 'gcode'; readonly text: string }
  | { readonly kind: 'home'; readonly axes: readonly Axis[] }
  | { readonly kind: 'jog'; readonly axis: Axis; readonly distance: Mm }
  /** The user's word for where an axis stands. */
  | { readonly kind: 'set-position'; readonly axis: Axis; readonly position: Mm }
  /** `speed` in mm/s of filament. */
  | { readonly kind: 'extrude'; readonly length: Mm; readonly speed: number }
  | { readonly kind: 'temperature'; readonly heater: HeaterName; readonly target: Celsius }
  | { readonly kind: 'fan' | 'speed-factor' | 'flow-factor'; readonly value: Share }
  | { readonly kind: 'motors-off' | 'pause' | 'resume' | 'cancel' | 'emergency-stop' | 'firmware-restart' };

export type PortChoice =
  | { readonly kind: 'serial'; readonly id: PortId; readonly baud: number }
  | {
      readonly kind: 'virtual';
      readonly board: 'rp2040' | 'stm32f103';
      readonly speed: number;
      readonly seed: number;
      readonly faults: string;
    };

/** What there is to say of a print's file. */
export interface PrintFacts {
  readonly name: string;
  /** From the plan; null where that is not known. */
  readonly time: Seconds | null;
  readonly lines: number;
}

/** A print on a real printer that was begun in this browser and has not come to its end, as far as is known. */
export interface KeptPrint {
  readonly id: string;
  readonly facts: PrintFacts;
  /** What the user calls the machine, and its file. */
  readonly machine: { readonly name: string; readonly config: string };
  readonly port: PortId;
  /** The line of the last move that was seen to be made; 0 where none was. */
  readonly line: number;
  /** The line with which it was begun, where that was not the first. */
  readonly startLine: number | null;
  /** Print time made. */
  readonly elapsed: Seconds;
  /** What the user had left out. */
  readonly confirmedLines: ConfirmedLines;
  /** When it was last heard of, in ms since 1970. */
  readonly heardOf: number;
  /** The size of its file. */
  readonly fileBytes: number;
}

/** The print that the board holds, and what there is to be done about it. Nothing of all this moves anything. */
export type HeldPrint =
  | { readonly kind: 'looking' }
  /** Nothing is known of it here; `trouble` says why, where that is out of order. */
  | { readonly kind: 'unknown'; readonly trouble: Trouble | null }
  /** The copy of its file is not there, or not whole. */
  | { readonly kind: 'needs-file'; readonly print: KeptPrint; readonly trouble: Trouble | null }
  /** Its plan is made again, up to where the board is. */
  | { readonly kind: 'finding'; readonly print: KeptPrint; readonly share: Share }
  | { readonly kind: 'refused'; readonly print: KeptPrint; readonly trouble: Trouble }
  /** It is the session's job again, and waits for the user's word. */
  | { readonly kind: 'held'; readonly print: KeptPrint; readonly file: Blob };

/** Lines that the user wants left out; all that are not known, where there are more than can be listed. */
export type ConfirmedLines = readonly number[] | 'all';

/** What makes up for skew and bed. */
export interface Transform {
  /** The name of the bed's mesh; null without one. */
  readonly mesh: string | null;
  /** How far Y leans in X, Z in X and Z in Y, in mm/mm. */
  readonly skew: readonly [number, number, number];
}

/** How a print is begun. */
export interface PrintStart {
  readonly confirmedLines: ConfirmedLines;
  /** The line with which it begins, as if those before had been made; null is the first. Then it is paused. */
  readonly line: number | null;
  /** What is in force when its file begins; null leaves it as it is. */
  readonly transform: Transform | null;
}

/** From the first line, with nothing left out. */
export const WHOLE: PrintStart = { confirmedLines: [], line: null, transform: null };

/** Where an interrupted print was, as far as its journal and its file tell. */
export interface Interruption {
  /** The line of the last move that is known to have been made. */
  readonly line: number;
  /** The line to go on with: nothing is left out. */
  readonly startLine: number;
  /** It got no further than this line. */
  readonly reachLine: number;
  /** Counted from 1. */
  readonly layer: number;
  readonly layerZ: Mm;
  /** The line with which that layer begins. */
  readonly layerLine: number;
  /** Where Z was when it was interrupted; null where it was being homed, or moved by hand. */
  readonly zRange: readonly [Mm, Mm] | null;
  /** Where Z can stand once its motor has current again, the likeliest first; empty where nothing can be said. */
  readonly zPlaces: readonly Mm[];
  /** So far are such places apart. */
  readonly zPitch: Mm;
  /** What is in doubt at the right place; where there is none, how far from `zRange` it may stand. */
  readonly zError: Mm;
  readonly speedFactor: Share;
  readonly flowFactor: Share;
  /** What had been in force when its file began. */
  readonly transform: Transform;
}

/** What there is of a kept print's file. */
export type KeptFile =
  /** `at` is null where its place cannot be found, which `trouble` says why. */
  | {
      readonly kind: 'there';
      readonly file: Blob;
      readonly at: Interruption | null;
      readonly trouble: Trouble | null;
    }
  /** There is no whole copy of it; `trouble`: the one that was given is not it, or nothing can be read. */
  | { readonly kind: 'missing'; readonly trouble: Trouble | null };

export type ToMachine =
  | {
      readonly kind: 'connect';
      readonly port: PortChoice;
      readonly config: string;
      /** Of this one connection, among all tabs. */
      readonly id: string;
      /** What the user calls the machine. */
      readonly name: string;
    }
  | { readonly kind: 'disconnect' }
  | { readonly kind: 'wish'; readonly id: number; readonly wish: Wish }
  | {
      readonly kind: 'print';
      readonly id: number;
      readonly file: Blob;
      readonly start: PrintStart;
      readonly facts: PrintFacts;
      /** The interrupted print that it goes on with; null where it is one of its own. */
      readonly continues: string | null;
    }
  /** Asks for the file of a kept print, and where in it the print was; where the user has `given` one, whether it is that. */
  | { readonly kind: 'kept-file'; readonly id: number; readonly print: string; readonly given: Blob | null }
  /** The file of the print that the board holds, from the user. */
  | { readonly kind: 'held-file'; readonly file: Blob }
  /** Nothing of this print is to be kept. */
  | { readonly kind: 'forget'; readonly id: string }
  /** Another tab may have changed what is kept. */
  | { readonly kind: 'list-kept' }
  | { readonly kind: 'speed'; readonly speed: number }
  /** A snapshot has arrived: the next may be sent. */
  | { readonly kind: 'seen' }
  /** Whether `planned-speed` is wanted. Holds for all connections until it is changed. */
  | { readonly kind: 'watch-speed'; readonly on: boolean };

export type FromMachine =
  /** The planner is loaded: connections can be made. */
  | { readonly kind: 'loaded' }
  | { readonly kind: 'opened' }
  /** The connection is over; `trouble` says why, where the user did not end it. */
  | { readonly kind: 'closed'; readonly trouble: Trouble | null }
  /**
   * Something that nobody foresaw. The connection, if there was one, is over, its port and lock are let go of; the
   * worker can only be replaced.
   */
  | { readonly kind: 'died'; readonly message: string }
  /** The next comes only after this was `seen`: a page that is busy is not told more than it can take. */
  | { readonly kind: 'snapshot'; readonly snapshot: Snapshot }
  /** The virtual printer's own record: what its motors, heaters and switches did, whatever the session believes. */
  | { readonly kind: 'record'; readonly record: VirtualState }
  /**
   * The toolhead's planned speed around now, with each snapshot while it is watched: pairs of time (s, relative to now,
   * ascending) and speed (mm/s), between which it changes evenly. Rest is zero; empty while the board is not ready.
   */
  | { readonly kind: 'planned-speed'; readonly pairs: Float64Array<ArrayBuffer> }
  | { readonly kind: 'events'; readonly events: readonly MachineEvent[] }
  /** Prints that were interrupted, the newest first; those that are under way are not among them. */
  | { readonly kind: 'kept'; readonly prints: readonly KeptPrint[] }
  /** What is kept of the present print is not enough to go on with it after this page; said once. */
  | { readonly kind: 'not-kept'; readonly trouble: Trouble }
  /** Null once there is nothing more to be decided. */
  | { readonly kind: 'held-print'; readonly held: HeldPrint | null }
  /** The answer to that question. */
  | { readonly kind: 'kept-file'; readonly id: number; readonly found: KeptFile }
  /** What came of a wish or of a print's start. */
  | { readonly kind: 'answer'; readonly id: number; readonly trouble: Trouble | null }
  /** The worker's clock jumped: the computer slept, or the worker was held up. */
  | { readonly kind: 'gap'; readonly seconds: Seconds };
