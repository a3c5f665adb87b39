// A connection from its beginning to its one end: tells the page how things are, and lets go of port and planner whatever
// went wrong. Knows neither ports nor locks; times in ms where not said otherwise.
import type { VirtualState } from '../bindings/VirtualState';
import type { Seconds } from '../units';
import type { Machine } from './machine';
import type { FromMachine, Trouble } from './protocol';

/** How often the page is told how things are, in ms. */
export const TELL_MS = 100;

/** What a connection consists of. */
export interface Parts {
  readonly machine: Machine;
  readonly now: () => Seconds;
  readonly tick: () => void;
  readonly setSpeed: (speed: number) => void;
  /** The printer's own record, where it is a virtual one. */
  readonly record: (() => VirtualState) | null;
  /** Settles when the port is gone; null where there is none. */
  readonly lost: Promise<Trouble> | null;
  /** Lets time pass; `onFailure` is told what was thrown meanwhile. */
  readonly start: (onFailure: (error: unknown) => void) => void;
  /** Ends that, and closes the port. */
  readonly stop: () => Promise<void>;
}

/** Something was thrown that nobody foresaw: the planner cannot be relied on any more. */
export class Died extends Error {
  constructor(cause: unknown) {
    super(cause instanceof Error ? cause.message : String(cause), { cause });
    this.name = 'Died';
  }
}

export class Connection {
  readonly parts: Parts;
  readonly #tell: (message: FromMachine) => void;
  #timer: ReturnType<typeof setInterval> | undefined;
  #isOver = false;
  #failure: Died | undefined;
  /** A snapshot is on its way to the page, which may be busy. */
  #isUnseen = false;
  #settle: (trouble: Trouble | null) => void = () => undefined;
  #reject: (error: Died) => void = () => undefined;

  constructor(parts: Parts, tell: (message: FromMachine) => void) {
    this.parts = parts;
    this.#tell = tell;
  }

  /** Ended, or just ending: nothing can be asked of it. */
  get isOver(): boolean {
    return this.#isOver;
  }

  /** Goes on until the connection has ended; why it has. Rejects with `Died`; everything is let go of then, too. */
  run(): Promise<Trouble | null> {
    return new Promise((resolve, reject) => {
      this.#settle = resolve;
      this.#reject = reject;
      this.#tell({ kind: 'opened' });
      this.#timer = setInterval(() => this.attempt(() => this.#tellWhenSeen()), TELL_MS);
      void this.parts.lost?.then((trouble) => this.end(trouble));
      this.attempt(() => this.parts.start((error) => this.fail(error)));
    });
  }

  /** Does something for the page; what it throws ends the connection. */
  attempt(act: (parts: Parts) => void): void {
    if (this.#isOver) return;
    try {
      act(this.parts);
    } catch (error) {
      this.fail(error);
    }
  }

  /** The page has the snapshot. */
  seen(): void {
    this.#isUnseen = false;
  }

  #tellWhenSeen(): void {
    if (this.#isUnseen) return;
    this.#isUnseen = true;
    this.#tellAll();
  }

  #tellAll(): void {
    const { machine, now, record } = this.parts;
    machine.tell(now());
    if (record) this.#tell({ kind: 'record', record: record() });
  }

  end(trouble: Trouble | null): void {
    if (!this.#isOver) void this.#close(trouble);
  }

  fail(error: unknown): void {
    if (this.#isOver) return;
    this.#failure = new Died(error);
    this.end(null);
  }

  async #close(trouble: Trouble | null): Promise<void> {
    this.#isOver = true;
    clearInterval(this.#timer);
    const { machine, stop } = this.parts;
    // Each whatever became of the one before. The last word first, while there still is a clock to ask: stopping lets
    // go of the virtual printer. A file that is just being read is not waited for.
    await this.#finally(() => this.#tellAll());
    await this.#finally(() => machine.dropJob());
    await this.#finally(stop);
    await this.#finally(() => machine.free());
    if (this.#failure) this.#reject(this.#failure);
    else this.#settle(trouble);
  }

  async #finally(act: () => Promise<void> | void): Promise<void> {
    try {
      await act();
    } catch (error) {
      this.#failure ??= new Died(error);
    }
  }
}
