// What the tab that drives a printer and the other tabs of this browser say to each other, over a BroadcastChannel
// between the machine worker there and the pages here. Shapes and names only.
import type { PortChoice, PrintFacts, Snapshot, Trouble } from './protocol';

/** Pages of another version of this protocol talk on another channel. */
export const CHANNEL = 'stepcast-machines-1';

/** Held by the worker that drives the machine as long as it does, so that its end is known at once, however it comes. */
export const liveLock = (id: string): string => `stepcast-live:${id}`;

/** How the last print of a machine ended. */
export type Outcome = 'done' | 'cancelled' | 'stopped';

/** A machine as other tabs see it. */
export interface MachineView {
  /** Of this one connection. */
  readonly id: string;
  /** What the user calls the machine. */
  readonly name: string;
  readonly port: PortChoice;
  readonly snapshot: Snapshot;
  /** What is, or was last, printed. */
  readonly print: PrintFacts | null;
  readonly outcome: Outcome | null;
  /** What the user has to be told. */
  readonly trouble: Trouble | null;
}

export type FromDriver =
  | { readonly kind: 'view'; readonly view: MachineView }
  /** The connection has ended in order. */
  | { readonly kind: 'bye'; readonly id: string; readonly trouble: Trouble | null }
  /** What came of a stop. */
  | { readonly kind: 'stopped'; readonly request: string; readonly trouble: Trouble | null };

export type FromViewer =
  /** Somebody has begun to watch: all machines say how they are. */
  { readonly kind: 'hello' } | { readonly kind: 'stop'; readonly id: string; readonly request: string };
