// The objects that a file names are listed, and each can be made to stand out or taken away; its pictures are shown.
import { expect, test } from '../fixtures/files.ts';
import { inView, Viewer } from '../pages/viewer.ts';

const square = (x: number, e: number): string =>
  [`G1 X${x} Y90 F6000`, `G1 X${x + 20} Y90 E${e}`, `Y110 E${e + 1}`, `X${x} E${e + 2}`, `Y90 E${e + 3}`]
    .map((line) => (line.startsWith('G') ? line : `G1 ${line}`))
    .join('\n');

const HEAD = 'G28\nG90\nM82\nM104 S200\nM109 S200\nG92 E0\nG1 Z0.2 F600\n;TYPE:External perimeter\n';
const KLIPPER = `${HEAD}EXCLUDE_OBJECT_DEFINE NAME=left CENTER=70,100
EXCLUDE_OBJECT_DEFINE NAME=right CENTER=130,100
EXCLUDE_OBJECT_START NAME=left
${square(60, 1)}
EXCLUDE_OBJECT_END NAME=left
EXCLUDE_OBJECT_START NAME=right
${square(120, 5)}
EXCLUDE_OBJECT_END NAME=right
`;
const MARLIN = `${HEAD}M486 T2
M486 S0 A"left"
${square(60, 1)}
M486 S1 A"right"
${square(120, 5)}
M486 S-1
`;

for (const [dialect, gcode] of [
  ['EXCLUDE_OBJECT', KLIPPER],
  ['M486', MARLIN],
] as const)
  test(`objects of ${dialect}`, async ({ panel, page, makeFile }) => {
    const viewer = new Viewer(page);
    await panel.look(makeFile('objects.gcode', gcode));
    await viewer.ready();
    const list = viewer.region.getByRole('list', { name: 'Objects' });
    await expect(list.getByRole('button')).toHaveText([/left/, /right/]);
    const plain = await viewer.picture();
    const right = list.getByRole('button', { name: /right/ });
    await right.focus();
    await page.keyboard.press('Enter');
    await expect(right).toHaveAttribute('aria-pressed', 'true');
    const chosen = await viewer.picture();
    expect(chosen.equals(plain)).toBe(false);
    await right.click();
    expect((await viewer.picture()).equals(plain)).toBe(true);
    await list.getByRole('checkbox', { name: /left/ }).uncheck();
    const hidden = await viewer.picture();
    expect(hidden.equals(plain)).toBe(false);
    expect(hidden.equals(chosen)).toBe(false);
    await viewer.colourBy.selectOption('Object');
    expect((await viewer.picture()).equals(hidden)).toBe(false);
  });

/** A red square of 32 pixels. */
const PNG =
  'iVBORw0KGgoAAAANSUhEUgAAACAAAAAgCAIAAAD8GO2jAAAAK0lEQVR42u3NAQEAAAjDIO1f+obQg2KQ0ul2zgQCgUAgEAgEAoFAIBAIvgUfbgFAwCTl4QAAAABJRU5ErkJggg==';

test('the picture that a slicer put into the file is shown', async ({ panel, makeFile }) => {
  const thumbnail = `; thumbnail begin 32x32 ${PNG.length}\n; ${PNG}\n; thumbnail end\n`;
  await inView(panel, makeFile('pictured.gcode', `${thumbnail}${KLIPPER}`));
  const image = panel.job.getByRole('img', { name: 'The print, as its slicer drew it' });
  await expect(image).toBeVisible();
  await expect.poll(() => image.evaluate((one: HTMLImageElement) => one.naturalWidth)).toBe(32);
  await panel.drop(makeFile('plain.gcode', KLIPPER));
  await expect(image).toHaveCount(0);
});
