// A segment and its line of the file find each other, in files of any size.
import { readFileSync } from 'node:fs';
import { gzipSync } from 'node:zlib';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { inView, Viewer } from '../pages/viewer.ts';

/** So many lines that their rows are taller than any element of a browser. */
const LONG_LINES = 2_200_000;

const numberIn = (text: string): number => Number(/Line ([\d,]+)/.exec(text)?.[1]?.replaceAll(',', ''));

test('a click finds the segment, its facts and its line; the text goes there', async ({ panel, page }) => {
  const path = sample('test-part.gcode');
  const lines = readFileSync(path, 'utf8').split('\n');
  const viewer = await inView(panel, path);
  await viewer.openText();
  await viewer.button('Top').click();
  const without = await viewer.picture();
  const { x, y } = await viewer.middle();
  await page.mouse.click(x, y);
  await expect(viewer.segment).toBeVisible();
  const line = numberIn(await viewer.segment.innerText());
  expect(line).toBeGreaterThan(1000);
  const text = lines[line - 1] ?? '';
  expect(text).toMatch(/^G[123] /);
  await expect(viewer.segment).toContainText(text);
  await expect(viewer.line(line)).toContainText(text);
  await expect(viewer.line(line)).toHaveAttribute('aria-selected', 'true');
  await expect(viewer.fact('Actual speed')).toHaveText(/^\d+ \(up to \d+\) mm\/s$/);
  await expect(viewer.fact('Acceleration')).toHaveText(/^[\d,]+ mm\/s²$/);
  await expect(viewer.fact('Time')).toHaveText(/^[\d.]+ m?s$/);
  expect((await viewer.picture()).equals(without), 'the segment is marked').toBe(false);
  await viewer.button('Put the choice away').click();
  await expect(viewer.segment).toHaveCount(0);
  expect((await viewer.picture()).equals(without), 'the segment is marked no more').toBe(true);
});

test('a pointer that rests on a segment is told what it is on', async ({ panel, page }) => {
  const viewer = await inView(panel, sample('test-part.gcode'));
  await viewer.button('Top').click();
  await viewer.picture();
  const { x, y } = await viewer.middle();
  await page.mouse.move(x, y);
  await expect(viewer.region.getByRole('tooltip')).toHaveText(/Line [\d,]+/);
  await page.mouse.move(0, 0);
  await expect(viewer.region.getByRole('tooltip')).toHaveCount(0);
});

test('a line that is chosen by key is shown as the last one made', async ({ panel, page }) => {
  const path = sample('test-part.gcode');
  const lines = readFileSync(path, 'utf8').split('\n');
  const viewer = await inView(panel, path);
  await viewer.openText();
  const whole = await viewer.picture();
  const field = viewer.region.getByRole('textbox', { name: /^Line \(of/ });
  const wanted = lines.findIndex((text, at) => at > 12_000 && text.startsWith('G1 X')) + 1;
  await field.fill(String(wanted));
  await field.press('Enter');
  await expect(viewer.line(wanted)).toHaveAttribute('aria-selected', 'true');
  await expect(viewer.segment).toContainText(`Line ${wanted.toLocaleString('en-GB')}`);
  const place = /X([\d.]+) Y([\d.]+)/.exec(lines[wanted - 1] ?? '');
  await expect(viewer.fact('Ends at')).toContainText(`${Number(place?.[1]).toFixed(2)}, `);
  expect((await viewer.picture()).equals(whole), 'what comes after the line is not there').toBe(false);

  await viewer.text.focus();
  await page.keyboard.press('ArrowDown');
  await expect(viewer.line(wanted + 1)).toHaveAttribute('aria-selected', 'true');
  await page.keyboard.press('PageUp');
  const chosen = viewer.text.getByRole('option', { selected: true });
  await expect.poll(async () => Number(await chosen.getAttribute('aria-posinset'))).toBeLessThan(wanted);
  await page.keyboard.press('Home');
  await expect(viewer.line(1)).toHaveAttribute('aria-selected', 'true');
  await page.keyboard.press('End');
  await expect(chosen).toHaveAttribute('aria-posinset', String(lines.length - 1));
});

test('moves that are played take the text with them', async ({ panel }) => {
  const viewer = await inView(panel, sample('test-part.gcode'));
  await viewer.openText();
  await viewer.button('Play the moves').click();
  const chosen = viewer.text.getByRole('option', { selected: true });
  await expect.poll(async () => Number(await chosen.getAttribute('aria-posinset'))).toBeGreaterThan(100);
  await viewer.button('Pause the moves').click();
});

test('a file of more lines than an element can be tall is scrolled to any of them', async ({
  panel,
  page,
  makeFile,
}) => {
  test.setTimeout(180_000);
  const viewer = new Viewer(page);
  const lines = Array.from({ length: LONG_LINES }, (_, at) => `; line ${at + 1}`);
  lines[5] = 'G1 X10 Y10 F600';
  lines[6] = 'G1 X20 Y10 E1';
  await panel.look(makeFile('long.gcode', `${lines.join('\n')}\n`));
  await viewer.ready();
  await viewer.openText();
  const field = viewer.region.getByRole('textbox', { name: /^Line \(of/ });
  for (const wanted of [LONG_LINES, 1_234_567, 3]) {
    await field.fill(String(wanted));
    await field.press('Enter');
    await expect(viewer.line(wanted)).toContainText(`; line ${wanted}`);
    await expect(viewer.line(wanted)).toBeInViewport();
  }
  // A notch of the wheel is some rows, not some thousands.
  await viewer.text.hover();
  await page.mouse.wheel(0, 200);
  await expect(viewer.line(13)).toContainText('; line 13');
  await expect(viewer.line(3)).not.toBeInViewport();
});

test('a packed file has its text too', async ({ panel, page, makeFile }) => {
  const viewer = new Viewer(page);
  const text = readFileSync(sample('test-part.gcode'));
  await panel.look(makeFile('part.gcode.gz', gzipSync(text)));
  await viewer.ready();
  await viewer.openText();
  const field = viewer.region.getByRole('textbox', { name: /^Line \(of/ });
  await field.fill('20000');
  await field.press('Enter');
  await expect(viewer.line(20_000)).toContainText(text.toString().split('\n')[19_999] ?? '');
});
