// The page before its planner is there, without it, and in a browser that cannot reach serial ports.
import type { Page } from '@playwright/test';
import { expect, test } from '../fixtures/files.ts';
import { travels } from '../fixtures/gcode.ts';
import { Panel, sample } from '../pages/panel.ts';

const MODULE = '**/*.wasm';

test('the shell answers before the planner has loaded', async ({ page, context }) => {
  let letGo = (): void => undefined;
  const held = new Promise<void>((resolve) => {
    letGo = resolve;
  });
  await context.route(MODULE, async (route) => {
    await held;
    await route.continue();
  });
  const panel = new Panel(page);
  await panel.open();
  const settings = await panel.openDialog('Settings');
  await settings.getByText('Dark', { exact: true }).click();
  await expect(page.locator('html')).toHaveAttribute('data-theme', 'dark');
  await panel.closeDialog(settings);

  const connect = await panel.openDialog('Connect');
  const go = connect.getByRole('button', { name: 'Connect', exact: true });
  await panel.chooseVirtual(connect, 'up to 200×');
  await expect(go).toBeDisabled();
  await expect(connect).toContainText('The planner is still loading.');
  await expect(panel.emergencyStop).toBeDisabled();

  letGo();
  await expect(go).toBeEnabled();
  await go.click();
  await expect(panel.status).toContainText('Ready');
});

test('a planner that cannot be loaded is said, with what to do', async ({ page, context }) => {
  await context.route(MODULE, (route) => route.fulfill({ status: 404, body: 'not here' }));
  const panel = new Panel(page);
  await panel.open();
  await expect(panel.alert).toContainText('The planner could not be loaded.');
  await expect(panel.alert).toContainText('Reload the page.');
  const connect = await panel.openDialog('Connect');
  await panel.chooseVirtual(connect, 'up to 200×');
  await expect(connect.getByRole('button', { name: 'Connect', exact: true })).toBeDisabled();
  await expect(connect).toContainText('The planner could not be loaded.');
});

test('a sample that cannot be loaded is said', async ({ panel, page, watch }) => {
  watch.expectError(/404/);
  await page.route('**/test-part-*.gcode', (route) => route.fulfill({ status: 404, body: '' }));
  await panel.preview.getByRole('button', { name: 'Open the sample' }).click();
  await expect(panel.alert).toContainText('The sample could not be loaded.');
});

/** As Firefox and Safari are. */
const withoutSerial = (page: Page): Promise<unknown> =>
  page.addInitScript(() => {
    Reflect.deleteProperty(Navigator.prototype, 'serial');
  });

test('without Web Serial: which browsers have it, and the virtual printer prints', async ({
  page,
  makeFile,
}) => {
  await withoutSerial(page);
  const panel = new Panel(page);
  await panel.open();
  expect(await page.evaluate(() => 'serial' in navigator)).toBe(false);
  const connect = await panel.openDialog('Connect');
  await expect(connect).toContainText('This browser cannot reach USB printers.');
  await expect(connect).toContainText('Chrome, Edge and Opera');
  await expect(connect.getByText('Printer on USB')).toHaveCount(0);
  await panel.closeDialog(connect);

  await panel.drop(sample('test-part-small.gcode'));
  await expect(panel.fact(panel.job, 'Layers')).toHaveText('22');
  await expect(panel.preview.getByRole('slider', { name: 'Top layer shown' })).toBeVisible();
  await panel.drop(makeFile('travels.gcode', travels(20).gcode));
  await panel.connectVirtual();
  await panel.startPrint();
  await expect(panel.job).toContainText('The print is done.', { timeout: 45_000 });
});
