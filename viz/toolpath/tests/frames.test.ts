import { describe, expect, test } from 'vitest';
import { DetailBudget, FRAME_TARGET_MS, SmoothChoice } from '../src/detail';
import { type FrameClock, FrameLoop, type FrameReport, type Painter } from '../src/frames';

/** A clock that is driven by the test. */
class TestClock implements FrameClock {
  time = 0;
  #next = 1;
  readonly #due = new Map<number, { at: number; callback: () => void }>();

  now(): number {
    return this.time;
  }
  requestFrame(callback: () => void): number {
    return this.setTimer(callback, 16);
  }
  cancelFrame(handle: number): void {
    this.#due.delete(handle);
  }
  setTimer(callback: () => void, delayMs: number): number {
    this.#due.set(this.#next, { at: this.time + delayMs, callback });
    return this.#next++;
  }
  clearTimer(handle: number): void {
    this.#due.delete(handle);
  }
  run(until: number): void {
    for (let step = 0; step < 100_000; step++) {
      const [handle, next] = [...this.#due].sort(([, a], [, b]) => a.at - b.at)[0] ?? [];
      if (handle === undefined || !next || next.at > until) break;
      this.#due.delete(handle);
      this.time = Math.max(this.time, next.at);
      next.callback();
    }
    this.time = until;
  }
  get idle(): boolean {
    return this.#due.size === 0;
  }
}

/** A GPU that takes so long for each segment. */
function setUp(total: number, msPerSegment: number) {
  const clock = new TestClock();
  const reports: FrameReport[] = [];
  let [busyUntil, at, patches, overlays] = [0, 0, 0, 0];
  const spend = (segments: number): number => {
    busyUntil = clock.time + 3 + segments * msPerSegment;
    return segments;
  };
  const painter: Painter = {
    fullSegments: () => total,
    drawQuick: (budget) => spend(Math.min(budget, total)),
    drawSlice: (budget, restart) => {
      if (restart) at = 0;
      const segments = spend(Math.min(budget, total - at));
      at += segments;
      return { segments, complete: at >= total };
    },
    patch: () => {
      patches += 1;
      return true;
    },
    overlay: () => {
      overlays += 1;
      spend(0);
    },
    fence: () => () => clock.time >= busyUntil,
  };
  const loop = new FrameLoop(painter, clock, (report) => reports.push(report));
  return { clock, loop, reports, patches: () => patches, overlays: () => overlays };
}

describe('the loop of frames', () => {
  test('a slow GPU: quick frames near the target while moving, then one full picture', () => {
    const { clock, loop, reports } = setUp(1_000_000, 0.001);
    for (let step = 0; step < 60; step++) {
      loop.moved();
      clock.run(clock.time + 16);
    }
    clock.run(clock.time + 5_000);
    const quick = reports.filter(({ kind }) => kind === 'quick');
    expect(quick.length).toBeGreaterThan(10);
    for (const { longestMs } of quick.slice(2)) expect(longestMs).toBeLessThan(50);
    const full = reports.filter(({ kind }) => kind === 'full');
    expect(full).toHaveLength(1);
    expect(full[0]?.segments).toBe(1_000_000);
    // Only behind the last one nothing follows.
    expect(reports.map(({ more }) => more).lastIndexOf(true)).toBe(reports.length - 2);
    expect(reports.filter(({ more }) => !more)).toEqual(full);
    expect(full[0]?.longestMs).toBeLessThan(60);
    expect(clock.idle).toBe(true);
  });

  test('a fast GPU: full pictures at once', () => {
    const { clock, loop, reports } = setUp(100_000, 0.00001);
    loop.moved();
    clock.run(1_000);
    const before = reports.length;
    for (let step = 0; step < 20; step++) {
      loop.moved();
      clock.run(clock.time + 40);
    }
    expect(reports.slice(before).every(({ kind }) => kind === 'full')).toBe(true);
    expect(clock.idle).toBe(true);
  });

  test('movement abandons the full picture that is being drawn', () => {
    const { clock, loop, reports } = setUp(1_000_000, 0.001);
    loop.moved();
    clock.run(500);
    loop.moved();
    clock.run(600);
    expect(reports.some(({ kind }) => kind === 'full')).toBe(false);
    expect(reports.at(-1)?.kind).toBe('quick');
  });

  test('what was printed is mended on the full picture, without a new one', () => {
    const { clock, loop, reports, patches } = setUp(300_000, 0.001);
    loop.moved();
    clock.run(3_000);
    loop.patched();
    clock.run(4_000);
    expect(patches()).toBe(1);
    expect(reports.filter(({ kind }) => kind === 'full')).toHaveLength(1);
  });
});

describe('the loop of frames, besides moving pictures', () => {
  test('what lies over the picture moves without drawing the picture anew', () => {
    const { clock, loop, reports, overlays } = setUp(300_000, 0.001);
    loop.overlaid();
    expect(clock.idle).toBe(true);
    loop.moved();
    clock.run(3_000);
    for (let step = 0; step < 10; step++) {
      loop.overlaid();
      clock.run(clock.time + 100);
    }
    expect(overlays()).toBe(10);
    expect(reports.filter(({ kind }) => kind === 'full')).toHaveLength(1);
    expect(clock.idle).toBe(true);
  });

  test('who waits for the picture is told once it is full, and at once where it is', () => {
    const { clock, loop, reports } = setUp(1_000_000, 0.001);
    const told: string[] = [];
    loop.moved();
    loop.onRest(() => told.push(`first, behind ${reports.at(-1)?.kind}`));
    clock.run(500);
    expect(told).toEqual([]);
    loop.moved();
    loop.onRest(() => told.push('second'));
    clock.run(5_000);
    expect(told).toEqual(['first, behind full', 'second']);
    loop.onRest(() => told.push('third'));
    expect(told).toHaveLength(3);
  });

  test('a lost context stops it, a restored one starts it again', () => {
    const { clock, loop, reports } = setUp(1_000, 0.001);
    loop.moved();
    loop.pause();
    loop.moved();
    clock.run(1_000);
    expect(reports).toHaveLength(0);
    loop.resume();
    clock.run(2_000);
    expect(reports.at(-1)?.kind).toBe('full');
  });
});

describe('the budget', () => {
  test('finds what fits, with a fixed cost apart', () => {
    const budget = new DetailBudget();
    for (let frame = 0; frame < 40; frame++) {
      budget.measured(0, 10);
      budget.measured(budget.segments, 10 + budget.segments * 0.0005);
    }
    expect(10 + budget.segments * 0.0005).toBeGreaterThan(FRAME_TARGET_MS * 0.8);
    expect(10 + budget.segments * 0.0005).toBeLessThan(FRAME_TARGET_MS * 1.2);
  });

  test('senseless measurements change nothing', () => {
    const budget = new DetailBudget();
    budget.measured(Number.NaN, 5);
    budget.measured(5_000, Number.NaN);
    expect(budget.segments).toBe(16_000);
  });
});

describe('pictures of large files', () => {
  test('how far a full picture is is told now and then, and what it was in the end', () => {
    const { clock, loop, reports } = setUp(5_000_000, 0.001);
    loop.moved();
    clock.run(20_000);
    const parts = reports.filter(({ kind }) => kind === 'part');
    expect(parts.length).toBeGreaterThan(5);
    const shares = parts.map(({ share }) => share);
    expect([...shares].sort((one, other) => one - other)).toEqual(shares);
    expect(shares[0]).toBeLessThan(0.2);
    expect(parts.every(({ more, share }) => more && share < 1)).toBe(true);
    expect(reports.at(-1)).toMatchObject({ kind: 'full', share: 1, more: false });
  });

  test('while a file grows no full picture is begun', () => {
    const { clock, loop, reports } = setUp(1_000_000, 0.001);
    for (let step = 0; step < 10; step++) {
      loop.grew();
      clock.run(clock.time + 1000);
    }
    expect(reports.every(({ kind }) => kind === 'quick')).toBe(true);
    expect(reports.length).toBeGreaterThan(8);
    loop.moved();
    clock.run(clock.time + 3000);
    expect(reports.at(-1)).toMatchObject({ kind: 'full' });
    expect(clock.idle).toBe(true);
  });
});

describe('a file that comes', () => {
  /** Bytes come every 10 ms for so long. */
  const grow = ({ clock, loop }: ReturnType<typeof setUp>, ms: number): void => {
    const until = clock.time + ms;
    while (clock.time < until) {
      loop.grew();
      clock.run(clock.time + 10);
    }
  };

  test('its first picture is drawn at once, and where pictures take long they leave the processor to the reading', () => {
    const slow = setUp(1_000_000, 0.02);
    slow.loop.begins();
    grow(slow, 5_000);
    const { reports } = slow;
    expect(reports[0]?.kind).toBe('quick');
    expect(reports.every(({ kind }) => kind === 'quick')).toBe(true);
    expect(reports.reduce((sum, { totalMs }) => sum + totalMs, 0)).toBeLessThan(5_000 / 6);

    const fast = setUp(1_000_000, 0.000_1);
    // Everything fits into a frame, once that is known.
    fast.loop.begins();
    grow(fast, 5_000);
    expect(fast.reports.length).toBeGreaterThanOrEqual(6);
    expect(reports.length).toBeLessThan(fast.reports.length);
  });

  test('the next file shows itself at once again', () => {
    const made = setUp(1_000_000, 0.02);
    made.loop.begins();
    grow(made, 3_000);
    const before = made.reports.length;
    made.loop.begins();
    made.loop.grew();
    made.clock.run(made.clock.time + 500);
    expect(made.reports.length).toBe(before + 1);
  });

  test('a picture from before does not delay the first one', () => {
    const made = setUp(1_000_000, 0.02);
    made.loop.moved();
    made.clock.run(20);
    // That one is still being drawn.
    expect(made.reports).toHaveLength(0);
    made.loop.begins();
    grow(made, 1_000);
    const { reports } = made;
    expect(reports.length).toBeGreaterThanOrEqual(2);
    expect(reports[0]?.totalMs).toBeGreaterThan(100);
  });

  test('who moves the view meanwhile gets no full picture before it is whole', () => {
    const made = setUp(1_000_000, 0.001);
    made.loop.begins();
    grow(made, 500);
    made.loop.moved();
    grow(made, 1_000);
    expect(made.reports.every(({ kind }) => kind === 'quick')).toBe(true);
    made.loop.ended();
    made.clock.run(made.clock.time + 20_000);
    expect(made.reports.at(-1)).toMatchObject({ kind: 'full', more: false });
    expect(made.clock.idle).toBe(true);
  });

  test('what changes at its end is one picture where that takes long, and who waits for rest waits for it', () => {
    const { clock, loop, reports } = setUp(1_000_000, 0.02);
    loop.moved();
    clock.run(30_000);
    expect(reports.at(-1)?.kind).toBe('full');
    const before = reports.length;
    const told: string[] = [];
    loop.changed();
    loop.onRest(() => told.push(`behind ${reports.at(-1)?.kind}`));
    loop.ended();
    clock.run(clock.time + 50);
    loop.changed();
    expect(reports.length).toBe(before);
    clock.run(clock.time + 30_000);
    expect(reports.slice(before).filter(({ kind }) => kind === 'quick')).toHaveLength(1);
    expect(told).toEqual(['behind full']);
    expect(clock.idle).toBe(true);
  });
});

describe('several samples a pixel', () => {
  test('are given up where they take long, and come back where that was not their fault', () => {
    const choice = new SmoothChoice();
    expect(choice.isWorth(1_000_000)).toBe(true);
    choice.measured(true, 1_000_000, 4000);
    expect(choice.isWorth(1_000_000)).toBe(false);
    // Less to draw is worth it again.
    expect(choice.isWorth(100_000)).toBe(true);
    choice.measured(false, 1_000_000, 2000);
    expect(choice.isWorth(1_000_000)).toBe(false);
    // The machine was busy with something else.
    choice.measured(false, 1_000_000, 100);
    expect(choice.isWorth(1_000_000)).toBe(true);
    choice.measured(true, 1_000_000, 250);
    expect(choice.isWorth(1_000_000)).toBe(true);
  });

  test('small pictures always have them, and another size is measured anew', () => {
    const choice = new SmoothChoice();
    choice.measured(true, 20_000, 60_000);
    expect(choice.isWorth(20_000)).toBe(true);
    expect(choice.isWorth(1_000_000)).toBe(false);
    choice.reset();
    expect(choice.isWorth(1_000_000)).toBe(true);
  });
});
