// The graphics card gives up: the view draws everything anew by itself once there is a context again.
import type { Worker } from '@playwright/test';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { inView } from '../pages/viewer.ts';

/** Put before the workers' own scripts: keeps what takes a context away. */
const KEEP_CONTEXT = `{
  const { getContext } = OffscreenCanvas.prototype;
  OffscreenCanvas.prototype.getContext = function (...given) {
    const context = getContext.apply(this, given);
    if (given[0] === 'webgl2') self.contextKept = context.getExtension('WEBGL_lose_context');
    return context;
  };
}
`;

interface Kept {
  readonly contextKept?: { loseContext(): void; restoreContext(): void };
}

test('a view whose context was lost is as it was before', async ({ panel, page }) => {
  test.setTimeout(120_000);
  await page.route('**/assets/worker-*.js', async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, body: KEEP_CONTEXT + (await response.text()) });
  });
  await panel.open();
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  // From the vertices and from what the planner says of them, seen from elsewhere than at first.
  await viewer.colourBy.selectOption('speed');
  await viewer.view.focus();
  await page.keyboard.press('ArrowLeft');
  await page.keyboard.press('+');
  const before = await viewer.picture();

  const drawing = await workerOfView(page.workers());
  await drawing.evaluate(() => (self as Kept).contextKept?.loseContext());
  await expect(viewer.view).toHaveAttribute('aria-busy', 'true');
  await drawing.evaluate(() => (self as Kept).contextKept?.restoreContext());
  expect((await viewer.picture()).equals(before)).toBe(true);
  // It goes on as before.
  await viewer.view.focus();
  await page.keyboard.press('ArrowLeft');
  expect((await viewer.picture()).equals(before), 'turned').toBe(false);
});

async function workerOfView(workers: readonly Worker[]): Promise<Worker> {
  for (const one of workers) {
    if (await one.evaluate(() => (self as Kept).contextKept !== undefined)) return one;
  }
  throw new Error('no worker draws');
}
