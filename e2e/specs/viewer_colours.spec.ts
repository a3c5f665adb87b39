// What the view is coloured by, what the colours mean, and which features are there at all.
import { readFileSync } from 'node:fs';
import { expect, test } from '../fixtures/files.ts';
import { BEFORE_BEADS } from '../fixtures/gcode.ts';
import { sample } from '../pages/panel.ts';
import { inView, Viewer } from '../pages/viewer.ts';

const MODES = [
  'Layer height',
  'Line width',
  'Speed in the file',
  'Actual speed',
  'Acceleration',
  'Flow in the file',
  'Actual flow',
  'Layer time',
] as const;

/** The planner is at work on it for a while. */
const LARGE_BYTES = 12e6;

test('features have their shares of time and filament, and can be taken away', async ({ panel, page }) => {
  const viewer = await inView(panel, sample('test-part.gcode'));
  const row = viewer.legend.getByRole('row').filter({ hasText: 'Outer wall' });
  await expect(row.getByRole('cell')).toHaveText([/^\d+:\d\d$/, /^\d+ %$/, /^\d\.\d\d m$/]);
  const times = await viewer.legend.getByRole('row').getByRole('cell').nth(1).allInnerTexts();
  expect(times.length).toBeGreaterThan(0);
  const all = await viewer.picture();
  await viewer.checkbox('Outer wall').uncheck();
  const without = await viewer.picture();
  expect(without.equals(all)).toBe(false);
  await viewer.checkbox('Outer wall').focus();
  await page.keyboard.press('Space');
  await expect(viewer.checkbox('Outer wall')).toBeChecked();
  expect((await viewer.picture()).equals(without)).toBe(false);
});

test('each mode has its colours, and those that are measured their limits', async ({ panel }) => {
  test.setTimeout(120_000);
  const viewer = await inView(panel, sample('test-part.gcode'));
  const least = viewer.legend.getByRole('textbox', { name: /^Least/ });
  const greatest = viewer.legend.getByRole('textbox', { name: /^Greatest/ });
  const seen = [await viewer.picture()];
  for (const mode of MODES) {
    await viewer.colourBy.selectOption(mode);
    await expect(greatest).toBeVisible();
    const [low, high] = [Number(await least.inputValue()), Number(await greatest.inputValue())];
    expect(low, mode).toBeGreaterThanOrEqual(0);
    expect(high, mode).toBeGreaterThanOrEqual(low);
    const picture = await viewer.picture();
    for (const other of seen) expect(picture.equals(other), `${mode} looks like another mode`).toBe(false);
    seen.push(picture);
  }

  // The machine is slower than the file asks for somewhere, never faster.
  await viewer.colourBy.selectOption('Speed in the file');
  const asked = Number(await greatest.inputValue());
  await viewer.colourBy.selectOption('Actual speed');
  expect(Number(await greatest.inputValue())).toBeLessThanOrEqual(asked);

  // One's own limits, and back to those of the file.
  const automatic = await viewer.picture();
  await greatest.fill('20');
  await greatest.press('Enter');
  expect((await viewer.picture()).equals(automatic)).toBe(false);
  await viewer.button('Limits of the file').click();
  expect((await viewer.picture()).equals(automatic)).toBe(true);
});

test('temperature, fan and tools have the colours of what the file sets', async ({
  panel,
  page,
  makeFile,
}) => {
  test.setTimeout(120_000);
  const viewer = new Viewer(page);
  await panel.look(makeFile('two-tools.gcode', TWO_TOOLS));
  await viewer.ready();
  const limits = (): Promise<string[]> =>
    Promise.all(
      [/^Least/, /^Greatest/].map((name) => viewer.legend.getByRole('textbox', { name }).inputValue()),
    );
  const seen = [await viewer.picture()];
  const expectNew = async (mode: string): Promise<void> => {
    const picture = await viewer.picture();
    for (const other of seen) expect(picture.equals(other), mode).toBe(false);
    seen.push(picture);
  };
  await viewer.colourBy.selectOption('Nozzle temperature');
  await expect.poll(limits).toEqual(['200', '230']);
  await expectNew('temperature');
  await viewer.colourBy.selectOption('Fan');
  await expect.poll(limits).toEqual(['0', '100']);
  await expectNew('fan');

  // Those that lay filament, and no others.
  await viewer.colourBy.selectOption('Tool');
  const tools = viewer.legend.getByRole('list', { name: 'Tools' }).getByRole('listitem');
  await expect(tools).toHaveText([/^T0\s*0\.02 m$/, /^T2\s*0\.01 m$/]);
  await expectNew('tool');
});

test('what the planner has not worked out yet is said to be computing', async ({ panel, makeFile }) => {
  test.setTimeout(120_000);
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  await viewer.colourBy.selectOption('Acceleration');
  const part = readFileSync(sample('test-part-small.gcode'), 'utf8');
  await panel.look(makeFile('large.gcode', part.repeat(Math.ceil(LARGE_BYTES / part.length))));
  const said = viewer.legend.getByRole('status');
  await expect(said).toHaveText('Computing …');
  await expect(said).toHaveText('', { timeout: 90_000 });
  await expect(viewer.legend.getByRole('textbox', { name: /^Greatest/ })).not.toHaveValue('0');
});

test('the scale has the colours that the view has in its theme', async ({ panel, page }) => {
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  await viewer.colourBy.selectOption('Line width');
  const bar = viewer.legend.locator('.scale-bar');
  const ramp = (): Promise<string> => bar.evaluate((one) => getComputedStyle(one).backgroundImage);
  // The darkest of viridis, which a dark background would hide.
  expect(await ramp()).toContain('rgb(68, 1, 84)');
  await page.emulateMedia({ colorScheme: 'dark' });
  await expect.poll(ramp).not.toContain('rgb(68, 1, 84)');
  expect(await ramp()).toContain('rgb(253, 231, 37)');
});

test('the choice is kept for the next visit', async ({ panel, page }) => {
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  await viewer.colourBy.selectOption('Line width');
  await page.reload();
  await panel.drop(sample('test-part-small.gcode'));
  await viewer.ready();
  await expect(viewer.colourBy).toHaveValue('width');
});

/** Three beads: hotter from the second on, with the fan and another tool from the third on. */
const TWO_TOOLS = `${BEFORE_BEADS}G1 X110 Y90 E10 F1200
M104 S230
G1 X110 Y110 E20
M106 S255
T2
G1 X90 Y110 E30
M107
M104 S0
`;
