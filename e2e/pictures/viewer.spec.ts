// Takes the pictures of the README that show what the preview can: colours, a segment and its line, the bed's mesh.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../scripts/lib/target.mjs';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

const picture = (name: string): string => join(root, 'docs', 'pictures', `${name}.png`);
const VIEWPORT = { width: 1280, height: 860 };

/** A bed that is low in front and high behind, as they are. */
function mesh(): string {
  const height = (x: number, y: number): number => 0.12 * (y / 6) ** 2 + 0.05 * Math.sin(x) - 0.06;
  const rows = Array.from({ length: 7 }, (_, y) =>
    Array.from({ length: 7 }, (_, x) => height(x, y).toFixed(3)).join(', '),
  );
  const place = 'x_count: 7\ny_count: 7\nmin_x: 20\nmax_x: 280\nmin_y: 20\nmax_y: 280\nalgo: bicubic\n';
  return `\n[bed_mesh default]\npoints:\n  ${rows.join('\n  ')}\n${place}`;
}

test.describe('light', () => {
  test.use({ viewport: VIEWPORT, colorScheme: 'light' });

  test('a segment and its line', async ({ page, panel }) => {
    const viewer = new Viewer(page);
    await panel.drop(sample('test-part.gcode'));
    await viewer.ready();
    await viewer.colourBy.selectOption('Actual speed');
    await viewer.openText();
    await viewer.drawn();
    const { x, y } = await viewer.middle();
    await page.mouse.click(x, y);
    await expect(viewer.segment).toContainText('mm/s²');
    await viewer.drawn();
    await page.screenshot({ path: picture('inspect') });
  });

  test('a layer in colours', async ({ page, panel }) => {
    const viewer = new Viewer(page);
    await panel.drop(sample('test-part.gcode'));
    await viewer.ready();
    await viewer.colourBy.selectOption('Line width');
    await viewer.topLayer.focus();
    for (let times = 0; times < 3; times += 1) await page.keyboard.press('PageDown');
    await viewer.checkbox('Travel moves').check();
    await viewer.checkbox('Seams').check();
    await viewer.drawn();
    await page.screenshot({ path: picture('colours') });
  });
});

test.describe('dark', () => {
  test.use({ viewport: VIEWPORT, colorScheme: 'dark' });

  test('the mesh of the bed', async ({ page, panel, makeFile }) => {
    const viewer = new Viewer(page);
    await panel.look(makeFile('bent.cfg', readFileSync(sample('printer.cfg'), 'utf8') + mesh()));
    const dialog = panel.dialog('Machine');
    await expect(dialog).toContainText('is now the profile');
    await panel.closeDialog(dialog);
    await panel.drop(sample('test-part.gcode'));
    await viewer.ready();
    await viewer.colourBy.selectOption('Layer time');
    await viewer.checkbox('Bed mesh').check();
    await viewer.drawn();
    await viewer.view.focus();
    for (let times = 0; times < 5; times += 1) await page.keyboard.press('-');
    await viewer.drawn();
    await page.screenshot({ path: picture('mesh') });
  });
});
