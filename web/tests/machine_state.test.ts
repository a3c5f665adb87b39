// What the page makes of what the machine worker says, and of a worker that says nothing more.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import {
  type FromMachine,
  type PortChoice,
  type Snapshot,
  type ToMachine,
  WHOLE,
} from '../src/machine/protocol';
import { portTrouble, stopNotSent } from '../src/machine/troubles';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';
import { type FakeWorker, fakeWorkers } from './fake_worker';

type MachineWorker = FakeWorker<FromMachine, ToMachine>;

const SERIAL: PortChoice = { kind: 'serial', id: { vendor: 1, product: 2, index: 0 }, baud: 250_000 };
const MACHINE = { name: 'Test machine', config: '' };
const FACTS = { name: 'part.gcode', time: seconds(60), lines: 100 };
const NOW: Snapshot = { ...new FakeSession().snapshot(), wakeUps: { missed: 0, latest: seconds(0) } };

let page: typeof import('../src/state/machine');
let workers: MachineWorker[];

beforeEach(async () => {
  vi.useFakeTimers();
  vi.resetModules();
  workers = fakeWorkers<FromMachine, ToMachine>();
  page = await import('../src/state/machine');
  page.startMachine();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function last(): MachineWorker {
  const worker = workers.at(-1);
  if (!worker) throw new Error('no worker');
  return worker;
}

function connected(snapshot: Snapshot = NOW): MachineWorker {
  const worker = last();
  worker.say({ kind: 'loaded' });
  page.connect(SERIAL, MACHINE);
  worker.say({ kind: 'opened' });
  worker.say({ kind: 'snapshot', snapshot });
  return worker;
}

const stops = (worker: MachineWorker): number[] =>
  worker.sent.flatMap((message) =>
    message.kind === 'wish' && message.wish.kind === 'emergency-stop' ? [message.id] : [],
  );

test.each<[string, (worker: MachineWorker) => void]>([
  ['throws', (worker) => worker.fail('unreachable')],
  ['says that it has died', (worker) => worker.say({ kind: 'died', message: 'unreachable' })],
])('a worker that %s is ended and replaced, and one can connect again', async (_, die) => {
  const first = connected({ ...NOW, job: 'printing' });
  die(first);
  expect(first.isTerminated).toBe(true);
  expect([page.connection.value, page.outcome.value, page.snapshot.value]).toEqual([
    'closed',
    'stopped',
    null,
  ]);
  expect(page.trouble.value?.code).toBe('worker-died');
  expect(page.trouble.value?.safe).toContain('on its own');
  expect(workers).toHaveLength(2);
  // What was still on its way from the one that is gone is of no interest.
  first.say({ kind: 'opened' });
  expect(page.connection.value).toBe('closed');
  const second = connected();
  expect(second.sent.map(({ kind }) => kind)).toEqual(['connect', 'seen']);
  expect(page.isReady.value).toBe(true);
});

test('a worker that keeps stopping is given up', () => {
  for (let times = 0; times < 10; times += 1) {
    last().say({ kind: 'loaded' });
    last().fail('again');
  }
  expect(workers.length).toBeLessThan(6);
  expect(page.plannerFailed.value).toBe(true);
});

test('a script that cannot be loaded: the planner is missing, and no printer is spoken of', () => {
  last().fail();
  expect(page.plannerFailed.value).toBe(true);
  expect(page.trouble.value?.code).toBe('planner-missing');
  expect(page.trouble.value?.happened).not.toContain('undefined');
  expect(workers).toHaveLength(1);
});

test('an emergency stop that is refused is shown, with what to do', async () => {
  const worker = last();
  worker.say({ kind: 'loaded' });
  page.connect(SERIAL, MACHINE);
  const stopped = page.emergencyStop();
  const [id = 0] = stops(worker);
  expect(id).toBeGreaterThan(0);
  worker.say({ kind: 'answer', id, trouble: stopNotSent('not-open') });
  await stopped;
  expect(page.trouble.value?.code).toBe('stop-not-sent');
  expect(page.trouble.value?.todo).toContain('cut its power');
  worker.say({ kind: 'closed', trouble: null });
  expect(page.trouble.value?.code).toBe('stop-not-sent');
});

test('an emergency stop that is not answered is shown', async () => {
  const worker = connected();
  void page.emergencyStop();
  await vi.advanceTimersByTimeAsync(900);
  expect(page.trouble.value).toBeNull();
  await vi.advanceTimersByTimeAsync(200);
  expect(page.trouble.value?.code).toBe('stop-not-sent');
  expect(stops(worker)).toHaveLength(1);
});

test('an emergency stop whose worker dies is shown rather than the death', async () => {
  const worker = connected();
  const stopped = page.emergencyStop();
  worker.fail('unreachable');
  await stopped;
  expect(page.trouble.value?.code).toBe('stop-not-sent');
});

test('an emergency stop that is carried out needs no word of its own', async () => {
  const worker = connected();
  const stopped = page.emergencyStop();
  worker.say({ kind: 'answer', id: stops(worker)[0] ?? 0, trouble: null });
  await stopped;
  await vi.advanceTimersByTimeAsync(5000);
  expect(page.trouble.value).toBeNull();
});

test('each snapshot is acknowledged', () => {
  const worker = connected();
  for (let times = 0; times < 5; times += 1) worker.say({ kind: 'snapshot', snapshot: NOW });
  expect(worker.sent.filter(({ kind }) => kind === 'seen')).toHaveLength(6);
});

test('values without news are old after two seconds, until news come', async () => {
  const worker = connected();
  for (let times = 0; times < 5; times += 1) {
    await vi.advanceTimersByTimeAsync(1900);
    expect(page.isStale.value).toBe(false);
    worker.say({ kind: 'snapshot', snapshot: NOW });
  }
  await vi.advanceTimersByTimeAsync(2100);
  expect(page.isStale.value).toBe(true);
  worker.say({ kind: 'snapshot', snapshot: NOW });
  expect(page.isStale.value).toBe(false);
  worker.say({ kind: 'closed', trouble: null });
  await vi.advanceTimersByTimeAsync(5000);
  expect(page.isStale.value).toBe(false);
});

test('disconnecting from a worker that hangs ends it', async () => {
  const worker = connected();
  await vi.advanceTimersByTimeAsync(2100);
  page.disconnect();
  expect([worker.isTerminated, page.connection.value, workers.length]).toEqual([true, 'closed', 2]);
});

test('a print that ends in an error has stopped, though the board is ready', () => {
  const worker = connected({ ...NOW, job: 'printing' });
  worker.say({ kind: 'events', events: [{ kind: 'trouble', trouble: portTrouble('line 7') }] });
  expect(page.outcome.value).toBeNull();
  worker.say({ kind: 'snapshot', snapshot: NOW });
  expect(page.outcome.value).toBe('stopped');
});

test('a print that ends in an error before the first snapshot has stopped, too', async () => {
  const worker = connected();
  const begun = page.print(new Blob(), FACTS, WHOLE);
  const asked = worker.sent.find((message) => message.kind === 'print');
  if (asked?.kind !== 'print') throw new Error('no print was asked for');
  worker.say({ kind: 'answer', id: asked.id, trouble: null });
  expect(await begun).toBe(true);
  worker.say({ kind: 'snapshot', snapshot: NOW });
  expect(page.outcome.value).toBe('stopped');
});

test('a print that is done is done', () => {
  const worker = connected({ ...NOW, job: 'printing' });
  worker.say({ kind: 'events', events: [{ kind: 'done' }] });
  worker.say({ kind: 'snapshot', snapshot: NOW });
  expect(page.outcome.value).toBe('done');
});
