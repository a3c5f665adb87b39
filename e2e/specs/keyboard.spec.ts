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

  await tabTo(page, panel.job.getByRole('button', { name: 'Pause' }));
  await page.keyboard.press('Space');
  await expect(panel.status).toContainText('Paused', { timeout: 30_000 });
  await tabTo(page, panel.job.getByRole('button', { name: 'Resume' }));
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
