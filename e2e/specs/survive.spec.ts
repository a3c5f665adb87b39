// A page that dies in the middle of a print, or loses its printer: the board holds the print, and another page, or the
// same one, goes on with the very next step, at the user's word. Judged by the device's own record.
import { writeFile } from 'node:fs/promises';
import type { Locator, Page } from '@playwright/test';
import { made, plannedBehind } from '../fixtures/pulses.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { climbing } from '../serial/gcode.ts';
import { sampleConfig } from '../serial/planner.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;
/** Without heat: this is about motion. */
const GCODE = climbing(60);
const PRINT_TIMEOUT_MS = 60_000;

type Given = Parameters<Parameters<typeof test>[2]>[0];

interface Under {
  readonly printer: PrinterDevice;
  readonly port: BridgePort;
  readonly panel: SerialPanel;
}

const pulses = (printer: PrinterDevice): number[] => printer.state().motors.map((motor) => motor.pulses);
const held = (page: Page): Locator => page.getByRole('dialog', { name: 'The board holds a print' });
const notices = (page: Page): Locator => page.getByRole('status', { name: 'Notices' });

/** A print in its middle, with its file copied. */
async function printing({ bridge, open }: Pick<Given, 'bridge' | 'open'>, gcode = GCODE): Promise<Under> {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(gcode);
  await panel.startPrint();
  // Behind homing and the wait after it, some layers up.
  await expect(panel.fact(panel.job, 'Height')).toHaveText(/^5\.[4-9]/, { timeout: PRINT_TIMEOUT_MS });
  await expect.poll(() => stored(panel.page)).toContain('complete');
  return { printer, port, panel };
}

/** What is stored of the one print there is. */
const stored = (page: Page): Promise<string[]> =>
  page.evaluate(async () => {
    const names: string[] = [];
    const prints = await (await navigator.storage.getDirectory()).getDirectoryHandle('prints');
    for await (const entry of prints.values())
      if (entry.kind === 'directory')
        for await (const name of (entry as FileSystemDirectoryHandle).keys()) names.push(name);
    return names;
  });

/** Takes something away of what is stored; null is all of it. */
const lose = (page: Page, name: string | null): Promise<void> =>
  page.evaluate(async (name) => {
    const root = await navigator.storage.getDirectory();
    if (name === null) return await root.removeEntry('prints', { recursive: true });
    const prints = await root.getDirectoryHandle('prints');
    for await (const entry of prints.values()) await (entry as FileSystemDirectoryHandle).removeEntry(name);
  }, name);

async function crash(page: Page): Promise<void> {
  const session = await page.context().newCDPSession(page);
  const crashed = page.waitForEvent('crash');
  void session.send('Page.crash').catch(() => undefined);
  await crashed;
}

/** The board has come to rest, and stays so. */
async function atRest(printer: PrinterDevice): Promise<void> {
  let [last, since] = [pulses(printer), printer.now()];
  await expect
    .poll(() => {
      const now = pulses(printer);
      if (now.some((count, motor) => count !== last[motor])) [last, since] = [now, printer.now()];
      return printer.now() - since;
    })
    .toBeGreaterThan(1);
  expect(printer.state().shutdown).toBeNull();
}

/** With another machine in use the page asks before it connects: the board would be restarted by that. */
async function declineOtherMachine(panel: SerialPanel): Promise<void> {
  const path = test.info().outputPath('other.cfg');
  await writeFile(path, `${sampleConfig()}\n# another one\n`);
  await panel.look(path);
  await panel.closeDialog(panel.dialog('Machine'));
  const dialog = await panel.chooseSerial();
  await dialog.getByRole('button', { name: 'Connect', exact: true }).click();
  await panel.answer('Connect with another machine file?', 'Do not connect');
  await expect(panel.status).toContainText('Not connected');
}

/** From what the page shows as held to the end of the print: every step of the plan, and none besides. */
async function goOn({ printer, panel }: Pick<Under, 'printer' | 'panel'>, gcode = GCODE): Promise<void> {
  const dialog = held(panel.page);
  await expect(dialog).toContainText('with no step lost');
  await expect(dialog).toContainText('part.gcode');
  await expect(panel.status).toContainText('Held');
  const still = pulses(printer);
  const since = printer.now();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(1);
  expect(pulses(printer), 'nothing goes on by itself').toEqual(still);
  const began = performance.now();
  await dialog.getByRole('button', { name: 'Resume' }).click();
  // What has cooled is heated first.
  await expect.poll(() => pulses(printer), { timeout: 60_000 }).not.toEqual(still);
  measured(`from Resume to the next step: ${((performance.now() - began) / 1000).toFixed(2)} s`);
  await expect(dialog).toHaveCount(0);
  await expect(panel.job).toContainText('The print is done.', { timeout: PRINT_TIMEOUT_MS });
  await expect.poll(() => made(printer)).toEqual(plannedBehind(gcode, 'G4'));
  const { motors, shutdown } = printer.state();
  expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  measured(`pulses as planned: ${made(printer).join(', ')}`);
  await expect.poll(() => stored(panel.page), 'what has ended is not kept').toEqual([]);
}

test('not interrupted: the steps that all the others are compared with', async ({ bridge, open }) => {
  const { printer, panel } = await printing({ bridge, open });
  await expect(panel.job).toContainText('The print is done.', { timeout: PRINT_TIMEOUT_MS });
  await expect.poll(() => made(printer)).toEqual(plannedBehind(GCODE, 'G4'));
  await expect.poll(() => stored(panel.page)).toEqual([]);
});

test('the renderer is killed: another page takes the print up and goes on', async ({
  bridge,
  open,
  watch,
}) => {
  test.setTimeout(180_000);
  watch.expectError(/the page crashed/);
  const { printer, panel } = await printing({ bridge, open });
  await crash(panel.page);
  await atRest(printer);
  const again = await open();
  await expect(notices(again.page)).toContainText('The print of part.gcode was interrupted');
  await declineOtherMachine(again);
  const began = performance.now();
  await notices(again.page).getByRole('button', { name: 'Connect' }).click();
  await again.connectIn(again.dialog('Connect'));
  await expect(held(again.page)).toContainText('with no step lost');
  measured(`from Connect to held: ${((performance.now() - began) / 1000).toFixed(2)} s`);
  await goOn({ printer, panel: again });
});

test('a hot print: the board lowers its heat while it is alone, and gets it back before the next step', async ({
  bridge,
  open,
  watch,
}) => {
  test.setTimeout(180_000);
  watch.expectError(/the page crashed/);
  const gcode = climbing(60, false);
  const { printer, panel } = await printing({ bridge, open }, gcode);
  await crash(panel.page);
  await atRest(printer);
  const nozzle = (): number => printer.state().heaters[0]?.temperature_c ?? Number.NaN;
  const before = nozzle();
  await expect.poll(nozzle, { timeout: 60_000 }).toBeLessThan(before - 20);
  const again = await open();
  await again.connectOffered();
  await expect(held(again.page)).toContainText('Nozzle');
  measured(`nozzle ${before.toFixed(0)} °C, when it is found ${nozzle().toFixed(0)} °C`);
  await goOn({ printer, panel: again }, gcode);
});

test('paused, then the renderer is killed: another page takes it up as paused, and resumes it', async ({
  bridge,
  open,
  watch,
}) => {
  test.setTimeout(180_000);
  watch.expectError(/the page crashed/);
  const { printer, panel } = await printing({ bridge, open });
  await panel.job.getByRole('button', { name: 'Pause' }).click();
  await expect(panel.status).toContainText('Paused');
  await crash(panel.page);
  await atRest(printer);
  const again = await open();
  await notices(again.page).getByRole('button', { name: 'Connect' }).click();
  await again.connectIn(again.dialog('Connect'));
  const dialog = again.page.getByRole('dialog', { name: 'A paused print' });
  await expect(dialog).toContainText('the head is parked, or where it was moved to');
  await expect(dialog).not.toContainText('rests on its path');
  await expect(again.status).toContainText('Paused');
  await expect(dialog.getByRole('button', { name: 'Cancel' })).toBeEnabled();
  // Put away, it is a paused print like any other: the head can be moved.
  await again.page.keyboard.press('Escape');
  await expect(notices(again.page)).toContainText('A paused print.');
  const still = pulses(printer);
  await again.motion.getByRole('button', { name: 'Up 10 mm' }).click();
  await expect.poll(() => pulses(printer)).not.toEqual(still);
  await atRest(printer);
  await notices(again.page).getByRole('button', { name: 'Show' }).click();
  await dialog.getByRole('button', { name: 'Resume' }).click();
  await expect(dialog).toHaveCount(0);
  await expect(again.job).toContainText('The print is done.', { timeout: PRINT_TIMEOUT_MS });
  const { motors, shutdown } = printer.state();
  expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  await expect(notices(again.page)).not.toContainText('A paused print');
  await expect.poll(() => stored(again.page), 'what has ended is not kept').toEqual([]);
});

test('a reload in the middle of the print: the same page takes it up again', async ({ bridge, open }) => {
  test.setTimeout(180_000);
  const { printer, panel } = await printing({ bridge, open });
  panel.page.on('dialog', (dialog) => void dialog.accept());
  const began = performance.now();
  await panel.page.reload();
  await expect(notices(panel.page)).toContainText('The print of part.gcode was interrupted');
  await panel.connectOffered();
  await expect(held(panel.page)).toContainText('with no step lost');
  measured(`from the reload to held: ${((performance.now() - began) / 1000).toFixed(2)} s`);
  await goOn({ printer, panel });
});

test('the cable comes out and goes in again', async ({ bridge, open }) => {
  test.setTimeout(180_000);
  const { printer, port, panel } = await printing({ bridge, open });
  bridge.unplug(port);
  await expect(panel.status).toContainText('Not connected');
  await atRest(printer);
  bridge.replug(port);
  const began = performance.now();
  await panel.alert.getByRole('button', { name: 'Reconnect' }).click();
  await expect(held(panel.page)).toContainText('with no step lost');
  measured(`from Reconnect to held: ${((performance.now() - began) / 1000).toFixed(2)} s`);
  await goOn({ printer, panel });
});

test('without a copy of the file the user is asked for it, and another one is refused', async ({
  bridge,
  open,
  watch,
}) => {
  test.setTimeout(180_000);
  watch.expectError(/the page crashed/);
  const { printer, panel } = await printing({ bridge, open });
  await crash(panel.page);
  const again = await open();
  await lose(again.page, 'complete');
  await again.connectOffered();
  const dialog = held(again.page);
  await expect(dialog).toContainText('there is no whole copy of its file');
  const give = async (text: string, button: string): Promise<void> => {
    const asking = again.page.waitForEvent('filechooser');
    await dialog.getByRole('button', { name: button }).click();
    const buffer = Buffer.from(text);
    await (await asking).setFiles({ name: 'part.gcode', mimeType: 'text/x.gcode', buffer });
  };
  await give(`${GCODE}; sliced again\n`, 'Open the file');
  await expect(dialog).toContainText('part.gcode had another size or other content');
  const still = pulses(printer);
  await give(GCODE.replaceAll('X150 Y150', 'X150 Y151'), 'Open the file');
  await expect(dialog).toContainText('cannot be taken up with its next step');
  expect(pulses(printer)).toEqual(still);
  await give(GCODE, 'Try with its file');
  await goOn({ printer, panel: again });
});

test('a print that nothing is known of: only a restart is offered', async ({ bridge, open, watch }) => {
  test.setTimeout(120_000);
  watch.expectError(/the page crashed/);
  const { printer, panel } = await printing({ bridge, open });
  await crash(panel.page);
  const again = await open();
  await lose(again.page, null);
  await again.page.reload();
  await expect(notices(again.page)).not.toContainText('interrupted');
  await again.connectOffered();
  const dialog = held(again.page);
  await expect(dialog).toContainText('this browser does not know');
  await expect(again.status).toContainText('Holding a print');
  await expect(dialog.getByRole('button', { name: /Resume|Cancel|file/ })).toHaveCount(0);
  const still = pulses(printer);
  const since = printer.now();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(5);
  expect(pulses(printer), 'nothing happens by itself').toEqual(still);
  await dialog.getByRole('button', { name: 'Restart the board' }).click();
  await again.answer('Restart the board?', 'Restart the board');
  await expect(again.status).toContainText('Ready');
  await expect(dialog).toHaveCount(0);
});
