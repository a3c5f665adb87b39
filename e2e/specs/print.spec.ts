// A whole print on the virtual printer: a slicer's file dropped on the page, printed to its end, and what the device did
// compared with what the native planner makes of the same file.
import { readFileSync } from 'node:fs';
import { expect, test } from '../fixtures/files.ts';
import { nativePlan } from '../fixtures/plan.ts';
import { sample } from '../pages/panel.ts';
import { motor, pulsesOf, type VirtualState } from '../pages/record.ts';
import { endOf } from '../serial/gcode.ts';

const FILE = 'test-part-small.gcode';
/** A step of X and Y is 0.0125 mm; a place is a whole number of steps away from the one in the file. */
const PLACE_ERROR_MM = 0.02;
const AXES = ['X', 'Y', 'Z'] as const;

const place = (record: VirtualState, axis: (typeof AXES)[number]): number =>
  motor(record, `stepper_${axis.toLowerCase()}`).position_mm;

test('a dropped file is printed to its end, step for step', async ({ panel, makeFile }) => {
  test.setTimeout(150_000);
  const gcode = readFileSync(sample(FILE), 'utf8');
  const plan = nativePlan(sample(FILE));

  // How many steps homing takes depends on when a switch is looked at, so it is done before, and counted by itself.
  await panel.connectVirtual();
  await panel.home();
  const homed = await panel.record();
  const homing = pulsesOf(homed);
  // A switch closes a little before or after its place, so all that follows is as much beside it.
  const beside = await Promise.all(
    AXES.map(async (axis) => place(homed, axis) - (await panel.position(axis))),
  );

  await panel.drop(makeFile(FILE, gcode.replace(/^G28$/m, '; homed')));
  await panel.startPrint();
  await expect(panel.job.getByRole('progressbar', { name: 'Print progress' })).toBeVisible();
  await expect(panel.job).toContainText('The print is done.', { timeout: 120_000 });
  await expect(panel.status).toContainText('Ready');

  const record = await panel.record();
  const motors = Object.keys(plan.motors);
  expect(motors.sort()).toEqual(['extruder', 'stepper_x', 'stepper_y', 'stepper_z']);
  const expected = motors.map((name) => [name, (plan.motors[name]?.steps ?? 0) + (homing[name] ?? 0)]);
  expect(pulsesOf(record)).toEqual(Object.fromEntries(expected));

  const ends = endOf(gcode);
  for (const [index, axis] of AXES.entries()) {
    const error = place(record, axis) - (ends[index] ?? Number.NaN) - (beside[index] ?? Number.NaN);
    expect(Math.abs(error), `the end of ${axis}`).toBeLessThan(PLACE_ERROR_MM);
  }
  expect(Math.abs(motor(record, 'extruder').position_mm - plan.filament_mm)).toBeLessThan(PLACE_ERROR_MM);
  expect(record.motors.map(({ lost_steps }) => lost_steps)).toEqual([0, 0, 0, 0]);
  expect(record.shutdown).toBeNull();
});
