// A connection as the worker holds it: the session, the job's file, and what the page is told of both.
//
// The loops (realtime.ts, lockstep.ts) give it bytes and time; it gives them bytes and the next wake-up. Knows neither
// clocks nor ports.
import type { LineErrors } from '../transport/transport';
import { type Seconds, seconds } from '../units';
import { Feeder } from './feeder';
import type { ConfirmedLines, FromMachine, MachineEvent, Snapshot, Trouble, WakeUps, Wish } from './protocol';
import type { Session } from './session';
import { fileBrokeOff, fileUnreadable, stopNotSent } from './troubles';

/** Events that wait to be told; the oldest go first beyond that, and the page is told how many. */
const EVENTS_MAX = 2000;
/** A wake-up that comes later than this after it was asked for is told: the computer slept or was very busy. */
const MISSED_MIN = seconds(1);
/** Of the planned speed, this much is told: what was … */
const SPEED_BEHIND = seconds(20);
/** … and what comes: a little more than the session plans ahead. */
const SPEED_AHEAD = seconds(5);

export class Machine {
  readonly session: Session;
  readonly #tell: (message: FromMachine) => void;
  readonly #lineErrors: () => LineErrors;
  #feeder: Feeder | undefined;
  #starting = false;
  /** The file of the job that waits broke off: it cannot go on. */
  #brokenOff: Trouble | null = null;
  /** An emergency stop that could not be sent yet. */
  #owesStop = false;
  #freed = false;
  #events: MachineEvent[] = [];
  #dropped = 0;
  #wakeUps: WakeUps = { missed: 0, latest: seconds(0) };
  /** Whether the planned speed is told. */
  watchesSpeed = false;

  constructor(session: Session, tell: (message: FromMachine) => void, lineErrors: () => LineErrors) {
    this.session = session;
    this.#tell = tell;
    this.#lineErrors = lineErrors;
  }

  receive(bytes: Uint8Array, now: Seconds): void {
    this.session.receive(bytes, now);
  }

  /** Does what is due: bytes for the port, and the events that came of it. */
  poll(now: Seconds): Uint8Array<ArrayBuffer> {
    this.#feed(now);
    if (this.#owesStop) this.#owesStop = this.session.wish({ kind: 'emergency-stop' }, now) !== null;
    const bytes = this.session.poll(now);
    this.#collect();
    return bytes;
  }

  /** It is this much later than it should be: the computer slept, or was very busy. */
  woke(late: Seconds): void {
    const { missed, latest } = this.#wakeUps;
    const isMissed = late > MISSED_MIN;
    if (isMissed) this.#tell({ kind: 'gap', seconds: late });
    this.#wakeUps = { missed: missed + (isMissed ? 1 : 0), latest: late > latest ? late : latest };
  }

  #feed(now: Seconds): void {
    const feeder = this.#feeder;
    if (!feeder) return;
    feeder.feed();
    if (feeder.failure === undefined) return;
    // What has been sent is carried out, then the machine waits where it is.
    this.dropJob();
    this.session.wish({ kind: 'pause' }, now);
    this.#brokenOff = fileBrokeOff(feeder.failure);
    this.#push({ kind: 'trouble', trouble: this.#brokenOff });
  }

  /** Waits for the job's file where the session wants more of it than has been read. */
  async catchUp(): Promise<void> {
    while (this.#feeder?.isBehind) await this.#feeder.refill();
  }

  get isBehind(): boolean {
    return this.#feeder?.isBehind ?? false;
  }

  #push(event: MachineEvent): void {
    this.#events.push(event);
    if (this.#events.length > EVENTS_MAX) {
      this.#events.shift();
      this.#dropped += 1;
    }
  }

  #collect(): void {
    for (const event of this.session.takeEvents()) {
      this.#push(event);
      if (event.kind === 'done' || event.kind === 'cancelled') this.dropJob();
      else if (event.kind === 'phase' && event.phase !== 'ready') this.dropJob();
    }
  }

  /** Lets go of the job's file, even where it is just being read. */
  dropJob(): void {
    this.#brokenOff = null;
    void this.#feeder?.close();
    this.#feeder = undefined;
  }

  /** Tells the page what happened since last time, and how things are. */
  tell(now: Seconds): void {
    this.#collect();
    if (this.#dropped > 0) this.#events.push({ kind: 'dropped', count: this.#dropped });
    this.#dropped = 0;
    if (this.#events.length > 0) this.#tell({ kind: 'events', events: this.#events });
    this.#events = [];
    const snapshot = this.look(now);
    // A job that ended in an error has no event of its own.
    if (snapshot.job === 'none') this.dropJob();
    this.#tell({ kind: 'snapshot', snapshot });
    if (!this.watchesSpeed) return;
    this.#tell({ kind: 'planned-speed', pairs: this.session.plannedSpeed(now, SPEED_BEHIND, SPEED_AHEAD) });
  }

  /** How things are. */
  look(now: Seconds): Snapshot {
    const snapshot = this.session.snapshot(now);
    const link = snapshot.link && { ...snapshot.link, lineErrors: this.#lineErrors() };
    return { ...snapshot, link, wakeUps: this.#wakeUps };
  }

  wish(wish: Wish, now: Seconds): Trouble | null {
    if (wish.kind === 'resume' && this.#brokenOff) return this.#brokenOff;
    if (wish.kind === 'emergency-stop') return this.#stop(now);
    const trouble = this.session.wish(wish, now);
    this.#collect();
    return trouble;
  }

  /** Before the board has said how it is spoken to, no stop can be put into words: it is sent as soon as it can be. */
  #stop(now: Seconds): Trouble | null {
    const refusal = this.session.wish({ kind: 'emergency-stop' }, now);
    this.#collect();
    if (!refusal) return null;
    this.#owesStop = this.session.snapshot(now).phase === 'identifying';
    return stopNotSent(this.#owesStop ? 'identifying' : 'failed');
  }

  /** Starts a print. `now` is asked for once the file is open. */
  async print(file: Blob, confirmedLines: ConfirmedLines, now: () => Seconds): Promise<Trouble | null> {
    if (this.#starting) return null;
    this.#starting = true;
    try {
      const feeder = await Feeder.open(file, this.session).catch((error: unknown) => fileUnreadable(error));
      if (!(feeder instanceof Feeder)) return feeder;
      const trouble = this.#begin(feeder, confirmedLines, now);
      if (trouble || this.#freed) await feeder.close();
      return trouble;
    } finally {
      this.#starting = false;
    }
  }

  #begin(feeder: Feeder, confirmedLines: ConfirmedLines, now: () => Seconds): Trouble | null {
    if (this.#freed) return null;
    if (feeder.failure !== undefined) return fileUnreadable(feeder.failure);
    const trouble = this.session.startJob(confirmedLines, now());
    if (trouble) return trouble;
    this.dropJob();
    this.#feeder = feeder;
    return null;
  }

  free(): void {
    this.#freed = true;
    this.dropJob();
    this.session.free();
  }
}
