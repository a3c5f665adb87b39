// The machine's file: several profiles, what is wrong by line, taking it out, and keeping it.
import { readFileSync } from 'node:fs';
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';

const CONFIG = readFileSync(sample('printer.cfg'), 'utf8');
const lineOf = (text: string): number => CONFIG.slice(0, CONFIG.indexOf(text)).split('\n').length;

test('what is wrong in a printer.cfg is told by line, and nothing can be connected with it', async ({
  panel,
}) => {
  const dialog = await panel.openDialog('Machine');
  const text = dialog.getByRole('textbox', { name: 'printer.cfg' });
  await expect(dialog).toContainText('A machine with room for 300 × 300 × 250 mm.');
  const wrong = CONFIG.replace('max_velocity: 300', 'max_velocity: fast').replace(
    'rotation_distance: 8',
    'rotation_distance: eight',
  );
  await text.fill(wrong);
  await expect(dialog).toContainText('This file has errors, so it cannot be used.');
  for (const line of [lineOf('max_velocity:'), lineOf('rotation_distance: 8')])
    await expect(dialog.getByRole('button', { name: `Line ${line}`, exact: true })).toBeVisible();
  await dialog.getByRole('button', { name: `Line ${lineOf('rotation_distance: 8')}`, exact: true }).click();
  await expect(text).toBeFocused();
  const marked = await text.evaluate((area: HTMLTextAreaElement) =>
    area.value.slice(area.selectionStart, area.selectionEnd),
  );
  expect(marked).toBe('rotation_distance: eight');

  await dialog.getByRole('button', { name: 'Save' }).click();
  await panel.closeDialog(dialog);
  const connect = await panel.openDialog('Connect');
  await panel.chooseVirtual(connect, 'up to 200×');
  await expect(connect).toContainText('The machine file has errors');
  await expect(connect.getByRole('button', { name: 'Connect', exact: true })).toBeDisabled();
});

test('profiles: taken in, changed, kept over a reload, used, given out', async ({
  page,
  panel,
  makeFile,
}) => {
  const small = CONFIG.replace('position_max: 300', 'position_max: 60');
  let dialog = await panel.openDialog('Machine');
  const choosing = page.waitForEvent('filechooser');
  await dialog.getByText('Open printer.cfg').click();
  await (await choosing).setFiles(makeFile('Small one.cfg', small));
  await expect(dialog.getByRole('combobox', { name: 'Profile' })).toContainText('Small one');
  await expect(dialog).toContainText('A machine with room for 60 × 300 × 250 mm.');
  await dialog.getByRole('button', { name: 'Duplicate' }).click();
  await expect(dialog.getByRole('textbox', { name: 'Name' })).toHaveValue('Small one copy');
  await dialog.getByRole('textbox', { name: 'Name' }).fill('Tall one');
  await dialog
    .getByRole('textbox', { name: 'printer.cfg' })
    .fill(small.replace('position_max: 250', 'position_max: 400'));
  await dialog.getByRole('button', { name: 'Save' }).click();
  await expect(dialog).toContainText('Saved.');
  await panel.closeDialog(dialog);

  await page.reload();
  dialog = await panel.openDialog('Machine');
  const profiles = dialog.getByRole('combobox', { name: 'Profile' });
  await expect(profiles.getByRole('option')).toHaveText(['Sample machine', 'Small one', 'Tall one']);
  await expect(profiles.getByRole('option', { selected: true })).toHaveText('Tall one');
  await expect(dialog).toContainText('A machine with room for 60 × 300 × 400 mm.');
  const coming = page.waitForEvent('download');
  await dialog.getByRole('button', { name: 'Download' }).click();
  const download = await coming;
  expect(download.suggestedFilename()).toBe('Tall one.cfg');
  expect(readFileSync(await download.path(), 'utf8')).toContain('position_max: 400');
  await panel.closeDialog(dialog);

  // The file for the large bed does not fit on the small one.
  await panel.drop(sample('test-part-small.gcode'));
  await panel.connectVirtual();
  await expect(panel.print).toBeDisabled();
  await expect(panel.job).toContainText('The file cannot be printed on this machine');
});

test('while connected the machine’s file can be read and not changed', async ({ panel }) => {
  await panel.connectVirtual();
  const dialog = await panel.openDialog('Machine');
  await expect(dialog).toContainText('Disconnect to change the machine');
  await expect(dialog.getByRole('textbox', { name: 'printer.cfg' })).not.toBeEditable();
  await expect(dialog.getByRole('button', { name: 'Duplicate' })).toBeDisabled();
});
