// A session that does what a test tells it, for the loops around it.

import type { VirtualState } from '../src/bindings/VirtualState';
import type { JobStatus, MachineEvent, Phase, PrintStart, Trouble, Wish } from '../src/machine/protocol';
import type { Session, SessionSnapshot, SimulatedPrinter } from '../src/machine/session';
import { celsius, mm, type Seconds, seconds, share } from '../src/units';

const SNAPSHOT: SessionSnapshot = {
  phase: 'ready',
  heaters: [
    { name: 'extruder', temperature: celsius(20), target: celsius(0), duty: share(0), isStandby: false },
  ],
  position: null,
  zLift: mm(0),
  mesh: null,
  homed: [false, false, false],
  job: 'none',
  start: null,
  line: 0,
  elapsed: seconds(0),
  queued: null,
  queuedLeast: null,
  speedFactor: share(1),
  flowFactor: share(1),
  fan: share(0),
  link: null,
};

export class FakeSession implements Session {
  readonly received: number[] = [];
  readonly polls: Seconds[] = [];
  readonly wishes: Wish[] = [];
  readonly #fed: Uint8Array[] = [];
  wants = 0;
  ended = false;
  /** Seconds between wake-ups. */
  period = 0.01;
  toSend: number[] = [];
  refusal: Trouble | null = null;
  events: MachineEvent[] = [];
  phase: Phase = 'ready';
  job: JobStatus = 'none';
  /** What everything throws from now on, as a planner that has panicked. */
  panic: Error | undefined;
  freed = false;
  /** What waits to be taken, and under which number. */
  journal: string[] = [];
  readonly starts: PrintStart[] = [];
  journalNumber: number | null = null;
  held: number | null = null;
  readonly takenUp: string[] = [];

  #live(): void {
    if (this.panic) throw this.panic;
  }
  receive(bytes: Uint8Array): void {
    this.#live();
    this.received.push(...bytes);
  }
  poll(now: Seconds): Uint8Array<ArrayBuffer> {
    this.#live();
    this.polls.push(now);
    return Uint8Array.from(this.toSend.splice(0));
  }
  wake(): Seconds {
    return seconds((this.polls.at(-1) ?? 0) + this.period);
  }
  takeEvents(): MachineEvent[] {
    return this.events.splice(0);
  }
  wish(wish: Wish): Trouble | null {
    this.wishes.push(wish);
    return this.refusal;
  }
  startJob(start: PrintStart, journal: number | null): Trouble | null {
    this.starts.push(start);
    this.journalNumber = journal;
    return this.refusal;
  }
  takeJournal(): string {
    return this.journal.splice(0).join('');
  }
  heldPrint(): number | null {
    return this.held;
  }
  takeUp(journal: Uint8Array): Trouble | null {
    this.takenUp.push(Buffer.from(journal).toString());
    return this.refusal;
  }
  jobWants(): number {
    return this.ended ? 0 : this.wants;
  }
  jobFeed(bytes: Uint8Array): void {
    this.#fed.push(bytes.slice());
    this.wants = Math.max(0, this.wants - bytes.byteLength);
  }
  get fed(): Buffer {
    return Buffer.concat(this.#fed);
  }
  jobEnd(): void {
    this.ended = true;
  }
  snapshot(): SessionSnapshot {
    this.#live();
    return { ...SNAPSHOT, phase: this.phase, job: this.job };
  }
  /** A line through the stretch that was asked for: its speed is the time. */
  plannedSpeed(now: Seconds, behind: Seconds, ahead: Seconds): Float64Array<ArrayBuffer> {
    return Float64Array.of(-behind, now - behind, ahead, now + ahead);
  }
  free(): void {
    this.polls.length = 0;
    this.freed = true;
    this.#live();
  }
}

/** A printer that echoes, `delay` s after it was written to. */
export class EchoPrinter implements SimulatedPrinter {
  readonly written: number[] = [];
  #now = 0;
  #due: { at: number; bytes: number[] }[] = [];
  freed = false;
  readonly delay = 0.002;

  now(): Seconds {
    return seconds(this.#now);
  }
  write(bytes: Uint8Array): void {
    this.written.push(...bytes);
    this.#due.push({ at: this.#now + this.delay, bytes: [...bytes] });
  }
  runUntil(until: Seconds): Uint8Array<ArrayBuffer> {
    const next = this.#due[0];
    if (next && next.at <= until) {
      this.#due.shift();
      this.#now = Math.max(this.#now, next.at);
      return Uint8Array.from(next.bytes);
    }
    this.#now = Math.max(this.#now, until);
    return new Uint8Array();
  }
  record(): VirtualState {
    return {
      time_s: this.#now,
      connected: true,
      motors: [],
      heaters: [],
      fans: [],
      endstops: [],
      shutdown: null,
    };
  }
  free(): void {
    this.freed = true;
  }
}
