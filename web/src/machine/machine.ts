// A connection as the worker holds it: the session, the job's file, and what the page is told of both.
//
// The loops (realtime.ts, lockstep.ts) give it bytes and time; it gives them bytes and the next wake-up. Knows neither
// clocks nor ports.
import type { LineErrors } from '../transport/transport';
import { type Seconds, seconds } from '../units';
import type { PrintLog } from './archive';
import { Feeder } from './feeder';
import type {
  FromMachine,
  MachineEvent,
  Phase,
  PrintStart,
  Snapshot,
  Trouble,
  WakeUps,
  Wish,
} from './protocol';
import type { Session } from './session';
import { fileBrokeOff, fileUnreadable, stopNotSent } from './troubles';

/** Events that wait to be told; the oldest go first beyond that, and the page is told how many. */
const EVENTS_MAX = 2000;
/** A wake-up that comes later than this after it was asked for is told: the computer slept or was very busy. */
const MISSED_MIN = seconds(1);
/** Of the planned speed, this much is told: what was … */
const SPEED_BEHIND = seconds(20);
/** … and what comes: a little more than the session plans ahead. */
const SPEED_AHEAD = seconds(11);

/** While a plan is made again: so many pieces of it in one go … */
const PIECES_MAX = 16;
/** … and then again after this time. */
const PIECES_EVERY = seconds(0.004);

/** How a print ended for this page: whole; at the user's word; with a board that has forgotten it; or it may go on. */
export type Ending = 'done' | 'over' | 'lost' | 'left';

/** Who keeps prints, and follows what happens to them. */
export interface Keeping {
  onEvent(event: MachineEvent): void;
  /** The page is told how things are now. */
  onTell(): void;
  settle(log: PrintLog, ending: Ending): Promise<void>;
}

export class Machine {
  readonly session: Session;
  readonly #tell: (message: FromMachine) => void;
  readonly #lineErrors: () => LineErrors;
  readonly #keeping: Keeping | undefined;
  #feeder: Feeder | undefined;
  /** Of the job. */
  #log: PrintLog | null = null;
  #logClosed: Promise<void> = Promise.resolve();
  /** The file is fed so that the plan of a print that the board holds is made again. */
  #isTakingUp = false;
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

  constructor(
    session: Session,
    tell: (message: FromMachine) => void,
    lineErrors: () => LineErrors,
    keeping?: Keeping,
  ) {
    this.session = session;
    this.#tell = tell;
    this.#lineErrors = lineErrors;
    this.#keeping = keeping;
  }

  receive(bytes: Uint8Array, now: Seconds): void {
    this.session.receive(bytes, now);
  }

  /** Does what is due: bytes for the port, and the events that came of it. */
  poll(now: Seconds): Uint8Array<ArrayBuffer> {
    this.#feed(now);
    if (this.#owesStop) this.#owesStop = this.session.wish({ kind: 'emergency-stop' }, now) !== null;
    const pieces = [this.session.poll(now)];
    this.#keepJournal();
    while (this.#isTakingUp && pieces.length < PIECES_MAX && this.#feeder?.feed()) {
      pieces.push(this.session.poll(now));
      this.#keepJournal();
    }
    this.#collect();
    return pieces.length === 1 && pieces[0] ? pieces[0] : joined(pieces);
  }

  /** When `poll` is to be called again if nothing arrives before. */
  wake(now: Seconds): Seconds {
    const wake = this.session.wake();
    return this.#isTakingUp ? (Math.min(wake, now + PIECES_EVERY) as Seconds) : wake;
  }

  /** Before anything is sent that it is about. */
  #keepJournal(): void {
    const text = this.session.takeJournal();
    if (text !== '') this.#log?.append(text);
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
    if (this.#isTakingUp) return this.#push({ kind: 'trouble', trouble: this.dropTakeUp(feeder.failure) });
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
    this.#keeping?.onEvent(event);
  }

  #collect(): void {
    this.#keepJournal();
    for (const event of this.session.takeEvents()) {
      if (event.kind === 'done') this.#jobOver('done');
      else if (event.kind === 'cancelled') this.#jobOver('over');
      else if (event.kind === 'phase') this.#onPhase(event.phase);
      this.#push(event);
    }
  }

  #onPhase(phase: Phase): void {
    if (phase === 'ready') this.#isTakingUp = false;
    // A board that has stopped has forgotten its moves; one that is out of reach may hold them.
    else if (phase !== 'holding') this.#jobOver(phase === 'shutdown' ? 'lost' : 'left');
  }

  #jobOver(ending: Ending): void {
    this.#isTakingUp = false;
    this.dropJob();
    const log = this.#log;
    this.#log = null;
    if (log) this.#logClosed = this.#keeping?.settle(log, ending) ?? log.close();
  }

  /** Settles once the record of the last print is closed. */
  logClosed(): Promise<void> {
    return this.#logClosed;
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
    if (snapshot.job === 'none' && !this.#isTakingUp) this.#jobOver('left');
    this.#keeping?.onTell();
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

  /** Starts a print. `now` is asked for once the file is open, and so is a record of the print, where one is kept. */
  async print(
    file: Blob,
    start: PrintStart,
    now: () => Seconds,
    openLog: () => Promise<PrintLog | null> = async () => null,
  ): Promise<Trouble | null> {
    if (this.#starting) return null;
    this.#starting = true;
    try {
      const feeder = await Feeder.open(file, this.session).catch((error: unknown) => fileUnreadable(error));
      if (!(feeder instanceof Feeder)) return feeder;
      const log = feeder.failure === undefined ? await openLog() : null;
      const trouble = this.#begin(feeder, log, start, now);
      if (trouble || this.#freed) {
        await feeder.close();
        if (log) await this.#keeping?.settle(log, 'over');
      }
      return trouble;
    } finally {
      this.#starting = false;
    }
  }

  #begin(feeder: Feeder, log: PrintLog | null, start: PrintStart, now: () => Seconds): Trouble | null {
    if (this.#freed) return null;
    if (feeder.failure !== undefined) return fileUnreadable(feeder.failure);
    const trouble = this.session.startJob(start, log?.number ?? null, now());
    if (trouble) return trouble;
    this.dropJob();
    this.#feeder = feeder;
    this.#log = log;
    return null;
  }

  /** The number that the board gives for the print it holds; null where it holds none. */
  heldPrint(): number | null {
    return this.#freed ? null : this.session.heldPrint();
  }

  /** Begins to make the plan of the print that the board holds again. `log` stays the caller's where this is refused. */
  async takeUp(journal: Uint8Array, file: Blob, log: PrintLog): Promise<Trouble | null> {
    const feeder = await Feeder.open(file, this.session).catch((error: unknown) => fileUnreadable(error));
    if (!(feeder instanceof Feeder)) return feeder;
    const trouble =
      this.#freed || feeder.failure !== undefined
        ? fileUnreadable(feeder.failure ?? 'the connection has ended')
        : this.session.takeUp(journal);
    if (trouble) {
      await feeder.close();
      return trouble;
    }
    this.dropJob();
    this.#feeder = feeder;
    this.#log = log;
    this.#isTakingUp = true;
    return null;
  }

  /** Gives up making a plan again; what is said where its file could not be read. */
  dropTakeUp(reason?: unknown): Trouble {
    if (this.#isTakingUp) this.#jobOver('left');
    return fileUnreadable(reason);
  }

  /** Of the job's file. */
  get fileBytesRead(): number {
    return this.#feeder?.bytesRead ?? 0;
  }

  free(): void {
    this.#freed = true;
    this.#jobOver('left');
    this.session.free();
  }
}

function joined(pieces: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.byteLength, 0));
  let at = 0;
  for (const piece of pieces) {
    all.set(piece, at);
    at += piece.byteLength;
  }
  return all;
}
