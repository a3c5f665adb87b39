// Machines of other tabs: seen, old, gone in order and without a word; and only a tab without a machine is a viewer.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import {
  CHANNEL,
  type FromDriver,
  type FromViewer,
  type MachineView,
} from '../src/machine/broadcast_protocol';
import type { FromMachine, PortChoice, Snapshot, ToMachine } from '../src/machine/protocol';
import { portTrouble, stopNotSent } from '../src/machine/troubles';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';
import { fakeWorkers } from './fake_worker';

const PORT: PortChoice = { kind: 'serial', id: { vendor: 1, product: 2, index: 0 }, baud: 250_000 };
const NOW: Snapshot = { ...new FakeSession().snapshot(), wakeUps: { missed: 0, latest: seconds(0) } };
const view = (id: string, job: Snapshot['job'] = 'none'): MachineView => ({
  id,
  name: `Machine ${id}`,
  port: PORT,
  snapshot: { ...NOW, job },
  print: null,
  outcome: null,
  trouble: null,
});

/** The channel as the page has it, and what it said there. */
class FakeChannel {
  static last: FakeChannel;
  readonly said: FromViewer[] = [];
  onmessage: ((event: { data: FromDriver }) => void) | null = null;
  readonly name: string;
  constructor(name: string) {
    this.name = name;
    FakeChannel.last = this;
  }
  postMessage(message: FromViewer): void {
    this.said.push(message);
  }
}

/** Locks that other tabs hold until a test frees them. */
class FakeLocks {
  readonly waiting = new Map<string, () => void>();
  readonly request = (name: string, { signal }: { signal: AbortSignal }, body: () => void): Promise<void> =>
    new Promise((resolve, reject) => {
      this.waiting.set(name, () => resolve(body()));
      signal.addEventListener('abort', () => {
        this.waiting.delete(name);
        reject(signal.reason);
      });
    });
  free(id: string): void {
    this.waiting.get(`stepcast-live:${id}`)?.();
  }
}

let page: typeof import('../src/state/machine');
let watched: typeof import('../src/state/watched');
let locks: FakeLocks;
const say = (message: FromDriver): void => FakeChannel.last.onmessage?.({ data: message });
const shown = (): string[] =>
  watched.watched.value.map(({ view: { id }, isStale }) => (isStale ? `${id} old` : id));

beforeEach(async () => {
  vi.useFakeTimers();
  vi.resetModules();
  fakeWorkers<FromMachine, ToMachine>();
  locks = new FakeLocks();
  vi.stubGlobal('navigator', { locks });
  vi.stubGlobal('BroadcastChannel', FakeChannel);
  page = await import('../src/state/machine');
  watched = await import('../src/state/watched');
  page.startMachine();
  watched.startWatching();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('whoever begins to watch asks how things are', () => {
  expect([FakeChannel.last.name, FakeChannel.last.said]).toEqual([CHANNEL, [{ kind: 'hello' }]]);
});

test('a machine is shown while there is news of it, then as old', () => {
  say({ kind: 'view', view: view('a') });
  vi.advanceTimersByTime(1500);
  say({ kind: 'view', view: view('a', 'printing') });
  vi.advanceTimersByTime(1500);
  expect(shown()).toEqual(['a']);
  vi.advanceTimersByTime(1000);
  expect(shown()).toEqual(['a old']);
  say({ kind: 'view', view: view('a') });
  expect(shown()).toEqual(['a']);
});

test('a tab that is gone without a word is told, one that says good-bye is not', () => {
  say({ kind: 'view', view: view('a', 'printing') });
  say({ kind: 'view', view: view('b') });
  say({ kind: 'bye', id: 'b', trouble: null });
  expect([shown(), page.trouble.value, locks.waiting.size]).toEqual([['a'], null, 1]);
  locks.free('a');
  vi.advanceTimersByTime(300);
  expect(shown()).toEqual([]);
  expect(page.trouble.value?.happened).toBe('The tab that drove Machine a is gone in the middle of a print.');
  expect(page.connection.value).toBe('closed');
});

test('a good-bye may come after the lock', () => {
  say({ kind: 'view', view: view('a') });
  locks.free('a');
  vi.advanceTimersByTime(100);
  say({ kind: 'bye', id: 'a', trouble: null });
  vi.advanceTimersByTime(1000);
  expect([shown(), page.trouble.value]).toEqual([[], null]);
});

test('a connection that broke over there is told with its reason', () => {
  say({ kind: 'view', view: view('a', 'printing') });
  say({ kind: 'bye', id: 'a', trouble: portTrouble('gone') });
  expect(page.trouble.value).toEqual(portTrouble('gone'));
});

test('a tab with a machine of its own is no viewer, and is told nothing of others', () => {
  say({ kind: 'view', view: view('a', 'printing') });
  page.connect(PORT, { name: 'Own', config: '' });
  expect(shown()).toEqual([]);
  // Its own worker is heard on the channel, too.
  say({ kind: 'view', view: view(page.connectionId.value) });
  locks.free('a');
  vi.advanceTimersByTime(300);
  expect([shown(), page.trouble.value]).toEqual([[], null]);
});

test('in doubt everything stops; a stop that is not answered is told', () => {
  say({ kind: 'view', view: view('a') });
  say({ kind: 'view', view: view('b') });
  watched.stopAllWatched();
  const stops = FakeChannel.last.said.flatMap((message) => (message.kind === 'stop' ? [message] : []));
  expect(stops.map(({ id }) => id)).toEqual(['a', 'b']);
  say({ kind: 'stopped', request: stops[0]?.request ?? '', trouble: null });
  vi.advanceTimersByTime(900);
  expect(page.trouble.value).toBeNull();
  vi.advanceTimersByTime(200);
  expect(page.trouble.value).toEqual(stopNotSent('no-answer'));
});

test('no more machines than a computer has', () => {
  for (let at = 0; at < 100; at += 1) say({ kind: 'view', view: view(`m${at}`) });
  expect(watched.watched.value.length).toBeLessThanOrEqual(8);
  expect(locks.waiting.size).toBeLessThanOrEqual(8);
});
