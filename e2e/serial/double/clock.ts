// The clock of the machine worker: its own, or one that it shares with the device at the other end of the bridge.
//
// Shared, time stands still until the bridge says that it has passed, and the bridge waits until everything that was
// due has been done. So a print can run as fast as the computer allows, and a stall of either side causes no fault.
// Takes the place of performance.now, setTimeout and clearTimeout. setInterval stays real: it only tells the page how
// things are.
import type { SharedClock } from './serial.ts';

interface Timer {
  /** ms on this clock. */
  readonly due: number;
  readonly run: () => void;
  /** The real timer, while the clock is free. */
  real: number | undefined;
}

/** A realm that has nothing to do is asked again after this time, in ms. */
const IDLE_MAX_MS = 60_000;
/** Timers that do nothing but set timers are cut off after so many in one turn. */
const RUNS_MAX = 10_000;

const realNow = performance.now.bind(performance);
const realSetTimeout = self.setTimeout.bind(self);
const realClearTimeout = self.clearTimeout.bind(self);

export class WorkerClock implements SharedClock {
  readonly #timers = new Map<number, Timer>();
  readonly #channel = new MessageChannel();
  #lastId = 0;
  /** Free: this clock less the real one. */
  #offset = 0;
  /** Shared: the time, and the time when that began. */
  #shared: { now: number; readonly began: number } | undefined;
  #settled: (() => void) | undefined;

  constructor() {
    this.#channel.port1.onmessage = () => this.#settled?.();
  }

  install(): void {
    Object.defineProperty(performance, 'now', { configurable: true, value: () => this.now() });
    Object.assign(self, {
      setTimeout: (run: (...args: unknown[]) => void, delay?: number, ...args: unknown[]) =>
        this.#set(() => run(...args), delay ?? 0),
      clearTimeout: (id?: number) => this.#clear(id ?? 0),
    });
  }

  now(): number {
    return this.#shared?.now ?? realNow() + this.#offset;
  }

  #set(run: () => void, delay: number): number {
    this.#lastId += 1;
    const id = this.#lastId;
    const timer: Timer = { due: this.now() + Math.max(0, delay), run, real: undefined };
    this.#timers.set(id, timer);
    if (!this.#shared) this.#arm(id, timer);
    return id;
  }

  #arm(id: number, timer: Timer): void {
    timer.real = realSetTimeout(() => {
      this.#timers.delete(id);
      timer.run();
    }, timer.due - this.now());
  }

  #clear(id: number): void {
    realClearTimeout(this.#timers.get(id)?.real);
    this.#timers.delete(id);
  }

  share(): void {
    if (this.#shared) return;
    const now = this.now();
    this.#shared = { now, began: now };
    for (const timer of this.#timers.values()) {
      realClearTimeout(timer.real);
      timer.real = undefined;
    }
  }

  free(): void {
    if (!this.#shared) return;
    this.#offset = this.#shared.now - realNow();
    this.#shared = undefined;
    for (const [id, timer] of this.#timers) this.#arm(id, timer);
  }

  pass(sinceShareMs: number): void {
    const shared = this.#shared;
    if (shared) shared.now = Math.max(shared.now, shared.began + sinceShareMs);
  }

  runDue(idle: (untilMs: number) => void): void {
    for (let runs = 0; runs < RUNS_MAX; runs += 1) {
      const next = this.#next();
      if (!next || next[1].due > this.now()) break;
      this.#timers.delete(next[0]);
      try {
        next[1].run();
      } catch (error) {
        reportError(error);
      }
    }
    // Behind everything that the timers and the bytes before them have set off.
    this.#settled = () => {
      const shared = this.#shared;
      if (!shared) return;
      const due = this.#next()?.[1].due ?? Number.POSITIVE_INFINITY;
      idle(Math.min(due, shared.now + IDLE_MAX_MS) - shared.began);
    };
    this.#channel.port2.postMessage(null);
  }

  #next(): [number, Timer] | undefined {
    let first: [number, Timer] | undefined;
    for (const entry of this.#timers) if (!first || entry[1].due < first[1].due) first = entry;
    return first;
  }
}
