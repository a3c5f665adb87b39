// Orbiting a large file while another is printed at the full rate of its moves: the board has as much motion queued as
// when nobody touches the view. Both are measured in the same print, in turns, so that neither has the better hour.
import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import type { Snapshot } from '../../web/src/machine/protocol.ts';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { motor, recordOf } from '../pages/record.ts';

/** Of the least motion queued while the view rests, at least this part is there while it turns. */
const SHARE_MIN = 0.9;
const LARGE_FILE_BYTES = 20e6;
const ROUNDS = 3;
/** Looks at the queue in a round, at rest and turning each. */
const LOOKS = 50;
const TURNS_MIN = 30;
/** Pieces of a circle of 20 mm: 0.126 mm each, 1200 a second. */
const PIECES = 1000;
const SPEED_MM_S = 150;
const CIRCLES = 200;

/** Circles of many short moves, without heat: what a slicer writes at its worst, for minutes. */
function circles(): string {
  const piece = (at: number): string => {
    const angle = (2 * Math.PI * at) / PIECES;
    return `G1 X${(150 + 20 * Math.cos(angle)).toFixed(3)} Y${(150 + 20 * Math.sin(angle)).toFixed(3)}`;
  };
  const circle = Array.from({ length: PIECES }, (_, at) => piece(at + 1)).join('\n');
  const start = `G28\nG90\nG1 X170 Y150 Z5 F${SPEED_MM_S * 60}\n`;
  return `${start}${`${circle}\n`.repeat(CIRCLES)}`;
}

interface Look {
  readonly queued: number;
  readonly job: Snapshot['job'];
}

/** Notes what the machine's worker tells the page of a print. */
function listen(page: Page): Promise<void> {
  return page.addInitScript(() => {
    const looks: Look[] = [];
    Object.assign(window, { looks });
    window.Worker = class extends Worker {
      constructor(url: string | URL, options?: WorkerOptions) {
        super(url, options);
        if (options?.name !== 'machine') return;
        this.addEventListener('message', ({ data }: MessageEvent) => {
          if (data?.kind !== 'snapshot') return;
          const { queued, job } = data.snapshot as Snapshot;
          if (queued !== null && job !== 'none') looks.push({ queued, job });
        });
      }
    };
  }) as Promise<unknown> as Promise<void>;
}

const looksOf = (page: Page): Promise<Look[]> =>
  page.evaluate(() => [...(window as unknown as { looks: Look[] }).looks]);

/** What is seen from now on, until there are so many looks. */
async function watch(page: Page): Promise<Look[]> {
  const from = (await looksOf(page)).length;
  let seen: Look[] = [];
  await expect
    .poll(
      async () => {
        seen = (await looksOf(page)).slice(from);
        return seen.length;
      },
      { timeout: 60_000 },
    )
    .toBeGreaterThanOrEqual(LOOKS);
  return seen;
}

const least = (looks: readonly Look[]): number => Math.min(...looks.map(({ queued }) => queued));

test('the board has as much motion queued while the view is turned as while it rests', async ({
  page,
  panel,
  makeFile,
}) => {
  test.setTimeout(240_000);
  const part = readFileSync(sample('test-part-small.gcode'), 'utf8');
  const large = makeFile('large.gcode', part.repeat(Math.ceil(LARGE_FILE_BYTES / part.length)));
  await listen(page);
  await panel.open();
  await panel.drop(makeFile('circles.gcode', circles()));
  await panel.connectVirtual('Real time');
  await panel.startPrint();
  await panel.look(large);
  const reading = panel.preview.getByRole('progressbar', { name: 'Reading the file' });
  await expect(reading).toHaveCount(0, { timeout: 90_000 });
  // Homing is over, and the board's queue is as full as it will be.
  await expect
    .poll(async () => least((await looksOf(page)).slice(-20)), { timeout: 90_000 })
    .toBeGreaterThan(1.5);

  const resting: Look[] = [];
  const turning: Look[] = [];
  let turns = 0;
  for (let round = 0; round < ROUNDS; round += 1) {
    resting.push(...(await watch(page)));
    let isOver = false;
    const turned = panel.turnWhile(() => !isOver);
    turning.push(...(await watch(page)));
    isOver = true;
    turns += await turned;
  }
  console.log(
    `queued at least ${least(resting).toFixed(2)} s at rest (${resting.length} looks), ` +
      `${least(turning).toFixed(2)} s while turned ${turns} times (${turning.length} looks)`,
  );
  expect(turns, 'times that the view was turned').toBeGreaterThan(TURNS_MIN);
  expect(least(turning)).toBeGreaterThanOrEqual(SHARE_MIN * least(resting));
  // It never ran dry and never held.
  expect(least(turning)).toBeGreaterThan(0);
  expect(new Set([...resting, ...turning].map(({ job }) => job))).toEqual(new Set(['printing']));
  await expect(panel.status).toContainText('Printing');
  const record = recordOf(await panel.report());
  expect(record.shutdown).toBeNull();
  expect(record.motors.map(({ lost_steps }) => lost_steps)).toEqual([0, 0, 0, 0]);
  expect(motor(record, 'stepper_x').pulses).toBeGreaterThan(10_000);
});
