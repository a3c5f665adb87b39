// What breaks on a printer: it stops, says why, claims nothing that it does not know, and starts nothing by itself.
import { expect, test } from '../fixtures/test.ts';
import { sample } from '../pages/panel.ts';
import { motor } from '../pages/record.ts';

test('the thermistor is unplugged while printing', async ({ panel }) => {
  test.setTimeout(120_000);
  await panel.drop(sample('test-part-small.gcode'));
  // At 20 times the speed: after ten seconds, with the print under way.
  await panel.connectVirtual('up to 20×', 'sensor-open=extruder@200');
  await panel.startPrint();

  await expect(panel.status).toContainText('Stopped', { timeout: 60_000 });
  await expect(panel.alert).toContainText(/temperature sensor.*unplugged.*extruder/);
  await expect(panel.alert).toContainText('motors do not move and heaters are off');
  await expect(panel.job).toContainText('It does not start again by itself');
  for (const heater of ['Nozzle', 'Bed'] as const) {
    await expect(panel.heater(heater)).toContainText('Last reading');
    await expect(panel.target(heater)).toBeDisabled();
  }
  const stopped = await panel.record();
  expect(stopped.shutdown).not.toBeNull();
  expect(stopped.heaters.map(({ duty }) => duty)).toEqual([0, 0]);
  expect(stopped.motors.map(({ energised }) => energised)).toEqual([false, false, false, false]);

  // The cable is still out: restarted, the board looks and stops again, with the same reason.
  await panel.alert.getByRole('button', { name: 'Restart the board' }).click();
  await expect(panel.messages).toContainText('The board restarts.');
  await expect(panel.messages.getByText('The board has stopped.')).toHaveCount(2);
  await expect(panel.status).toContainText('Stopped');
  await expect(panel.alert).toContainText(/temperature sensor.*extruder/);
  expect(motor(await panel.record(), 'extruder').pulses).toBe(motor(stopped, 'extruder').pulses);
});

test('a heater that does not warm', async ({ panel }) => {
  test.setTimeout(120_000);
  await panel.connectVirtual('up to 20×', 'heater-dead=extruder');
  await panel.temperatures.getByRole('button', { name: 'PLA' }).click();
  await expect(panel.target('Nozzle')).toHaveValue('205');
  await expect(panel.target('Bed')).toHaveValue('60');

  await expect(panel.status).toContainText('Stopped', { timeout: 60_000 });
  await expect(panel.alert).toContainText(/switched on but did not get warmer: extruder/);
  expect((await panel.record()).heaters.map(({ duty }) => duty)).toEqual([0, 0]);

  await panel.alert.getByRole('button', { name: 'Restart the board' }).click();
  await expect(panel.status).toContainText('Ready');
  await expect(panel.alert).toBeEmpty();
  await expect(panel.heater('Nozzle')).toContainText('Off');
  // Nothing is switched on by the restart.
  await expect(panel.target('Nozzle')).toHaveValue('0');
  await expect(panel.target('Bed')).toHaveValue('0');
  expect((await panel.record()).heaters.map(({ duty }) => duty)).toEqual([0, 0]);
});

test('an endstop that never closes ends homing with the reason', async ({ panel }) => {
  await panel.connectVirtual('up to 200×', 'endstop-stuck-off=x');
  await panel.motion.getByRole('button', { name: 'Home X' }).click();
  await expect(panel.alert).toContainText(/endstop/i, { timeout: 45_000 });
  await expect(panel.fact(panel.motion, 'X')).not.toContainText(/\d/);
});

test('faults that make no sense are refused before anything is connected', async ({ panel }) => {
  const dialog = await panel.openDialog('Connect');
  await panel.chooseVirtual(dialog, 'up to 200×', 'volcano=extruder@3');
  await expect(dialog).toContainText('volcano');
  await expect(dialog.getByRole('button', { name: 'Connect', exact: true })).toBeDisabled();
  await expect(dialog).toContainText('The faults cannot be read');
});
