// A browser without WebGL 2: that is said, and layers are shown from above.
import { browserArguments, findBrowser } from '../../scripts/lib/browser.mjs';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

// Pictures in full detail take their time without a graphics card, and more where the machine has other work.
test.describe.configure({ timeout: 120_000 });

/** Neither a graphics card nor a stand-in for one. */
const GRAPHICS = /--use-|swiftshader/;
const NO_GRAPHICS = ['--disable-gpu', '--disable-software-rasterizer'];

test.use({
  launchOptions: {
    executablePath: findBrowser() ?? '',
    args: [...browserArguments().filter((one) => !GRAPHICS.test(one)), ...NO_GRAPHICS],
  },
});

test('without WebGL 2 the layers are drawn from above, and a segment is found', async ({
  panel,
  page,
  watch,
}) => {
  const viewer = new Viewer(page);
  watch.expectError(/WebGL/);
  await expect(viewer.region.getByRole('status')).toContainText('No 3D view here');
  await panel.drop(sample('test-part.gcode'));
  await viewer.ready();
  const whole = await viewer.picture();
  await viewer.topLayer.focus();
  await page.keyboard.press('Home');
  expect((await viewer.picture()).equals(whole), 'another layer').toBe(false);
  const { x, y } = await viewer.middle();
  await page.mouse.click(x, y);
  await expect(viewer.segment).toBeVisible();
  await viewer.view.focus();
  const before = await viewer.picture();
  await page.keyboard.press('+');
  expect((await viewer.picture()).equals(before), 'nearer').toBe(false);
});
