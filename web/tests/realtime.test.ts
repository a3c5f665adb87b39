// The loop around a real port tells what was thrown, wherever that was: nothing may go on by halves.
import { expect, test, vi } from 'vitest';
import { Machine } from '../src/machine/machine';
import type { FromMachine } from '../src/machine/protocol';
import { RealTimeLoop } from '../src/machine/realtime';
import type { Transport } from '../src/transport/transport';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

function made(now = () => seconds(performance.now() / 1000)) {
  const session = new FakeSession();
  const told: FromMachine[] = [];
  let arrive: (bytes: Uint8Array<ArrayBuffer>) => void = () => undefined;
  const written: number[] = [];
  const transport: Transport = {
    readable: new ReadableStream({
      start(controller) {
        arrive = (bytes) => controller.enqueue(bytes);
      },
    }),
    writable: new WritableStream({ write: (bytes: Uint8Array) => void written.push(...bytes) }),
    lost: new Promise(() => undefined),
    lineErrors: () => NO_LINE_ERRORS,
    close: () => Promise.resolve(),
  };
  const machine = new Machine(
    session,
    (message) => void told.push(message),
    () => NO_LINE_ERRORS,
  );
  const loop = new RealTimeLoop(transport, { machine, now, onBytes: () => undefined });
  return { session, loop, written, told, arrive: (bytes: Uint8Array<ArrayBuffer>) => arrive(bytes) };
}

test('bytes go both ways', async () => {
  const { session, loop, written, arrive } = made();
  const onFailure = vi.fn();
  session.toSend = [1, 2];
  loop.start(onFailure);
  arrive(Uint8Array.of(3, 4));
  await vi.waitFor(() =>
    expect([written, session.received]).toEqual([
      [1, 2],
      [3, 4],
    ]),
  );
  await loop.stop();
  expect(onFailure).not.toHaveBeenCalled();
});

test('what the session throws when bytes arrive is told', async () => {
  const { session, loop, arrive } = made();
  const onFailure = vi.fn();
  session.period = 1000;
  loop.start(onFailure);
  expect(onFailure).not.toHaveBeenCalled();
  vi.spyOn(session, 'receive').mockImplementation(() => {
    throw new Error('unreachable');
  });
  arrive(Uint8Array.of(3));
  await vi.waitFor(() => expect(onFailure).toHaveBeenCalledWith(new Error('unreachable')));
  await loop.stop();
});

test('what the session throws when its time comes is told', async () => {
  const { session, loop } = made();
  const onFailure = vi.fn();
  loop.start(onFailure);
  session.panic = new Error('unreachable');
  await vi.waitFor(() => expect(onFailure).toHaveBeenCalledWith(session.panic));
  await loop.stop();
});

test('a stall above a second is told with its length, even where bytes are first after it', async () => {
  let clock = 100;
  const { session, loop, told, arrive } = made(() => seconds(clock));
  session.period = 0.5;
  loop.start(() => undefined);
  clock += 0.5 + 3;
  arrive(Uint8Array.of(1));
  await vi.waitFor(() => expect(told).toEqual([{ kind: 'gap', seconds: 3 }]));
  // The next turn is in time.
  clock += 0.6;
  arrive(Uint8Array.of(2));
  await vi.waitFor(() => expect(session.received).toEqual([1, 2]));
  expect(told).toHaveLength(1);
  await loop.stop();
});
