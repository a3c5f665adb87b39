// A whole print with the keyboard alone: every step is a key, and the focus is where one is.

import type { Locator, Page } from '@playwright/test';
import { expect, test } from '../fixtures/files.ts';
import { travels } from '../fixtures/gcode.ts';

/** More presses of Tab than there are things to reach. */
const TABS_MAX = 80;

const isFocused = (target: Locator): Promise<boolean> =>
  target.evaluate((element) => element === element.ownerDocument.activeElement);

/** Goes on with Tab until the target has the focus. */
async function tabTo(page: Page, target: Locator): Promise<void> {
  await expect(target).toBeVisible();
  for (let count = 0; count < TABS_MAX; count += 1) {
    if (await isFocused(target)) return;
    await page.keyboard.press('Tab');
  }
  throw new Error(`${target} is not reached by Tab`);
}

test('connects, opens a file, prints, pauses, resumes and sees the end', async ({
  page,
  panel,
  makeFile,
}) => {
  test.setTimeout(120_000);
  const file = makeFile('travels.gcode', travels(600).gcode);

  await tabTo(page, panel.top.getByRole('button', { name: 'Connect', exact: true }));
  await page.keyboard.press('Enter');
  const dialog = panel.dialog('Connect');
  const usb = dialog.getByRole('radio', { name: 'Printer on USB' });
  await tabTo(page, usb);
  await page.keyboard.press('ArrowRight');
  await expect(dialog.getByRole('radio', { name: 'Virtual printer' })).toBeChecked();
  await tabTo(page, dialog.getByRole('radio', { name: 'Real time' }));
  for (const speed of ['up to 5×', 'up to 20×', 'up to 200×']) {
    await page.keyboard.press('ArrowRight');
    await expect(dialog.getByRole('radio', { name: speed, exact: true })).toBeChecked();
  }
  const connect = dialog.getByRole('button', { name: 'Connect', exact: true });
  await expect(connect).toBeEnabled();
  await tabTo(page, connect);
  await page.keyboard.press('Enter');
  await expect(panel.status).toContainText('Ready');

  await tabTo(page, panel.preview.getByRole('button', { name: 'Choose a file' }));
  const choosing = page.waitForEvent('filechooser');
  await page.keyboard.press('Enter');
  await (await choosing).setFiles(file);
  await expect(panel.print).toBeEnabled();
  await tabTo(page, panel.print);
  await page.keyboard.press('Enter');
  await expect(panel.status).toContainText('Printing');

  const pause = panel.job.getByRole('button', { name: 'Pause' });
  await tabTo(page, pause);
  // Not before the press on Print, in the same place, is over.
  await expect(pause).toBeEnabled();
  await page.keyboard.press('Space');
  await expect(panel.status).toContainText('Paused', { timeout: 30_000 });
  const resume = panel.job.getByRole('button', { name: 'Resume' });
  await tabTo(page, resume);
  await expect(resume).toBeEnabled();
  await page.keyboard.press('Space');
  await expect(panel.job).toContainText('The print is done.', { timeout: 60_000 });
});

test('a dialog keeps the focus, closes with Escape, and gives the focus back', async ({ page, panel }) => {
  const button = panel.top.getByRole('button', { name: 'Settings', exact: true });
  await tabTo(page, button);
  await page.keyboard.press('Enter');
  const dialog = panel.dialog('Settings');
  await expect(dialog).toBeVisible();
  await page.keyboard.press('Escape');
  await expect(dialog).toHaveCount(0);
  await expect(button).toBeFocused();
});

test('the 3D view is turned by keyboard and is not a trap', async ({ page, panel }) => {
  const view = panel.preview.getByRole('application');
  await tabTo(page, view);
  for (const key of ['ArrowLeft', 'ArrowUp', 'Shift+ArrowRight', '+', '-', 'Home'])
    await page.keyboard.press(key);
  await page.keyboard.press('Tab');
  await expect(view).not.toBeFocused();
});

test('a dialog that is closed does not close the next one with it', async ({ page, panel }) => {
  await panel.openDialog('Machine');
  // Both in one task: faster than any hand, as a slow computer is.
  await page.evaluate(() => {
    const press = (name: string): void =>
      document.querySelector<HTMLElement>(`button[aria-label="${name}"]`)?.click();
    press('Close');
    press('Settings');
  });
  await expect(panel.dialog('Machine')).toHaveCount(0);
  // The browser tells of a dialog's end in a later task: after two pictures it has.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await expect(panel.dialog('Settings')).toBeVisible();
});

test('a dialog that is opened twice by Enter stops nothing', async ({ page, panel, makeFile }) => {
  await panel.connectVirtual('up to 20×');
  await panel.drop(makeFile('travels.gcode', travels(3000).gcode));
  await panel.startPrint();
  await expect(panel.fact(panel.job, 'Line')).toHaveText(/[1-9]\d/);

  const cancel = panel.job.getByRole('button', { name: 'Cancel' });
  await cancel.focus();
  await page.keyboard.press('Enter');
  const question = page.getByRole('dialog', { name: 'End the print?' });
  await expect(question.getByRole('button', { name: 'Go on printing' })).toBeFocused();
  await page.keyboard.press('Enter');
  await expect(question).toHaveCount(0);
  await expect(cancel).toBeFocused();

  for (const name of ['Settings', 'Machine'] as const) {
    await panel.top.getByRole('button', { name, exact: true }).focus();
    await page.keyboard.press('Enter');
    const dialog = panel.dialog(name);
    await expect(dialog.getByRole('heading', { name, exact: true })).toBeFocused();
    await page.keyboard.press('Enter');
    await page.keyboard.press('Space');
    await expect(dialog).toBeVisible();
    await page.keyboard.press('Escape');
    await expect(dialog).toHaveCount(0);
  }
  const line = async (): Promise<number> =>
    Number((await panel.fact(panel.job, 'Line').innerText()).replace(',', ''));
  const before = await line();
  await expect.poll(line).toBeGreaterThan(before);
  await expect(panel.status).toContainText('Printing');
  await expect(panel.messages).not.toContainText('Emergency stop pressed');
});
