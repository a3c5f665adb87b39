// The machine's bed: its shape from the machine file, and its mesh as a surface: the one that the printer makes up for.
import { readFileSync } from 'node:fs';
import { expect, test } from '../fixtures/files.ts';
import { type Panel, sample } from '../pages/panel.ts';
import { inView, Viewer } from '../pages/viewer.ts';

const PLACE = 'x_count: 3\ny_count: 3\nmin_x: 20\nmax_x: 280\nmin_y: 20\nmax_y: 280\n';
const MESHES = `
[bed_mesh cold]
points:
  0.10, 0.04, 0.12
  0.05, -0.07, 0.06
  0.15, 0.02, 0.16
${PLACE}
[bed_mesh warm]
points:
  -0.20, 0.00, 0.20
  -0.20, 0.00, 0.20
  -0.20, 0.00, 0.20
${PLACE}`;

/** Takes a machine file in and puts it to use. */
async function useMachine(panel: Panel, path: string): Promise<void> {
  await panel.look(path);
  const dialog = panel.dialog('Machine');
  await expect(dialog).toContainText('is now the profile');
  await panel.closeDialog(dialog);
}

test('the mesh that is in force is shown as a surface', async ({ panel, page, makeFile }) => {
  test.setTimeout(120_000);
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  const part = viewer.region.getByRole('region', { name: 'Bed mesh of the machine' });
  await expect(part).toHaveCount(0);
  await useMachine(panel, makeFile('bent.cfg', readFileSync(sample('printer.cfg'), 'utf8') + MESHES));
  await viewer.ready();
  const plain = await viewer.picture();

  // By keyboard; nothing is connected, so it is one of the machine file's.
  await viewer.checkbox('Bed mesh').focus();
  await page.keyboard.press('Space');
  await expect(part).toContainText('“cold” of the machine file; it is not in force.');
  await expect(part).toContainText('-0.070 mm');
  await expect(part).toContainText('0.160 mm');
  await expect(part).toContainText(/Drawn \d+ times as high/);
  const cold = await viewer.picture();
  expect(cold.equals(plain), 'there is a surface').toBe(false);
  await part.getByRole('combobox', { name: 'Mesh' }).selectOption('warm');
  await expect(part).toContainText('“warm” of the machine file');
  const warm = await viewer.picture();
  expect(warm.equals(cold), 'another surface').toBe(false);
  await part.getByRole('combobox', { name: 'Mesh' }).selectOption('cold');

  await panel.connectVirtual();
  await panel.send('BED_MESH_PROFILE LOAD=warm');
  await expect(part).toContainText('“warm”, which is in force.');
  await expect(part.getByRole('combobox', { name: 'Mesh' })).toHaveCount(0);
  expect((await viewer.picture()).equals(cold), 'what the printer has loaded').toBe(false);
  await panel.send('BED_MESH_CLEAR');
  await expect(part).toContainText('“cold” of the machine file; it is not in force.');
  await viewer.checkbox('Bed mesh').uncheck();
  await expect(part).not.toContainText('cold');
});

test('the mesh is to be seen without a file, too', async ({ panel, page, makeFile }) => {
  test.setTimeout(90_000);
  const viewer = new Viewer(page);
  await expect(viewer.checkbox('Bed mesh')).toHaveCount(0);
  await useMachine(panel, makeFile('bent.cfg', readFileSync(sample('printer.cfg'), 'utf8') + MESHES));
  /** What is on the screen in the middle of the view, whatever lies over it. */
  const middle = async (): Promise<Buffer> => {
    const { x, y } = await viewer.middle();
    await viewer.picture();
    return await page.screenshot({ clip: { x: x - 40, y: y - 25, width: 80, height: 50 } });
  };
  const plain = await middle();
  await viewer.checkbox('Bed mesh').focus();
  await page.keyboard.press('Space');
  const part = viewer.region.getByRole('region', { name: 'Bed mesh of the machine' });
  await expect(part).toContainText('“cold” of the machine file; it is not in force.');
  const cold = await middle();
  expect(cold.equals(plain), 'the surface is seen').toBe(false);
  await part.getByRole('combobox', { name: 'Mesh' }).selectOption('warm');
  expect((await middle()).equals(cold), 'another surface').toBe(false);
  // What asks for a file has made room for it.
  const { y } = await viewer.middle();
  const invitation = await viewer.region.getByText('Drop a G-code file here').boundingBox();
  expect(invitation?.y).toBeGreaterThan(y + 60);
  await expect(viewer.button('Choose a file')).toBeInViewport({ ratio: 1 });
});

/** Where a square bed that fills the view from above has its corner, and far away from any bed. */
async function cornerAndAway(viewer: Viewer): Promise<readonly [Buffer, Buffer]> {
  await viewer.button('Top').click();
  const box = await viewer.view.boundingBox();
  if (!box) throw new Error('the view is not on the page');
  const half = Math.min(box.width, box.height) / 2;
  const { x, y } = await viewer.middle();
  return [await viewer.patch(x - 0.75 * half, y + 0.75 * half), await viewer.patch(box.x + 8, y)];
}

test('a round bed is round', async ({ panel, page }) => {
  test.setTimeout(90_000);
  await page.setViewportSize({ width: 1600, height: 800 });
  const viewer = new Viewer(page);
  const [square, background] = await cornerAndAway(viewer);
  expect(square.equals(background)).toBe(false);
  await useMachine(panel, sample('delta.cfg'));
  const [round, still] = await cornerAndAway(viewer);
  expect(still.equals(background)).toBe(true);
  expect(round.equals(background)).toBe(true);
});
