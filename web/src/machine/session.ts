// The planner's session as the worker uses it: the generated class behind the page's own types.
// Knows no port and no clock: bytes and time are arguments.
import type { VirtualState } from '../bindings/VirtualState';
import type { Seconds } from '../units';
import type { ConfirmedLines, MachineEvent, Snapshot, Trouble, Wish } from './protocol';

/** What a session knows of a snapshot; the rest is its owner's. */
export type SessionSnapshot = Omit<Snapshot, 'wakeUps'>;

export interface Session {
  receive(bytes: Uint8Array, now: Seconds): void;
  /** Bytes for the port; may be empty. */
  poll(now: Seconds): Uint8Array<ArrayBuffer>;
  /** When `poll` is to be called again if nothing arrives before. */
  wake(): Seconds;
  takeEvents(): MachineEvent[];
  /** Null where the wish is being carried out. */
  wish(wish: Wish, now: Seconds): Trouble | null;
  startJob(confirmedLines: ConfirmedLines, now: Seconds): Trouble | null;
  /** How many bytes of the job's file may be fed now. */
  jobWants(): number;
  jobFeed(bytes: Uint8Array): void;
  jobEnd(): void;
  snapshot(now: Seconds): SessionSnapshot;
  /** Pairs of time (s, relative to now) and the toolhead's planned speed (mm/s). */
  plannedSpeed(now: Seconds, behind: Seconds, ahead: Seconds): Float64Array<ArrayBuffer>;
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
