// The planner's session as the worker uses it: the generated class behind the page's own types.
// Knows no port and no clock: bytes and time are arguments.
import type { VirtualState } from '../bindings/VirtualState';
import type { Seconds } from '../units';
import type { Interruption, MachineEvent, PrintStart, Snapshot, Trouble, Wish } from './protocol';

/** What a session knows of a snapshot; the rest is its owner's. */
export type SessionSnapshot = Omit<Snapshot, 'wakeUps'>;

/** What a print's journal says, as far as it could be read. */
export interface JournalSummary {
  /** The print's own number. */
  readonly number: number;
  readonly hasEnded: boolean;
  /** The board that was asked about holds this very print. */
  readonly isHeld: boolean;
  /** The line of the last move that was seen to be made; 0 where none was. */
  readonly line: number;
  /** Print time then. */
  readonly elapsed: Seconds;
  readonly readableBytes: number;
}

export interface Session {
  receive(bytes: Uint8Array, now: Seconds): void;
  /** Bytes for the port; may be empty. */
  poll(now: Seconds): Uint8Array<ArrayBuffer>;
  /** When `poll` is to be called again if nothing arrives before. */
  wake(): Seconds;
  takeEvents(): MachineEvent[];
  /** Null where the wish is being carried out. */
  wish(wish: Wish, now: Seconds): Trouble | null;
  /** `journal` is the print's own number, with which a journal is kept. */
  startJob(start: PrintStart, journal: number | null, now: Seconds): Trouble | null;
  /** What is to be added to the print's journal, and stored before the bytes of the last `poll` are sent. */
  takeJournal(): string;
  /** In the phase `holding`: the number that the board gives for the print it holds. */
  heldPrint(): number | null;
  /** In the phase `holding`: begins to make the print's plan again; its file is then fed as a job's is. */
  takeUp(journal: Uint8Array): Trouble | null;
  /** How many bytes of the job's file may be fed now. */
  jobWants(): number;
  jobFeed(bytes: Uint8Array): void;
  jobEnd(): void;
  snapshot(now: Seconds): SessionSnapshot;
  /** Pairs of time (s, relative to now) and the toolhead's planned speed (mm/s). */
  plannedSpeed(now: Seconds, behind: Seconds, ahead: Seconds): Float64Array<ArrayBuffer>;
  free(): void;
}

/** Finds out where an interrupted print was. Moves nothing. */
export interface Survey {
  /** How many bytes of the print's file may be fed now; none once it is done. */
  wants(): number;
  feed(bytes: Uint8Array): void;
  /** The file has ended. */
  end(): void;
  /** Null while it is not done. */
  report(): Interruption | null;
  free(): void;
}

/** A printer in this page, with its own virtual time: seconds since it was powered up. */
export interface SimulatedPrinter {
  now(): Seconds;
  write(bytes: Uint8Array): void;
  /** Lets time pass until `until`, or until bytes come; returns those. */
  runUntil(until: Seconds): Uint8Array<ArrayBuffer>;
  /** The machine as an onlooker sees it. */
  record(): VirtualState;
  free(): void;
}
