// What the page says of prints that were interrupted, and what it offers: nothing of it connects by itself.
import { beforeEach, expect, test, vi } from 'vitest';
import type { FromMachine, KeptPrint, PortChoice, Snapshot, ToMachine } from '../src/machine/protocol';
import { seconds, share } from '../src/units';
import { FakeSession } from './fake_session';
import { type FakeWorker, fakeWorkers } from './fake_worker';

const PORT = { vendor: 1, product: 2, index: 0 };
const SERIAL: PortChoice = { kind: 'serial', id: PORT, baud: 250_000 };
const NOW: Snapshot = { ...new FakeSession().snapshot(), wakeUps: { missed: 0, latest: seconds(0) } };

let page: typeof import('../src/state/machine');
let kept: typeof import('../src/state/kept');
let interrupted: typeof import('../src/state/interrupted');
let notices: typeof import('../src/state/notices');
let profiles: typeof import('../src/state/profiles');
let workers: FakeWorker<FromMachine, ToMachine>[];
let asked: KeptPrint[];

beforeEach(async () => {
  vi.resetModules();
  vi.stubGlobal('localStorage', { getItem: () => null, setItem: () => undefined });
  workers = fakeWorkers<FromMachine, ToMachine>();
  page = await import('../src/state/machine');
  kept = await import('../src/state/kept');
  interrupted = await import('../src/state/interrupted');
  notices = await import('../src/state/notices');
  profiles = await import('../src/state/profiles');
  page.startMachine();
  asked = [];
  interrupted.followInterrupted((print) => void asked.push(print));
});

const worker = (): FakeWorker<FromMachine, ToMachine> => {
  const [only] = workers;
  if (!only) throw new Error('no worker');
  return only;
};
const shown = () => notices.notices.value.filter(({ kind }) => kind.startsWith('interrupted:'));
const print = (config: string, line = 7): KeptPrint => ({
  id: `print-${config.length}-${line}`,
  facts: { name: 'part.gcode', time: seconds(60), lines: 100 },
  machine: { name: 'Mill', config },
  port: PORT,
  line,
  startLine: null,
  elapsed: seconds(9),
  confirmedLines: [],
  heardOf: 0,
  fileBytes: 12,
});
const OTHER = '[printer]\nof: another\n';

test('it is said, offered, and forgotten at the user\u2019s word', () => {
  const one = print(profiles.SHIPPED.config);
  worker().say({ kind: 'kept', prints: [one] });
  const [notice] = shown();
  expect(notice?.text).toContain('part.gcode was interrupted');
  expect(notice?.text).toContain('after line 7');
  notice?.action?.act();
  expect(asked).toEqual([one]);
  notice?.other?.act();
  expect(worker().sent).toEqual([{ kind: 'forget', id: one.id }]);
  worker().say({ kind: 'kept', prints: [] });
  expect(shown()).toEqual([]);
});

test('while a printer is connected nothing is offered; a board that holds nothing is told of', () => {
  worker().say({ kind: 'loaded' });
  worker().say({ kind: 'kept', prints: [print(profiles.SHIPPED.config), print(OTHER)] });
  expect(shown()).toHaveLength(2);
  page.connect(SERIAL, profiles.SHIPPED);
  expect(shown()).toEqual([]);
  worker().say({ kind: 'opened' });
  worker().say({ kind: 'snapshot', snapshot: { ...NOW, phase: 'holding' } });
  worker().say({ kind: 'held-print', held: { kind: 'looking' } });
  expect(shown()).toEqual([]);
  worker().say({ kind: 'held-print', held: null });
  worker().say({ kind: 'snapshot', snapshot: NOW });
  expect(shown().map(({ text }) => text)).toEqual([
    expect.stringContaining('This printer does not hold it. If another one does, connect that.'),
  ]);
  expect(shown()[0]?.action?.text).toBe('Continue from a line…');
  // Nothing is offered beside a print that runs.
  worker().say({ kind: 'snapshot', snapshot: { ...NOW, job: 'printing' } });
  expect(shown()).toEqual([]);
  worker().say({ kind: 'snapshot', snapshot: NOW });
  expect(shown()).toHaveLength(1);
  worker().say({ kind: 'closed', trouble: null });
  expect(shown()).toHaveLength(2);
});

test('another machine file would end what the board holds', () => {
  worker().say({ kind: 'kept', prints: [print(OTHER)] });
  expect(interrupted.endedBy(PORT, profiles.SHIPPED.config)).toHaveLength(1);
  expect(interrupted.endedBy(PORT, OTHER)).toEqual([]);
  expect(interrupted.endedBy({ ...PORT, product: 9 }, profiles.SHIPPED.config)).toEqual([]);
});

test('the machine of the print is put to use, as it was then', async () => {
  await interrupted.useMachineOf(print(profiles.SHIPPED.config));
  expect(profiles.activeProfile.value).toEqual(profiles.SHIPPED);
  await interrupted.useMachineOf(print(OTHER));
  expect(profiles.activeProfile.value).toMatchObject({ name: 'Mill (as printed)', config: OTHER });
  await interrupted.useMachineOf(print(OTHER));
  expect(profiles.profiles.value).toHaveLength(2);
});

test('what is held is of the connection alone', () => {
  worker().say({ kind: 'loaded' });
  page.connect(SERIAL, profiles.SHIPPED);
  worker().say({ kind: 'opened' });
  worker().say({ kind: 'held-print', held: { kind: 'finding', print: print(OTHER), share: share(0.5) } });
  expect(kept.heldPrint.value?.kind).toBe('finding');
  worker().say({ kind: 'closed', trouble: null });
  expect(kept.heldPrint.value).toBeNull();
  worker().say({ kind: 'held-print', held: { kind: 'looking' } });
  expect(kept.heldPrint.value).toBeNull();
});

test('what cannot be kept is said once, plainly', () => {
  const trouble = {
    code: 'storage-full',
    line: null,
    happened: 'There is no room.',
    safe: 'It prints.',
    todo: 'Free space.',
  };
  worker().say({ kind: 'not-kept', trouble });
  expect(notices.notices.value.map(({ text }) => text)).toEqual(['There is no room. It prints. Free space.']);
});
