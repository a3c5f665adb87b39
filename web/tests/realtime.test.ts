// The loop around a real port tells what was thrown, wherever that was: nothing may go on by halves.
import { expect, test, vi } from 'vitest';
import { Machine } from '../src/machine/machine';
import { RealTimeLoop } from '../src/machine/realtime';
import type { Transport } from '../src/transport/transport';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

function made() {
  const session = new FakeSession();
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
    lineErrors: () => 0,
    close: () => Promise.resolve(),
  };
  const machine = new Machine(
    session,
    () => undefined,
    () => 0,
  );
  const now = () => seconds(performance.now() / 1000);
  const loop = new RealTimeLoop(transport, { machine, now, onBytes: () => undefined });
  return { session, loop, written, arrive: (bytes: Uint8Array<ArrayBuffer>) => arrive(bytes) };
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
