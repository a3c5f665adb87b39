// A connection has one end, which lets go of everything whatever went wrong, and tells a page no more than it takes.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Connection, type Parts, TELL_MS } from '../src/machine/connection';
import { LockstepLoop } from '../src/machine/lockstep';
import { Machine } from '../src/machine/machine';
import { type FromMachine, WHOLE } from '../src/machine/protocol';
import { portTrouble } from '../src/machine/troubles';
import { NO_LINE_ERRORS, PortError } from '../src/transport/transport';
import { seconds } from '../src/units';
import { EchoPrinter, FakeSession } from './fake_session';

beforeEach(() => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'clearTimeout', 'setInterval', 'clearInterval'] });
});
afterEach(() => {
  vi.useRealTimers();
});

function made(parts: Partial<Parts> = {}) {
  const told: FromMachine[] = [];
  const session = new FakeSession();
  const stop = vi.fn(() => Promise.resolve());
  const machine = new Machine(
    session,
    (message) => void told.push(message),
    () => NO_LINE_ERRORS,
  );
  const connection = new Connection(
    {
      machine,
      now: () => seconds(0),
      tick: () => undefined,
      setSpeed: () => undefined,
      record: null,
      lost: null,
      start: () => undefined,
      stop,
      ...parts,
    },
    (message) => void told.push(message),
  );
  const snapshots = (): number => told.filter(({ kind }) => kind === 'snapshot').length;
  return { connection, session, machine, stop, told, snapshots };
}

test('a planner that panics while the page is told ends the connection: port closed, planner freed', async () => {
  const { connection, session, stop } = made();
  const ended = connection.run();
  session.panic = new Error('unreachable');
  const rejected = expect(ended).rejects.toThrow('unreachable');
  await vi.advanceTimersByTimeAsync(TELL_MS);
  await rejected;
  expect([stop.mock.calls.length, session.freed, connection.isOver]).toEqual([1, true, true]);
  // No timer is left that would throw again.
  expect(vi.getTimerCount()).toBe(0);
});

const boom = (): never => {
  throw new Error('boom');
};

test('what the start throws ends it too', async () => {
  const { connection, stop } = made({ start: boom });
  await expect(connection.run()).rejects.toThrow('boom');
  expect(stop).toHaveBeenCalledOnce();
});

test('what a wish throws ends it too', async () => {
  const { connection, stop } = made();
  const rejected = expect(connection.run()).rejects.toThrow('boom');
  connection.attempt(boom);
  await rejected;
  expect(stop).toHaveBeenCalledOnce();
});

test('a port that cannot be closed in order does not keep the planner', async () => {
  const { connection, session } = made({ stop: () => Promise.reject(new Error('stuck')) });
  const rejected = expect(connection.run()).rejects.toThrow('stuck');
  connection.end(null);
  await rejected;
  expect(session.freed).toBe(true);
});

test('a port that is gone is why it ended, and the last word is told', async () => {
  const { connection, session, told, stop } = made({
    lost: Promise.resolve(portTrouble(new PortError('unplugged'))),
  });
  session.events.push({ kind: 'message', text: 'the last' });
  expect((await connection.run())?.code).toBe('unplugged');
  expect(told.map(({ kind }) => kind)).toEqual(['opened', 'events', 'snapshot']);
  expect(stop).toHaveBeenCalledOnce();
});

test('a page that is busy gets one snapshot, and what happened meanwhile with the next', async () => {
  const { connection, session, told, snapshots } = made();
  const ended = connection.run();
  for (let turn = 0; turn < 100; turn += 1) {
    session.events.push({ kind: 'message', text: `${turn}` });
    await vi.advanceTimersByTimeAsync(TELL_MS);
  }
  expect(snapshots()).toBe(1);
  connection.seen();
  await vi.advanceTimersByTimeAsync(3 * TELL_MS);
  expect(snapshots()).toBe(2);
  const events = told.flatMap((message) => (message.kind === 'events' ? message.events : []));
  expect(events).toHaveLength(100);
  connection.end(null);
  expect(await ended).toBeNull();
});

test('a file that hangs while it is read does not hold up the end', async () => {
  const session = new FakeSession();
  const machine = new Machine(
    session,
    () => undefined,
    () => NO_LINE_ERRORS,
  );
  const file = new Blob(['G28\n']);
  let reads = 0;
  file.stream = () =>
    new ReadableStream(
      {
        pull(controller) {
          reads += 1;
          // Enough to begin with; then the disk does not answer.
          if (reads > 4) return new Promise(() => undefined);
          controller.enqueue(new Uint8Array(10));
          return undefined;
        },
      },
      { highWaterMark: 0 },
    );
  session.job = 'printing';
  expect(await machine.print(file, WHOLE, () => seconds(0))).toBeNull();
  const printer = new EchoPrinter();
  const loop = new LockstepLoop(machine, printer, 1, () => seconds(0));
  const { connection } = made({
    machine,
    start: (onFailure) => loop.start(onFailure),
    stop: () => loop.stop(),
  });
  session.wants = 1000;
  const ended = connection.run();
  await vi.waitFor(() => expect(machine.isBehind).toBe(true));
  connection.end(null);
  expect(await ended).toBeNull();
  expect([printer.freed, session.freed]).toEqual([true, true]);
});
