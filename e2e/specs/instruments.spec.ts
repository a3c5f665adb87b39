// The instruments: loaded when they are opened and not before, drawn from what the printer does, and said in words too.
import type { Page } from '@playwright/test';
import { expect, test } from '../fixtures/test.ts';
import { sample } from '../pages/panel.ts';

/** The graphs' files that the page has asked for. */
function asked(page: Page): string[] {
  const files: string[] = [];
  page.context().on('request', (request) => {
    const { pathname } = new URL(request.url());
    if (pathname.includes('/instruments/')) files.push(pathname);
  });
  return files;
}

test('graphs and their values while a print heats and moves', async ({ page, panel }) => {
  test.setTimeout(120_000);
  const files = asked(page);
  await panel.open();
  await panel.drop(sample('test-part-small.gcode'));
  await panel.connectVirtual('up to 20×');
  expect(files, 'what a first visit loads of them').toEqual([]);

  const instruments = page.getByRole('region', { name: 'Instruments' });
  await instruments.getByRole('button', { name: 'Show the instruments' }).click();
  const graphs = instruments.getByRole('img', { name: /Graphs of the temperatures/ });
  await expect(graphs.locator('xpath=..')).toHaveAttribute('data-state', 'ready', { timeout: 60_000 });
  expect(files.some((file) => file.endsWith('.wasm'))).toBe(true);
  const atRest = await graphs.screenshot();

  await panel.startPrint();
  const value = (name: string) => panel.fact(instruments, name);
  const highest = instruments
    .getByRole('row', { name: /^Nozzle/ })
    .getByRole('cell')
    .last();
  await expect.poll(async () => Number(await highest.innerText()), { timeout: 60_000 }).toBeGreaterThan(150);
  await expect(value('Toolhead now')).toHaveText(/^[1-9]\d* mm\/s$/, { timeout: 60_000 });
  await expect(value('Fastest in the queue')).toHaveText(/^[1-9]\d* mm\/s$/);
  await expect(value('Queued')).toHaveText(/^\d+\.\d s$/);
  await expect
    .poll(async () => (await graphs.screenshot()).equals(atRest), { message: 'the picture has not changed' })
    .toBe(false);

  await instruments.getByRole('button', { name: 'Hide the instruments' }).click();
  await expect(graphs).toHaveCount(0);
});

test('without the graphs the values are there, and trying again finds them', async ({ page, panel }) => {
  await page.context().route('**/instruments/*.js', (route) => route.fulfill({ status: 404, body: '' }));
  await panel.open();
  await panel.connectVirtual('up to 20×');
  const instruments = page.getByRole('region', { name: 'Instruments' });
  await instruments.getByRole('button', { name: 'Show the instruments' }).click();
  await expect(instruments.getByRole('status')).toContainText('The graphs are still being built');
  await expect(instruments.getByRole('row', { name: /^Bed/ })).toContainText(/\d\.\d/);
  await page.context().unroute('**/instruments/*.js');
  await instruments.getByRole('button', { name: 'Try again' }).click();
  await expect(instruments.locator('[data-state]')).toHaveAttribute('data-state', 'ready', {
    timeout: 60_000,
  });
});
