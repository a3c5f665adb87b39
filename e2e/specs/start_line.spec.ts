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
/** Homed anew, the axes are a step or two beside where they were. */
const OFF_MM = 0.05;

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

/** Where Z stands, said by the user, who knows it. */
const typeZ = ({ printer, panel }: Pick<Under, 'printer' | 'panel'>): Promise<void> =>
  panel.job.getByRole('textbox', { name: 'Z stands at' }).fill(zOf(printer).toFixed(3));

/** Only with current does Z stand where it can be measured: taken for the likeliest, lifted, measured, corrected. */
async function measureZ({ printer, panel }: Pick<Under, 'printer' | 'panel'>): Promise<void> {
  const { job, motion } = panel;
  const places = job.getByRole('group', { name: 'Places where Z can stand' }).locator('label');
  await expect(job).toContainText('If board and motors lost their power together');
  await expect(job).toContainText('a sheet of paper just slides');
  // What the motor says is never claimed by the confirmation alone.
  await expect(job.getByRole('button', { name: 'Z stands there' })).toBeDisabled();
  await places.first().click();
  const from = zOf(printer);
  await job.getByRole('button', { name: 'Z stands there' }).click();
  await motion.getByRole('button', { name: 'Up 10 mm' }).click();
  await expect.poll(() => zOf(printer)).toBeGreaterThan(from + 9);
  await expect.poll(() => isStill(printer)).toBe(true);
  const taken = await panel.position('Z');
  measured(`Z stands at ${zOf(printer).toFixed(3)} mm, taken for ${taken.toFixed(2)} mm`);
  // As exactly as a ruler and a sheet of paper; the motor knows better.
  await job.getByRole('textbox', { name: 'Z stands at' }).fill((zOf(printer) + 0.04).toFixed(2));
  const take = job.getByRole('button', { name: /^Take / });
  await expect(take).toBeVisible();
  await take.click();
  await job.getByRole('button', { name: 'Correct Z' }).click();
  await expect.poll(() => panel.position('Z').then((z) => Math.abs(z - zOf(printer)))).toBeLessThan(OFF_MM);
}

async function isStill(printer: PrinterDevice): Promise<boolean> {
  const [before, since] = [pulses(printer), printer.now()];
  await expect.poll(() => printer.now() - since).toBeGreaterThan(0.5);
  return pulses(printer).every((count, motor) => count === before[motor]);
}

/** The user says where Z stands, looks at the part, and lets it go on. */
async function goOn(
  { printer, panel }: Pick<Under, 'printer' | 'panel'>,
  say: (under: Pick<Under, 'printer' | 'panel'>) => Promise<void>,
): Promise<number> {
  const { job } = panel;
  await expect(panel.status).toContainText('Paused');
  await expect(resume(panel)).toBeDisabled();
  await expect(job).toContainText('Say first where Z stands.');
  await expect(panel.motion.getByRole('button', { name: 'Home all axes' })).toBeDisabled();
  await say({ printer, panel });
  await expect(job).toContainText('Taken to stand at');
  const still = pulses(printer);
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
  const top = panel.preview.getByRole('slider', { name: 'Top layer shown' });
  for (let shown = 40; shown > layer; shown -= 1) await top.press('ArrowDown');
  await panel.preview.getByRole('button', { name: 'Print from this layer…' }).click();
  const asking = dialog(panel.page, 'Print from a line');
  await expect(asking.getByRole('textbox', { name: /^Line/ })).toHaveValue(String(part.lineOf(layer)));
  await expect(asking.getByRole('textbox', { name: /^Layer/ })).toHaveValue(String(layer));
  await expect(asking.locator('[aria-current="true"]')).toContainText(';LAYER_CHANGE');
  await expect(panel.fact(asking, 'Height')).toHaveText('6.20 mm');
  await asking.getByRole('button', { name: /^Get ready at line/ }).click();
  await expect(asking).toHaveCount(0);
  const sinceS = await goOn({ printer, panel }, async (under) => {
    const there = panel.job.getByRole('button', { name: 'Z stands there' });
    await expect(there).toBeDisabled();
    await typeZ(under);
    await there.click();
    expect(pulses(printer)).toEqual([0, 0, 0, 0]);
  });
  await done({ printer, panel });
  const topMm = part.zOf(layer - 1);
  const { begin, offMm, laid } = resumed(printer, part, { line: part.lineOf(layer), sinceS, topMm });
  expectAt(begin, [80, 80.5, topMm]);
  // Ten layers of three seconds, looked at every 20 ms.
  expect(laid.length).toBeGreaterThan(800);
  expect(
    Math.abs((laid[0]?.mm[Z] ?? 0) - part.zOf(layer)),
    'the first is at the height of its layer',
  ).toBeLessThan(OFF_MM);
  expect(offMm).toBeLessThan(OFF_MM);
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
  await expect(job).toContainText('the nozzle is heated to 200 °C, the bed to 60 °C, and it goes across');
  await job.getByRole('textbox', { name: 'Z stands at' }).focus();
  await page.keyboard.type('3');
  await page.keyboard.press('Enter');
  await job.getByRole('button', { name: 'Z stands there' }).focus();
  await page.keyboard.press('Enter');
  await expect(job).toContainText('Taken to stand at 3.00 mm. Check it with a sheet of paper');
  await job.getByRole('checkbox', { name: /still sticks to the bed/ }).focus();
  await page.keyboard.press('Space');
  await expect(resume(panel)).toBeEnabled();
  await job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
  expect(pulses(printer)).toEqual([0, 0, 0, 0]);
});

/** The power goes at this second of the device, for so long; by then the print is in its middle. */
const LOSS = { at: 220, lasts: 5 } as const;
const LOSS_LAYERS = 66;

const stored = (page: Page): Promise<string[]> =>
  page.evaluate(async () => {
    const names: string[] = [];
    const prints = await (await navigator.storage.getDirectory()).getDirectoryHandle('prints');
    for await (const entry of prints.values())
      if (entry.kind === 'directory')
        for await (const name of (entry as FileSystemDirectoryHandle).keys()) names.push(name);
    return names;
  });
const notices = (page: Page): Locator => page.getByRole('status', { name: 'Notices' });

/** A print in whose middle the power goes. It comes back, and the printer has forgotten everything. */
async function powerLost({ bridge, open }: Pick<Given, 'bridge' | 'open'>, gcode: string): Promise<Under> {
  // Set up in real time, so that the power does not go before.
  const under = await ready({ bridge, open }, gcode, `power-loss=${LOSS.lasts}@${LOSS.at}`, 1);
  const { printer, port, panel } = under;
  await panel.startPrint();
  expect(printer.now()).toBeLessThan(LOSS.at - 160);
  port.setSpeed(FAST);
  await expect.poll(() => stored(panel.page)).toContain('complete');
  await expect.poll(() => printer.now(), { timeout: PRINT_TIMEOUT_MS }).toBeGreaterThan(LOSS.at + LOSS.lasts);
  return under;
}

/** From the notice to the end of the print. */
async function carryOn(
  under: Pick<Under, 'printer' | 'panel'>,
  part: ReturnType<typeof tower>,
): Promise<void> {
  const { printer, panel } = under;
  const { page } = panel;
  const still = pulses(printer);
  await expect(notices(page)).toContainText('The print of part.gcode was interrupted');
  await expect(notices(page)).toContainText('This printer does not hold it. If another one does');
  await notices(page).getByRole('button', { name: 'Continue from a line…' }).click();
  const asking = dialog(page, 'Continue an interrupted print');
  const field = asking.getByRole('textbox', { name: /^Line/ });
  await expect(field).toBeVisible();
  const line = Number(await field.inputValue());
  const layer = Number(await asking.getByRole('textbox', { name: /^Layer/ }).inputValue());
  expect(line).toBeGreaterThan(part.lineOf(3));
  expect(line).toBeLessThan(part.lineOf(LOSS_LAYERS - 5));
  await expect(asking).toContainText('It may have got as far as line');
  await asking.getByRole('button', { name: /^Get ready at line/ }).click();
  await expect(asking).toHaveCount(0);
  await expect(panel.status).toContainText('Paused');
  await expect(panel.job).toContainText(/Z was (at|between)/);
  const places = panel.job.getByRole('group', { name: 'Places where Z can stand' });
  const size = page.viewportSize();
  await page.setViewportSize({ width: 320, height: 720 });
  expect(await places.evaluate((box) => box.scrollWidth <= box.clientWidth), 'all can be reached').toBe(true);
  if (size) await page.setViewportSize(size);
  expect(pulses(printer), 'nothing has moved so far').toEqual(still);
  const sinceS = await goOn({ printer, panel }, measureZ);
  await done({ printer, panel });
  const { begin, offMm, laid } = resumed(printer, part, { line, sinceS, topMm: part.zOf(layer - 1) });
  expect(Math.abs((begin.mm[Z] ?? 0) - part.zOf(layer))).toBeLessThan(0.2 + OFF_MM);
  expect(laid.length).toBeGreaterThan(200);
  expect(offMm).toBeLessThan(OFF_MM);
  measured(`from line ${line}, layer ${layer}: at most ${offMm.toFixed(3)} mm beside the file's path`);
  await expect.poll(() => stored(page), 'what has ended is not kept, nor what it went on with').toEqual([]);
}

test('the power goes: the same page goes on from a line', async ({ bridge, open }) => {
  test.setTimeout(240_000);
  const part = tower(LOSS_LAYERS);
  const { printer, panel } = await powerLost({ bridge, open }, part.gcode);
  await expect(panel.status).not.toContainText('Printing');
  await expect(panel.alert).toContainText(
    /The board restarted by itself|The connection to the printer broke/,
  );
  await panel.disconnect();
  await panel.connectOffered();
  await expect(panel.status).toContainText('Ready');
  await carryOn({ printer, panel }, part);
});

test('the power goes, and the page too: another page goes on from a line', async ({
  bridge,
  open,
  watch,
}) => {
  test.setTimeout(240_000);
  watch.expectError(/the page crashed/);
  const part = tower(LOSS_LAYERS);
  const { printer, panel } = await powerLost({ bridge, open }, part.gcode);
  const session = await panel.page.context().newCDPSession(panel.page);
  const crashed = panel.page.waitForEvent('crash');
  void session.send('Page.crash').catch(() => undefined);
  await crashed;
  const again = await open();
  await expect(notices(again.page)).toContainText('The print of part.gcode was interrupted');
  await notices(again.page).getByRole('button', { name: 'Connect' }).click();
  await again.connectIn(again.dialog('Connect'));
  await expect(again.status).toContainText('Ready');
  await carryOn({ printer, panel: again }, part);
});
