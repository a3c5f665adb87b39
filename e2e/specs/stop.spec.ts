// The emergency stop, by mouse and by keyboard; pausing, resuming and cancelling a print.
import { expect, type MakeFile, test } from '../fixtures/files.ts';
import { type Travels, travels } from '../fixtures/gcode.ts';
import type { Panel } from '../pages/panel.ts';
import { motor } from '../pages/record.ts';

/** So many moves take minutes of the printer's time: at 200 times the speed still seconds. */
const LONG = travels(3000);
const SHORT = travels(700);
const PLACE_ERROR_MM = 0.1;

/** A print that has come to its moves. */
async function printing(panel: Panel, makeFile: MakeFile, file: Travels): Promise<void> {
  await panel.connectVirtual();
  await panel.drop(makeFile('travels.gcode', file.gcode));
  await panel.startPrint();
  await expect(panel.fact(panel.job, 'Line')).toHaveText(/[1-9]\d/);
}

async function expectStopped(panel: Panel): Promise<void> {
  await expect(panel.status).toContainText('Stopped');
  await expect(panel.alert).toContainText('The emergency stop was asked for.');
  await expect(panel.alert).toContainText('restart the board and home');
  await expect(panel.job).toContainText('It does not start again by itself');
  const record = await panel.record();
  expect(record.shutdown).not.toBeNull();
  expect(record.heaters.map(({ duty }) => duty)).toEqual([0, 0]);
  // Time goes on and nothing moves.
  const later = await panel.record();
  expect(later.time_s).toBeGreaterThan(record.time_s);
  expect(later.motors.map(({ pulses }) => pulses)).toEqual(record.motors.map(({ pulses }) => pulses));
}

test('emergency stop while printing, then a restart of the board', async ({ panel, makeFile }) => {
  await printing(panel, makeFile, LONG);
  await panel.emergencyStop.click();
  await expectStopped(panel);
  const stopped = await panel.record();

  await panel.alert.getByRole('button', { name: 'Restart the board' }).click();
  await expect(panel.status).toContainText('Ready');
  await expect(panel.alert).toBeEmpty();
  // The position was lost, and the print does not go on.
  await expect(panel.fact(panel.motion, 'X')).toContainText('not homed');
  await expect(panel.motion.getByRole('button', { name: /^Left/ })).toBeDisabled();
  await expect(panel.print).toBeEnabled();
  const ready = await panel.record();
  expect(motor(ready, 'stepper_x').pulses).toBe(motor(stopped, 'stepper_x').pulses);
  await panel.home();
});

test('emergency stop by keyboard alone', async ({ panel, makeFile }) => {
  await printing(panel, makeFile, LONG);
  await panel.emergencyStop.focus();
  await panel.page.keyboard.press('Enter');
  await expectStopped(panel);
});

test('emergency stop from inside a dialog', async ({ panel, makeFile }) => {
  await printing(panel, makeFile, LONG);
  const dialog = await panel.openDialog('Settings');
  await expect(dialog.getByRole('alert')).toBeEmpty();
  await dialog.getByRole('button', { name: 'Emergency stop' }).click();
  // What lies behind the dialog cannot be reached.
  await expect(dialog.getByRole('alert')).toContainText('The emergency stop was asked for.');
  await expect(dialog.getByRole('button', { name: 'Restart the board' })).toBeVisible();
  await panel.closeDialog(dialog);
  await expectStopped(panel);
  // The message may be put away; the way on stays.
  await panel.alert.getByRole('button', { name: 'Put this message away' }).click();
  await expect(panel.alert).not.toContainText('The emergency stop was asked for.');
  await expect(panel.alert).toContainText('The board has stopped.');
  await panel.alert.getByRole('button', { name: 'Restart the board' }).click();
  await expect(panel.status).toContainText('Ready');
  await expect(panel.alert).toBeEmpty();
});

test('a double click on Print starts the print and does not pause it', async ({ panel, makeFile }) => {
  await panel.connectVirtual('up to 20×');
  await panel.drop(makeFile('travels.gcode', LONG.gcode));
  await expect(panel.print).toBeEnabled();
  await panel.print.dblclick({ delay: 60 });
  await expect(panel.status).toContainText('Printing');
  const pause = panel.job.getByRole('button', { name: 'Pause' });
  // Just after the change, too.
  await pause.dispatchEvent('click');
  await expect(pause).toBeEnabled();
  await expect(panel.fact(panel.job, 'Line')).toHaveText(/[1-9]\d/);
  await expect(panel.status).toContainText('Printing');
  await expect(panel.messages).not.toContainText('Paused.');
  await pause.click();
  await expect(panel.status).toContainText('Paused', { timeout: 30_000 });
});

test('pause, move by hand, resume: the print ends where it should', async ({ panel, makeFile }) => {
  test.setTimeout(120_000);
  await printing(panel, makeFile, SHORT);
  await panel.job.getByRole('button', { name: 'Pause' }).click();
  await expect(panel.status).toContainText('Paused', { timeout: 30_000 });
  const paused = await panel.record();
  await expect(panel.target('Nozzle')).toHaveValue('60');

  await panel.motion.getByText('10 mm', { exact: true }).click();
  await panel.motion.getByRole('button', { name: /^Up/ }).click();
  // A pause has lifted the head by 5 mm already.
  await expect(panel.fact(panel.motion, 'Z')).toHaveText('20.00');
  const moved = await panel.record();
  expect(motor(moved, 'stepper_z').count - motor(paused, 'stepper_z').count).toBe(4000);
  expect(motor(moved, 'stepper_x').pulses).toBe(motor(paused, 'stepper_x').pulses);

  await panel.job.getByRole('button', { name: 'Resume' }).click();
  await expect(panel.status).toContainText('Printing');
  await expect(panel.job).toContainText('The print is done.', { timeout: 60_000 });
  const done = await panel.record();
  for (const [index, axis] of ['x', 'y', 'z'].entries()) {
    const error = motor(done, `stepper_${axis}`).position_mm - (SHORT.end[index] ?? Number.NaN);
    expect(Math.abs(error)).toBeLessThan(PLACE_ERROR_MM);
  }
});

test('cancel asks first, then ends the print and switches the heaters off', async ({ panel, makeFile }) => {
  await printing(panel, makeFile, LONG);
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'Go on printing');
  await expect(panel.status).toContainText('Printing');
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
  await expect(panel.status).toContainText('Ready');
  await expect(panel.target('Nozzle')).toHaveValue('0');
  const record = await panel.record();
  expect(record.shutdown).toBeNull();
  expect(record.heaters.map(({ duty }) => duty)).toEqual([0, 0]);
});

test('disconnecting while printing asks first', async ({ panel, makeFile }) => {
  await printing(panel, makeFile, LONG);
  await panel.top.getByRole('button', { name: 'Disconnect' }).click();
  await panel.answer('Disconnect while printing?', 'Go on printing');
  await expect(panel.status).toContainText('Printing');
  await panel.top.getByRole('button', { name: 'Disconnect' }).click();
  await panel.answer('Disconnect while printing?', 'Disconnect');
  await expect(panel.status).toContainText('Not connected');
  await expect(panel.job).toContainText('The print stopped before its end.');
});
