// Session and virtual printer share one clock, which runs no faster than asked and waits for whoever is behind.
import { expect, test } from 'vitest';
import { LockstepLoop } from '../src/machine/lockstep';
import { Machine } from '../src/machine/machine';
import { seconds } from '../src/units';
import { EchoPrinter, FakeSession } from './fake_session';

const realNow = () => seconds(performance.now() / 1000);
const after = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

async function runFor(
  ms: number,
  speed: number,
): Promise<{ session: FakeSession; printer: EchoPrinter; virtual: number; real: number }> {
  const session = new FakeSession();
  session.toSend = [1, 2, 3];
  const printer = new EchoPrinter();
  const loop = new LockstepLoop(
    new Machine(
      session,
      () => undefined,
      () => 0,
    ),
    printer,
    speed,
    realNow,
  );
  const began = realNow();
  loop.start((error) => {
    throw error;
  });
  await after(ms);
  const virtual = printer.now();
  const real = realNow() - began;
  await loop.stop();
  return { session, printer, virtual, real };
}

test.each([1, 50])('at %d times real time, time passes about as fast and never faster', async (speed) => {
  const { virtual, real } = await runFor(300, speed);
  expect(virtual).toBeLessThanOrEqual(real * speed);
  expect(virtual).toBeGreaterThan(real * speed * 0.5);
});

test('bytes go to the printer and back, and the printer is let go at the end', async () => {
  const { session, printer } = await runFor(60, 10);
  expect(printer.written).toEqual([1, 2, 3]);
  expect(session.received).toEqual([1, 2, 3]);
  expect(printer.freed).toBe(true);
});

test('while the worker is held up no time passes for the two', async () => {
  const session = new FakeSession();
  const printer = new EchoPrinter();
  const loop = new LockstepLoop(
    new Machine(
      session,
      () => undefined,
      () => 0,
    ),
    printer,
    1,
    realNow,
  );
  loop.start(() => undefined);
  await after(30);
  const before = printer.now();
  const until = performance.now() + 800;
  while (performance.now() < until);
  await after(10);
  const passed = printer.now() - before;
  await loop.stop();
  expect(passed).toBeLessThan(0.4);
});
