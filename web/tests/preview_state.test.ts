// A preview worker that stops: said as what it is, replaced, and nobody waits for it in vain.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { ConfigReport, FromPreview, ToPreview } from '../src/preview/protocol';
import { summaryOf } from './fake_summary';
import { type FakeWorker, fakeWorkers } from './fake_worker';

type PreviewWorker = FakeWorker<FromPreview, ToPreview>;

let page: typeof import('../src/state/preview');
let workers: PreviewWorker[];

beforeEach(async () => {
  vi.resetModules();
  workers = fakeWorkers<FromPreview, ToPreview>();
  page = await import('../src/state/preview');
  page.startPreview();
});
afterEach(() => {
  vi.unstubAllGlobals();
});

const checks = (worker: PreviewWorker | undefined): number[] =>
  (worker?.sent ?? []).flatMap((message) => (message.kind === 'check-config' ? [message.id] : []));

test('it says that no print is touched, and the next file is read by a new one', () => {
  page.openFile(new Blob(['G28']), 'part.gcode');
  workers[0]?.fail('unreachable');
  expect([workers[0]?.isTerminated, page.reading.value]).toEqual([true, null]);
  expect(page.failure.value?.code).toBe('preview-died');
  expect(page.failure.value?.safe).toContain('a running print is not touched');
  page.openFile(new Blob(['G28']), 'other.gcode');
  expect(workers[1]?.sent.map(({ kind }) => kind)).toEqual(['draw', 'open']);
  expect([page.failure.value, page.reading.value]).toEqual([null, 0]);
});

test('a check that was under way is repeated once, and then given up with the reason', async () => {
  const report: ConfigReport = { remarks: [], machine: null };
  const first = page.checkConfig('[printer]');
  workers[0]?.fail('unreachable');
  const [id = 0] = checks(workers[1]);
  workers[1]?.say({ kind: 'config', id, report });
  expect(await first).toBe(report);

  const second = page.checkConfig('[poison]');
  workers[1]?.fail('unreachable');
  workers[2]?.fail('unreachable');
  expect((await second).remarks[0]?.text).toContain('has stopped');
  expect(checks(workers[3])).toEqual([]);
});

test('one that keeps stopping is given up, and says so to whoever asks', async () => {
  for (let times = 0; times < 10; times += 1) workers.at(-1)?.fail();
  expect(workers.length).toBeLessThan(6);
  page.openFile(new Blob(['G28']), 'part.gcode');
  expect([page.reading.value, page.failure.value?.code]).toEqual([null, 'preview-died']);
  expect(page.failure.value?.happened).not.toContain('undefined');
  expect((await page.checkConfig('')).machine).toBeNull();
});

test('what a print waits for is said, as far as the file has come', async () => {
  const { obstacle } = await import('../src/panel/obstacle');
  page.openFile(new Blob(['G28']), 'part.gcode');
  expect(obstacle.value).toBe('The file is still being read.');
  workers[0]?.say({ kind: 'outline', job: 1, outline: summaryOf() });
  expect(obstacle.value).toContain('the planner is still checking');
  workers[0]?.say({ kind: 'summary', job: 1, summary: summaryOf() });
  expect(obstacle.value).not.toContain('still');
});

test('the planner is let go once the outline is shown', async () => {
  page.openFile(new Blob(['G28']), 'part.gcode');
  workers[0]?.say({ kind: 'outline', job: 1, outline: summaryOf() });
  await vi.waitFor(() => expect(workers[0]?.sent.at(-1)).toEqual({ kind: 'plan', job: 1 }));
});
