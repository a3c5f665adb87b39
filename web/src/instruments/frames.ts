// When to draw: with the next frame for what the user does, and no more than ten times a second for news.
// Nothing is drawn where nothing changed. Does not know what is drawn.
import type { Milliseconds } from '../units';

/** The shortest time between two pictures that only show news. */
export const NEWS_MS = 100;

/** The clock and timers of the realm that it runs in; times in ms. */
export interface FrameClock {
  now(): number;
  requestFrame(callback: () => void): number;
  setTimer(callback: () => void, delay: number): number;
  clearTimer(handle: number): void;
}

export class Frames {
  readonly #draw: () => Milliseconds;
  readonly #clock: FrameClock;
  #isRequested = false;
  #isStopped = false;
  #timer: number | null = null;
  #timerDue = Number.POSITIVE_INFINITY;
  #drawnAt = Number.NEGATIVE_INFINITY;

  /** `draw` returns after how long it wants to be called again; infinite for never. */
  constructor(draw: () => Milliseconds, clock: FrameClock) {
    this.#draw = draw;
    this.#clock = clock;
  }

  /** With the next frame. */
  now(): void {
    if (this.#isRequested || this.#isStopped) return;
    this.#isRequested = true;
    this.#clearTimer();
    this.#clock.requestFrame(() => {
      this.#isRequested = false;
      if (!this.#isStopped) this.#drawNow();
    });
  }

  /** As soon as the last picture is old enough. */
  soon(): void {
    this.#at(this.#drawnAt + NEWS_MS);
  }

  stop(): void {
    this.#isStopped = true;
    this.#clearTimer();
  }

  #drawNow(): void {
    this.#drawnAt = this.#clock.now();
    const delay = this.#draw();
    if (Number.isFinite(delay)) this.#at(this.#drawnAt + delay);
  }

  #at(due: number): void {
    if (this.#isRequested || this.#isStopped || due >= this.#timerDue) return;
    this.#clearTimer();
    const delay = due - this.#clock.now();
    if (delay <= 0) return this.now();
    this.#timerDue = due;
    this.#timer = this.#clock.setTimer(() => {
      this.#clearTimer();
      this.now();
    }, delay);
  }

  #clearTimer(): void {
    if (this.#timer !== null) this.#clock.clearTimer(this.#timer);
    this.#timer = null;
    this.#timerDue = Number.POSITIVE_INFINITY;
  }
}
