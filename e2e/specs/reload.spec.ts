// Reloading while printing asks first; afterwards everything that was chosen is still there, and nothing is driven.
import { expect, test } from '../fixtures/files.ts';
import { travels } from '../fixtures/gcode.ts';
import { recordOf } from '../pages/record.ts';

test('the page asks before it is left while printing; then nothing goes on by itself', async ({
  page,
  panel,
  makeFile,
}) => {
  const settings = await panel.openDialog('Settings');
  await settings.getByText('Dark', { exact: true }).click();
  await settings.getByRole('textbox', { name: 'Nozzle' }).first().fill('211');
  await settings.getByRole('textbox', { name: 'Nozzle' }).first().press('Enter');
  await panel.closeDialog(settings);
  await panel.motion.getByText('0.1 mm', { exact: true }).click();

  await panel.connectVirtual();
  await panel.drop(makeFile('travels.gcode', travels(3000).gcode));
  await panel.startPrint();

  const reload = async (answer: 'accept' | 'dismiss'): Promise<void> => {
    const asking = page.waitForEvent('dialog');
    await page.evaluate(() => setTimeout(() => location.reload()));
    const dialog = await asking;
    expect(dialog.type()).toBe('beforeunload');
    await dialog[answer]();
  };
  await reload('dismiss');
  await expect(panel.status).toContainText('Printing');

  const loaded = page.waitForEvent('load');
  await reload('accept');
  await loaded;
  await expect(panel.status).toContainText('Not connected');
  await expect(page.locator('html')).toHaveAttribute('data-theme', 'dark');
  await expect(panel.motion.getByRole('radio', { name: '0.1 mm' })).toBeChecked();
  const again = await panel.openDialog('Settings');
  await expect(again.getByRole('textbox', { name: 'Nozzle' }).first()).toHaveValue('211');
  await panel.closeDialog(again);
  // What was chosen is offered, and waits for the button.
  const connect = await panel.openDialog('Connect');
  await expect(connect.getByRole('radio', { name: 'Virtual printer' })).toBeChecked();
  await expect(connect.getByRole('radio', { name: 'up to 200×' })).toBeChecked();
  await expect(connect.getByRole('button', { name: 'Connect', exact: true })).toBeEnabled();
  await panel.closeDialog(connect);
  await expect(panel.status).toContainText('Not connected');
  const report = await panel.report();
  expect(() => recordOf(report)).toThrow('no virtual printer is connected');
});

test('without a print the page is left without a question, with one it is not', async ({
  page,
  panel,
  makeFile,
}) => {
  // Without a listener they would be accepted unseen.
  const questions: string[] = [];
  page.on('dialog', (dialog) => {
    questions.push(dialog.type());
    void dialog.accept();
  });
  await panel.connectVirtual();
  await page.reload();
  await expect(panel.status).toContainText('Not connected');
  expect(questions).toEqual([]);

  // The browser asks only on a page that somebody has used.
  await panel.connectVirtual();
  await panel.drop(makeFile('travels.gcode', travels(3000).gcode));
  await panel.startPrint();
  await page.reload();
  await expect(panel.status).toContainText('Not connected');
  expect(questions).toEqual(['beforeunload']);
});
