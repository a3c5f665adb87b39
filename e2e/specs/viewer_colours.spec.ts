// What the view is coloured by, what the colours mean, and which features are there at all.
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

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

test('features have their shares of time and filament, and can be taken away', async ({ panel, page }) => {
  const viewer = new Viewer(page);
  await panel.drop(sample('test-part.gcode'));
  await viewer.ready();
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

test('each mode has its colours, and those that are measured their limits', async ({ panel, page }) => {
  test.setTimeout(120_000);
  const viewer = new Viewer(page);
  await panel.drop(sample('test-part.gcode'));
  await viewer.ready();
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

test('the choice is kept for the next visit', async ({ panel, page }) => {
  const viewer = new Viewer(page);
  await panel.drop(sample('test-part-small.gcode'));
  await viewer.ready();
  await viewer.colourBy.selectOption('Line width');
  await page.reload();
  await panel.drop(sample('test-part-small.gcode'));
  await viewer.ready();
  await expect(viewer.colourBy).toHaveValue('width');
});
