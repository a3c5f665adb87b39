// What other tabs are told of a connection, and that their stop reaches it.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Broadcast, TELL_OTHERS_MS } from '../src/machine/broadcast';
import {
  CHANNEL,
  type FromDriver,
  type FromViewer,
  type MachineView,
} from '../src/machine/broadcast_protocol';
import type { PortChoice, Snapshot } from '../src/machine/protocol';
import { portTrouble, stopNotSent } from '../src/machine/troubles';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

const PORT: PortChoice = { kind: 'serial', id: { vendor: 1, product: 2, index: 0 }, baud: 250_000 };
const NOW: Snapshot = { ...new FakeSession().snapshot(), wakeUps: { missed: 0, latest: seconds(0) } };

/** Locks as the browser has them, one holder each. */
class FakeLocks {
  readonly held = new Set<string>();
  readonly request = async (name: string, body: () => Promise<void> | undefined): Promise<void> => {
    this.held.add(name);
    await body();
    this.held.delete(name);
  };
}

let locks: FakeLocks;
let viewer: BroadcastChannel;
let heard: FromDriver[];

beforeEach(() => {
  locks = new FakeLocks();
  vi.stubGlobal('navigator', { locks });
  heard = [];
  viewer = new BroadcastChannel(CHANNEL);
  viewer.onmessage = (event) => void heard.push((event as MessageEvent<FromDriver>).data);
});
afterEach(() => {
  viewer.close();
  vi.unstubAllGlobals();
});

const say = (message: FromViewer): void => viewer.postMessage(message);
const views = (): MachineView[] =>
  heard.flatMap((message) => (message.kind === 'view' ? [message.view] : []));

function made(
  look: () => Snapshot | null = () => NOW,
  stop = () => null as ReturnType<typeof stopNotSent> | null,
) {
  return new Broadcast({ id: 'one', name: 'Machine', port: PORT, look, stop });
}

test('tells at a bounded rate, and a newcomer at once', async () => {
  const broadcast = made();
  await vi.waitFor(() => expect(views()).toHaveLength(1));
  expect(views()[0]).toMatchObject({ id: 'one', name: 'Machine', print: null, outcome: null, trouble: null });
  await new Promise((resolve) => setTimeout(resolve, 4 * TELL_OTHERS_MS));
  const before = views().length;
  expect(before).toBeLessThanOrEqual(6);
  for (let times = 0; times < 100; times += 1) say({ kind: 'hello' });
  await vi.waitFor(() => expect(views().length).toBeGreaterThan(before));
  expect(views().length).toBeLessThanOrEqual(before + 2);
  broadcast.end(null);
});

test('the lock is held from before the first word to the last', async () => {
  const broadcast = made(() => {
    expect(locks.held).toContain('stepcast-live:one');
    return NOW;
  });
  await vi.waitFor(() => expect(views().length).toBeGreaterThan(0));
  const reason = portTrouble('gone');
  broadcast.end(reason);
  await vi.waitFor(() => expect(heard.at(-1)).toEqual({ kind: 'bye', id: 'one', trouble: reason }));
  expect(locks.held.size).toBe(0);
  // Nothing more comes of it.
  const count = heard.length;
  say({ kind: 'hello' });
  await new Promise((resolve) => setTimeout(resolve, 2 * TELL_OTHERS_MS));
  expect(heard).toHaveLength(count);
});

test('a stop reaches the machine that is meant, and its answer comes back', async () => {
  const stop = vi.fn(() => stopNotSent('failed'));
  const broadcast = made(() => NOW, stop);
  await vi.waitFor(() => expect(views().length).toBeGreaterThan(0));
  say({ kind: 'stop', id: 'another', request: 'a' });
  say({ kind: 'stop', id: 'one', request: 'b' });
  await vi.waitFor(() =>
    expect(heard).toContainEqual({ kind: 'stopped', request: 'b', trouble: stopNotSent('failed') }),
  );
  expect(stop).toHaveBeenCalledOnce();
  broadcast.end(null);
});

test('a print, its trouble and its end are told to those who come later', async () => {
  let now: Snapshot = { ...NOW, job: 'printing' };
  const broadcast = made(() => now);
  broadcast.begins({ name: 'part.gcode', time: seconds(100), lines: 10 });
  broadcast.note({ kind: 'events', events: [{ kind: 'held', trouble: portTrouble('held') }] });
  await vi.waitFor(() =>
    expect(views().at(-1)).toMatchObject({ print: { name: 'part.gcode' }, trouble: portTrouble('held') }),
  );
  broadcast.note({ kind: 'events', events: [{ kind: 'resumed' }] });
  now = NOW;
  await vi.waitFor(() => expect(views().at(-1)).toMatchObject({ trouble: null, outcome: 'stopped' }));
  now = { ...NOW, job: 'printing' };
  await vi.waitFor(() => expect(views().at(-1)?.outcome).toBeNull());
  broadcast.note({ kind: 'events', events: [{ kind: 'done' }] });
  now = NOW;
  await vi.waitFor(() => expect(views().at(-1)?.outcome).toBe('done'));
  broadcast.end(null);
});
