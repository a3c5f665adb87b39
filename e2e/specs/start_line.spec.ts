// A print that begins with a layer or a line: from the preview and by number, and after a loss of power, when the board has
// forgotten everything. Judged by the device's own record. Nothing moves before the user's word.
import type { Locator, Page } from '@playwright/test';
import { expectAt, resumed } from '../fixtures/resumed.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { tower } from '../serial/gcode.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const PORT = { vendor: 0x1d50, product: 0x614e, shared: true } as const;
const FAST = 50;
const PRINT_TIMEOUT_MS = 90_000;
const SAMPLE_S = 0.02;
const Z = 2;

type Given = Parameters<Parameters<typeof test>[2]>[0];

interface Under {
  readonly printer: PrinterDevice;
  readonly port: BridgePort;
  readonly panel: SerialPanel;
}

const pulses = (printer: PrinterDevice): number[] => printer.state().motors.map((motor) => motor.pulses);
const zOf = (printer: PrinterDevice): number => printer.state().motors[Z]?.position_mm ?? Number.NaN;
const dialog = (page: Page, name: string): Locator => page.getByRole('dialog', { name });
const resume = (panel: SerialPanel): Locator => panel.job.getByRole('button', { name: 'Resume' });

/** A board that has just been switched on, and a file. */
async function ready(
  { bridge, open }: Pick<Given, 'bridge' | 'open'>,
  gcode: string,
  faults = '',
  speed = FAST,
): Promise<Under> {
  const printer = new PrinterDevice({ sampleS: SAMPLE_S, faults });
  const port = bridge.add(printer, { ...PORT, speed });
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(gcode);
  await expect(panel.print).toBeEnabled();
  return { printer, port, panel };
}

/** The user takes the likeliest for true, or says where Z stands; then looks at the part, and lets it go on. */
async function goOn({ printer, panel }: Pick<Under, 'printer' | 'panel'>, z: number | null): Promise<number> {
  const { job } = panel;
  await expect(panel.status).toContainText('Paused');
  await expect(resume(panel)).toBeDisabled();
  await expect(job).toContainText('Say first where Z stands.');
  await expect(panel.motion.getByRole('button', { name: 'Home all axes' })).toBeDisabled();
  const still = pulses(printer);
  const field = job.getByRole('textbox', { name: 'Z stands at' });
  if (z !== null) await field.fill(z.toFixed(3));
  await job.getByRole('button', { name: 'Z stands there' }).click();
  await expect(job).toContainText('Taken to stand at');
  await expect(resume(panel)).toBeDisabled();
  await expect(job).toContainText('Look first whether the part is where it was.');
  await job.getByRole('checkbox', { name: /still sticks to the bed/ }).check();
  const since = printer.now();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(1);
  expect(pulses(printer), 'nothing moves before the user says so').toEqual(still);
  expect(printer.state().heaters.map((heater) => heater.duty)).toEqual([0, 0]);
  const pressed = printer.now();
  await resume(panel).click();
  await expect(panel.status).toContainText('Printing');
  await expect(job).not.toContainText('Where Z stands');
  return pressed;
}

async function done({ printer, panel }: Pick<Under, 'printer' | 'panel'>): Promise<void> {
  await expect(panel.job).toContainText('The print is done.', { timeout: PRINT_TIMEOUT_MS });
  await expect.poll(() => printer.state().motors.map((motor) => motor.lost_steps)).toEqual([0, 0, 0, 0]);
  expect(printer.state().shutdown).toBeNull();
}

test('from a layer of the preview: up, across, down, and every step of the plan from there', async ({
  bridge,
  open,
}) => {
  test.setTimeout(180_000);
  const part = tower(40);
  const { printer, panel } = await ready({ bridge, open }, part.gcode);
  // The board is not homed, and nothing has moved so far.
  expect(pulses(printer)).toEqual([0, 0, 0, 0]);
  const layer = 31;
  await panel.preview.getByRole('slider').fill(String(layer - 1));
  await panel.preview.getByRole('button', { name: 'Print from this layer…' }).click();
  const asking = dialog(panel.page, 'Print from a line');
  await expect(asking.getByRole('textbox', { name: /^Line/ })).toHaveValue(String(part.lineOf(layer)));
  await expect(asking.getByRole('textbox', { name: /^Layer/ })).toHaveValue(String(layer));
  await expect(asking.locator('[aria-current="true"]')).toContainText(';LAYER_CHANGE');
  await expect(panel.fact(asking, 'Height')).toHaveText('6.20 mm');
  await asking.getByRole('button', { name: /^Get ready at line/ }).click();
  await expect(asking).toHaveCount(0);
  const sinceS = await goOn({ printer, panel }, zOf(printer));
  await done({ printer, panel });
  const topMm = part.zOf(layer - 1);
  const { begin, offMm } = resumed(printer, part, { line: part.lineOf(layer), sinceS, topMm });
  expectAt(begin, [80, 80.5, topMm]);
  expect(offMm).toBeLessThan(0.1);
  measured(`what was laid is at most ${offMm.toFixed(3)} mm beside the file's path`);
});

test('a line that there is not is said, and nothing is begun', async ({ bridge, open }) => {
  const part = tower(5);
  const { printer, panel } = await ready({ bridge, open }, part.gcode);
  const last = part.gcode.split('\n').length - 1;
  await panel.job.getByRole('button', { name: 'Print from a line…' }).click();
  const asking = dialog(panel.page, 'Print from a line');
  const field = asking.getByRole('textbox', { name: /^Line/ });
  const begin = asking.getByRole('button', { name: /^Get ready at line/ });
  await expect(begin).toBeEnabled();
  for (const wrong of ['0', '1', String(last + 1), '1e3', 'ten', '-5']) {
    await field.fill(wrong);
    await field.press('Tab');
    await expect(field, wrong).toHaveAttribute('aria-invalid', 'true');
    await expect(asking).toContainText(`From 2 to ${last}`);
    await expect(begin).toBeDisabled();
  }
  await field.fill(String(part.lineOf(3) + 8));
  await field.press('Enter');
  await expect(asking.getByRole('textbox', { name: /^Layer/ })).toHaveValue('3');
  await expect(asking.locator('[aria-current="true"]')).toContainText('G1 X120 Y120');
  await expect(begin).toBeEnabled();
  await panel.page.keyboard.press('Escape');
  await expect(asking).toHaveCount(0);
  await expect(panel.status).toContainText('Ready');
  expect(pulses(printer)).toEqual([0, 0, 0, 0]);
});

test('by keyboard alone, and cancelled before it moves', async ({ bridge, open }) => {
  const part = tower(5);
  const { printer, panel } = await ready({ bridge, open }, part.gcode);
  const { page, job } = panel;
  await job.getByRole('button', { name: 'Print from a line…' }).focus();
  await page.keyboard.press('Enter');
  const asking = dialog(page, 'Print from a line');
  await expect(asking.getByRole('heading', { name: 'Print from a line' })).toBeFocused();
  await asking.getByRole('textbox', { name: /^Layer/ }).focus();
  await page.keyboard.type('4');
  await page.keyboard.press('Enter');
  await expect(asking.getByRole('textbox', { name: /^Line/ })).toHaveValue(String(part.lineOf(4)));
  await asking.getByRole('button', { name: /^Get ready at line/ }).focus();
  await page.keyboard.press('Enter');
  await expect(panel.status).toContainText('Paused');
  await job.getByRole('textbox', { name: 'Z stands at' }).focus();
  await page.keyboard.type('3');
  await page.keyboard.press('Enter');
  await job.getByRole('button', { name: 'Z stands there' }).focus();
  await page.keyboard.press('Enter');
  await expect(job).toContainText('Taken to stand at 3.00 mm');
  await job.getByRole('checkbox', { name: /still sticks to the bed/ }).focus();
  await page.keyboard.press('Space');
  await expect(resume(panel)).toBeEnabled();
  await job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
  expect(pulses(printer)).toEqual([0, 0, 0, 0]);
});
