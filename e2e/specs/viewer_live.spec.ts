// While a file is printed, the view follows what the machine has done: the nozzle, the printed part, the line of text.
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { Viewer } from '../pages/viewer.ts';

test('the printed part and its line follow the motion; the camera goes with the nozzle', async ({
  panel,
  page,
}) => {
  test.setTimeout(150_000);
  const viewer = new Viewer(page);
  await panel.connectVirtual('up to 20×');
  await panel.drop(sample('test-part.gcode'));
  await viewer.ready();
  await viewer.openText();
  const before = await viewer.picture();
  await panel.startPrint();
  const line = async (): Promise<number> =>
    Number((await panel.fact(panel.job, 'Line').innerText()).replaceAll(/\D/g, ''));
  await expect.poll(line, { timeout: 60_000 }).toBeGreaterThan(60);
  const printed = viewer.text.locator('.gcode-line.printed');
  await expect(printed).toBeInViewport();
  const first = Number(await printed.getAttribute('aria-posinset'));
  await expect.poll(async () => Number(await printed.getAttribute('aria-posinset'))).toBeGreaterThan(first);
  await expect(printed).toBeInViewport();

  // The text shows the line that the machine's own count names: what was made, not what was sent.
  await panel.job.getByRole('button', { name: 'Pause' }).click();
  await expect(panel.status).toContainText('Paused');
  await expect.poll(async () => Number(await printed.getAttribute('aria-posinset'))).toBe(await line());
  const paused = await viewer.picture();
  expect(paused.equals(before), 'what is printed looks other than what is not').toBe(false);

  await viewer.button('Follow the nozzle').click();
  const followed = await viewer.picture();
  expect(followed.equals(paused), 'the camera looks at the nozzle').toBe(false);
  await viewer.button('Follow the nozzle').click();
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
});
