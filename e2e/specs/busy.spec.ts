// A print in real time while a large file is read and the view is turned: the board never runs short of motion, and no
// task of the page holds the main thread for long. Both are measured and printed.
//
// A task is judged by the processor time that it took, not by the clock: on a busy machine a task of a millisecond may
// wait for its turn in the middle. The clock's figures are printed besides.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from '@playwright/test';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';

/** Motion that the board has at least, in s. */
const QUEUED_MIN_S = 1.5;
/** The longest task on the main thread, in ms. */
const TASK_MAX_MS = 50;
const LARGE_FILE_BYTES = 20e6;
/** Reading it takes seconds: several times, so that it coincides with all that a turning view does. */
const READ_TIMES = 3;
const TURNS_MIN = 10;

/** The sample's moves without heat and filament: real moves that begin at once. */
function cold(gcode: string): string {
  return gcode
    .split('\n')
    .filter((line) => !/^(M10[49]|M1[49]0|G1[01]\b)/.test(line))
    .map((line) => (line.startsWith('G1 ') ? line.replace(/ E-?[\d.]+/, '') : line))
    .join('\n');
}

interface Seen {
  /** The least motion queued since the board first had enough, in s. */
  queuedMin: number;
  snapshots: number;
}

/** Listens to what the machine's worker tells the page. */
function listen(page: Page): Promise<unknown> {
  return page.addInitScript(() => {
    const seen = { queuedMin: Number.POSITIVE_INFINITY, snapshots: 0 };
    Object.assign(window, { seen });
    const take = ({ data }: MessageEvent): void => {
      const queued: unknown = data?.kind === 'snapshot' ? data.snapshot.queued : null;
      if (typeof queued !== 'number') return;
      if (seen.snapshots === 0 && queued < 1.5) return;
      seen.snapshots += 1;
      seen.queuedMin = Math.min(seen.queuedMin, queued);
    };
    window.Worker = class extends Worker {
      constructor(url: string | URL, options?: WorkerOptions) {
        super(url, options);
        if (options?.name === 'machine') this.addEventListener('message', take);
      }
    };
  });
}

const seenBy = (page: Page): Promise<Seen> =>
  page.evaluate(() => ({ ...(window as unknown as { seen: Seen }).seen }));

interface Task {
  /** By the clock and by the processor, in ms. */
  readonly wall: number;
  readonly cpu: number;
}

interface TraceEvent {
  readonly name: string;
  readonly ph: string;
  readonly pid: number;
  readonly tid: number;
  readonly dur?: number;
  readonly tdur?: number;
  readonly args?: { readonly name?: string };
}

/** The tasks of the page's main thread while `act` runs, longest first. */
async function mainThreadTasks(browser: Browser, page: Page, act: () => Promise<void>): Promise<Task[]> {
  await browser.startTracing(page, { categories: ['disabled-by-default-devtools.timeline', '__metadata'] });
  await act();
  const trace = JSON.parse((await browser.stopTracing()).toString()) as { traceEvents: TraceEvent[] };
  const events = trace.traceEvents;
  const mains = new Set(
    events
      .filter(({ name, args }) => name === 'thread_name' && args?.name === 'CrRendererMain')
      .map(({ pid, tid }) => `${pid}/${tid}`),
  );
  return events
    .filter(({ name, ph, pid, tid }) => name === 'RunTask' && ph === 'X' && mains.has(`${pid}/${tid}`))
    .map(({ dur = 0, tdur = 0 }) => ({ wall: dur / 1000, cpu: tdur / 1000 }))
    .sort((a, b) => b.cpu - a.cpu);
}

test('a print in real time while a large file is read and the view is turned', async ({
  browser,
  page,
  panel,
  makeFile,
}) => {
  test.setTimeout(180_000);
  const part = readFileSync(sample('test-part-small.gcode'), 'utf8');
  const small = makeFile('cold.gcode', cold(part));
  const large = makeFile('large.gcode', part.repeat(Math.ceil(LARGE_FILE_BYTES / part.length)));
  await listen(page);
  await panel.open();
  await panel.drop(small);
  await panel.connectVirtual('Real time');
  await panel.startPrint();
  await expect.poll(async () => (await seenBy(page)).snapshots, { timeout: 90_000 }).toBeGreaterThan(20);

  const tasks = await mainThreadTasks(browser, page, async () => {
    const reading = panel.preview.getByRole('progressbar', { name: 'Reading the file' });
    let isOver = false;
    const turning = panel.turnWhile(() => !isOver);
    for (let times = 0; times < READ_TIMES; times += 1) {
      await panel.look(large);
      await expect(reading).toBeVisible();
      await expect(reading).toHaveCount(0, { timeout: 60_000 });
    }
    isOver = true;
    expect(await turning, 'times that the view was turned').toBeGreaterThan(TURNS_MIN);
  });
  await expect(panel.status).toContainText('Printing');
  const { queuedMin, snapshots } = await seenBy(page);
  const [longest] = tasks;
  const wall = Math.max(...tasks.map((task) => task.wall));
  console.log(
    `queued at least ${queuedMin.toFixed(2)} s (${snapshots} looks); longest task ${longest?.cpu.toFixed(1)} ms of processor, ` +
      `${wall.toFixed(1)} ms by the clock (${tasks.length} tasks)`,
  );
  expect(snapshots).toBeGreaterThan(50);
  expect(queuedMin).toBeGreaterThanOrEqual(QUEUED_MIN_S);
  expect(tasks.length).toBeGreaterThan(100);
  expect(longest?.cpu).toBeGreaterThan(0);
  expect(longest?.cpu).toBeLessThanOrEqual(TASK_MAX_MS);
});
