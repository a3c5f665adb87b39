// Session and virtual printer share one clock, which runs no faster than asked and waits for whoever is behind.
// The real clock is the test's own: how busy the computer is makes no difference.
import { expect, test, vi } from 'vitest';
import { LockstepLoop } from '../src/machine/lockstep';
import { Machine } from '../src/machine/machine';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';
import { EchoPrinter, FakeSession } from './fake_session';

interface Running {
  readonly session: FakeSession;
  readonly printer: EchoPrinter;
  readonly loop: LockstepLoop;
  /** Lets so many s of real time pass at once. */
  readonly pass: (time: number) => void;
}

function running(speed: number): Running {
  let clock = 1000;
  const session = new FakeSession();
  session.toSend = [1, 2, 3];
  const printer = new EchoPrinter();
  const machine = new Machine(
    session,
    () => undefined,
    () => NO_LINE_ERRORS,
  );
  const loop = new LockstepLoop(machine, printer, speed, () => seconds(clock));
  loop.start((error) => {
    throw error;
  });
  const pass = (time: number): void => {
    clock += time;
  };
  return { session, printer, loop, pass };
}

/** Until the loop has been round so many times. */
async function rounds({ session }: Running, count: number): Promise<void> {
  const until = session.polls.length + count;
  await vi.waitFor(() => expect(session.polls.length).toBeGreaterThanOrEqual(until), { timeout: 10_000 });
}

test.each([1, 50])('at %d times real time, time passes as fast and never faster', async (speed) => {
  const all = running(speed);
  const { printer, loop, pass } = all;
  for (let step = 1; step <= 20; step += 1) {
    pass(0.05);
    await vi.waitFor(() => expect(printer.now()).toBeCloseTo(step * 0.05 * speed, 9), { timeout: 10_000 });
  }
  // The clock stands: so does the printer's.
  await rounds(all, 3);
  expect(printer.now()).toBeCloseTo(speed, 9);
  await loop.stop();
});

test('bytes go to the printer and back, and the printer is let go at the end', async () => {
  const { session, printer, loop, pass } = running(10);
  pass(0.05);
  await vi.waitFor(() => expect(session.received).toEqual([1, 2, 3]), { timeout: 10_000 });
  expect(printer.written).toEqual([1, 2, 3]);
  await loop.stop();
  expect(printer.freed).toBe(true);
});

test('while the worker is held up no time passes for the two', async () => {
  const all = running(1);
  const { printer, loop, pass } = all;
  pass(0.1);
  await vi.waitFor(() => expect(printer.now()).toBeCloseTo(0.1, 9), { timeout: 10_000 });
  pass(0.8);
  await rounds(all, 3);
  expect(printer.now()).toBeCloseTo(0.1, 9);
  // From then on it goes on as before.
  pass(0.1);
  await vi.waitFor(() => expect(printer.now()).toBeCloseTo(0.2, 9), { timeout: 10_000 });
  await loop.stop();
});
