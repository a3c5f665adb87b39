// Takes the pictures of the README: the virtual printer is connected, a sample is dropped and printed to its end.
// They are written to docs/pictures; whoever changes the page looks at them and commits them.
import { join } from 'node:path';
import type { Page } from '@playwright/test';
import { root } from '../../scripts/lib/target.mjs';
import { expect, test } from '../fixtures/test.ts';
import { type Panel, sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

const picture = (name: string): string => join(root, 'docs', 'pictures', `${name}.png`);

async function drawn(panel: Panel): Promise<void> {
  await expect(panel.preview.getByRole('progressbar')).toHaveCount(0);
  await new Viewer(panel.page).drawn();
}

async function take(page: Page, panel: Panel, name: string): Promise<void> {
  // Buttons that were clicked have scrolled a narrow page.
  await page.evaluate(() => window.scrollTo(0, 0));
  await drawn(panel);
  await page.screenshot({ path: picture(name) });
}

test.describe('wide, light', () => {
  test.use({ viewport: { width: 1280, height: 860 }, colorScheme: 'light' });

  test('a print from the first page to its end', async ({ page, panel }) => {
    const connect = await panel.openDialog('Connect');
    await panel.chooseVirtual(connect, 'up to 20×');
    await take(page, panel, 'connect');
    await connect.getByRole('button', { name: 'Connect', exact: true }).click();
    await expect(panel.status).toContainText('Ready');
    await panel.drop(sample('test-part.gcode'));
    await take(page, panel, 'preview');
    await panel.startPrint();
    await expect
      .poll(async () => Number.parseInt(await panel.fact(panel.job, 'Done').innerText(), 10), {
        timeout: 200_000,
      })
      .toBeGreaterThanOrEqual(40);
    await take(page, panel, 'printing');
    await expect(panel.job).toContainText('The print is done', { timeout: 200_000 });
    await take(page, panel, 'done');
  });
});

test.describe('narrow, dark', () => {
  test.use({ viewport: { width: 390, height: 844 }, colorScheme: 'dark' });

  test('a print on a narrow screen', async ({ page, panel }) => {
    await panel.connectVirtual('up to 20×');
    await panel.drop(sample('test-part.gcode'));
    await panel.startPrint();
    await expect
      .poll(async () => Number.parseInt(await panel.fact(panel.job, 'Done').innerText(), 10), {
        timeout: 200_000,
      })
      .toBeGreaterThanOrEqual(20);
    await take(page, panel, 'narrow');
  });
});
