// The loop between a session and the printer in this page, on one virtual clock that both share.
//
// Time passes only as the two let it: it is the simulated printer's own, and it waits for whichever is behind, so a slow
// computer or a hidden tab causes no fault. `speed` is how many seconds of it may pass in a real one, at most.
import type { Seconds } from '../units';
import type { Machine } from './machine';
import type { SimulatedPrinter } from './session';

/** After so long the worker looks at its messages, in ms. */
const SLICE_MS = 10;
/** The session is called again after this time at the earliest, whatever it asks for. */
const WAKE_MIN_S = 50e-6;
/** What cannot be kept up with is not made up for beyond this, in s of real time. */
const BEHIND_MAX_S = 0.25;
/** Rests between slices, in ms. */
const REST_MIN_MS = 4;
const REST_MAX_MS = 20;

export class LockstepLoop {
  readonly #machine: Machine;
  readonly #printer: SimulatedPrinter;
  readonly #realNow: () => Seconds;
  #speed: number;
  #anchor: { real: Seconds; virtual: Seconds };
  #stopped = false;
  #done: Promise<void> = Promise.resolve();
  #wakeUp: (() => void) | undefined;

  constructor(machine: Machine, printer: SimulatedPrinter, speed: number, realNow: () => Seconds) {
    this.#machine = machine;
    this.#printer = printer;
    this.#speed = speed;
    this.#realNow = realNow;
    this.#anchor = { real: realNow(), virtual: printer.now() };
  }

  start(onFailure: (error: unknown) => void): void {
    this.#done = this.#run().catch(onFailure);
  }

  setSpeed(speed: number): void {
    this.#anchor = { real: this.#realNow(), virtual: this.#printer.now() };
    this.#speed = speed;
  }

  /** Ends the current rest, so that a wish is carried out at once. */
  readonly tick = (): void => this.#wakeUp?.();

  async #run(): Promise<void> {
    while (!this.#stopped) {
      if (this.#machine.isBehind) await this.#machine.catchUp();
      if (this.#stopped) return;
      const began = this.#realNow();
      const rest = this.#slice();
      if (rest > 0) await this.#rest(rest);
      else await breath();
      this.#machine.woke((this.#realNow() - began - (SLICE_MS + rest) / 1000) as Seconds);
    }
  }

  /** How far virtual time may be by now. */
  #limit(): number {
    const { real, virtual } = this.#anchor;
    const limit = virtual + (this.#realNow() - real) * this.#speed;
    const behind = limit - this.#printer.now();
    if (behind > BEHIND_MAX_S * this.#speed) {
      this.#anchor = { real: this.#realNow(), virtual: this.#printer.now() };
      return this.#printer.now();
    }
    return limit;
  }

  /** Lets time pass up to the limit or for a slice of real time; returns for how many ms to rest after it. */
  #slice(): number {
    const began = performance.now();
    const limit = this.#limit();
    let wake = this.#attend();
    while (this.#printer.now() < limit) {
      if (this.#machine.isBehind || performance.now() - began > SLICE_MS) return 0;
      const until = Math.min(Math.max(wake, this.#printer.now() + WAKE_MIN_S), limit);
      const bytes = this.#printer.runUntil(until as Seconds);
      if (bytes.byteLength > 0) this.#machine.receive(bytes, this.#printer.now());
      wake = this.#attend();
    }
    const idle = ((wake - this.#printer.now()) / this.#speed) * 1000;
    return Math.min(REST_MAX_MS, Math.max(REST_MIN_MS, idle));
  }

  #attend(): number {
    const bytes = this.#machine.poll(this.#printer.now());
    if (bytes.byteLength > 0) this.#printer.write(bytes);
    return this.#machine.wake(this.#printer.now());
  }

  #rest(ms: number): Promise<void> {
    return new Promise((resolve) => {
      const end = (): void => {
        clearTimeout(timer);
        this.#wakeUp = undefined;
        resolve();
      };
      const timer = setTimeout(end, ms);
      this.#wakeUp = end;
    });
  }

  async stop(): Promise<void> {
    this.#stopped = true;
    this.#wakeUp?.();
    await this.#done;
    this.#printer.free();
  }
}

/** Lets the worker's messages be handled. A message channel, because timers rest for 4 ms at least. */
const channel = new MessageChannel();
let resume: (() => void) | undefined;
channel.port1.onmessage = () => resume?.();

function breath(): Promise<void> {
  return new Promise((resolve) => {
    resume = resolve;
    channel.port2.postMessage(undefined);
  });
}
