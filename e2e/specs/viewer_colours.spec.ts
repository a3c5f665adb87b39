// What the view is coloured by, what the colours mean, and which features are there at all.
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

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
