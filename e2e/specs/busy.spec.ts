// A print in real time while a large file is read and the view is turned: the board never runs short of motion, and no
// task of the page holds the main thread for long, as in every spec (fixtures/test.ts). Both are measured and printed.
import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';

/** Motion that the board has at least, in s. */
const QUEUED_MIN_S = 1.5;
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

test('a print in real time while a large file is read and the view is turned', async ({
  page,
  panel,
  makeFile,
  mainThread,
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
  await expect(panel.status).toContainText('Printing');
  const { queuedMin, snapshots } = await seenBy(page);
  const seen = await mainThread.end();
  const wall = Math.max(...(seen?.tasks ?? []).map((task) => task.wall));
  console.log(
    `queued at least ${queuedMin.toFixed(2)} s (${snapshots} looks); longest task ${wall.toFixed(1)} ms by the clock`,
  );
  expect(snapshots).toBeGreaterThan(50);
  expect(queuedMin).toBeGreaterThanOrEqual(QUEUED_MIN_S);
  expect(seen?.isWhole).toBe(true);
  expect(seen?.tasks.length, 'tasks of more than some ms').toBeGreaterThan(10);
});
