// The graphs are drawn when something changed, at once for the user, ten times a second at most for news.
import { expect, test } from 'vitest';
import { type FrameClock, Frames, NEWS_MS } from '../src/instruments/frames';
import { milliseconds } from '../src/units';

/** A clock and its timers; frames come at once when asked for. */
class Clock implements FrameClock {
  time = 0;
  #frames: (() => void)[] = [];
  #timers = new Map<number, { due: number; callback: () => void }>();
  #handle = 0;

  now = (): number => this.time;

  requestFrame = (callback: () => void): number => this.#frames.push(callback);

  setTimer = (callback: () => void, delay: number): number => {
    this.#handle += 1;
    this.#timers.set(this.#handle, { due: this.time + delay, callback });
    return this.#handle;
  };

  clearTimer = (handle: number): void => {
    this.#timers.delete(handle);
  };

  get pending(): number {
    return this.#frames.length + this.#timers.size;
  }

  /** Lets time pass in steps of 1 ms. */
  pass(duration: number): void {
    for (const end = this.time + duration; this.time < end; ) {
      this.time += 1;
      for (const [handle, { due, callback }] of [...this.#timers]) {
        if (due > this.time) continue;
        this.#timers.delete(handle);
        callback();
      }
      for (const callback of this.#frames.splice(0)) callback();
    }
  }
}

function setUp(delays: number[] = []): { clock: Clock; frames: Frames; drawn: number[] } {
  const clock = new Clock();
  const drawn: number[] = [];
  const frames = new Frames(() => {
    drawn.push(clock.time);
    return milliseconds(delays.shift() ?? Number.POSITIVE_INFINITY);
  }, clock);
  return { clock, frames, drawn };
}

test('where nothing changes nothing is drawn, and nothing waits', () => {
  const { clock, frames, drawn } = setUp();
  frames.now();
  clock.pass(5000);
  expect(drawn).toEqual([1]);
  expect(clock.pending).toBe(0);
});

test('news are drawn ten times a second at most, and the last of them always', () => {
  const { clock, frames, drawn } = setUp();
  for (let i = 0; i < 200; i += 1) {
    frames.soon();
    clock.pass(5);
  }
  expect(drawn.length).toBeGreaterThan(8);
  expect(drawn.length).toBeLessThanOrEqual(1000 / NEWS_MS + 1);
  frames.soon();
  const before = drawn.length;
  clock.pass(NEWS_MS + 1);
  expect(drawn).toHaveLength(before + 1);
});

test('what the user does is drawn with the next frame, once', () => {
  const { clock, frames, drawn } = setUp();
  frames.soon();
  clock.pass(10);
  frames.soon();
  frames.now();
  frames.now();
  clock.pass(1);
  expect(drawn).toHaveLength(2);
  clock.pass(1000);
  expect(drawn).toHaveLength(2);
});

test('a picture that is not at rest is drawn again when it asked for it', () => {
  const { clock, frames, drawn } = setUp([50, 0]);
  frames.now();
  clock.pass(200);
  expect(drawn[1]).toBeGreaterThanOrEqual(51);
  expect(drawn[1]).toBeLessThanOrEqual(53);
  expect(drawn).toHaveLength(3);
});

test('after the end nothing is drawn, not even what was asked for before', () => {
  const { clock, frames, drawn } = setUp();
  frames.now();
  frames.stop();
  frames.soon();
  frames.now();
  clock.pass(1000);
  expect(drawn).toEqual([]);
});
