// A whole print on the virtual printer: a slicer's file dropped on the page, printed to its end, and what the device did
// compared with what the native planner makes of the same file.
import { readFileSync } from 'node:fs';
import { nativePlan } from '../fixtures/plan.ts';
import { expect, test } from '../fixtures/test.ts';
import { sample } from '../pages/panel.ts';
import { motor, pulsesOf, type VirtualState } from '../pages/record.ts';
import { endOf } from '../serial/gcode.ts';

const FILE = 'test-part-small.gcode';
/** A step of X and Y is 0.0125 mm; a place is a whole number of steps away from the one in the file. */
const PLACE_ERROR_MM = 0.02;
/** A switch is looked at now and then: from one homing to the next a step more or less is made until it is seen. */
const HOMING_SPREAD = 1;
const AXES = ['X', 'Y', 'Z'] as const;

const place = (record: VirtualState, axis: (typeof AXES)[number]): number =>
  motor(record, `stepper_${axis.toLowerCase()}`).position_mm;

test('a dropped file is printed to its end, step for step', async ({ panel }) => {
  test.setTimeout(150_000);
  const gcode = readFileSync(sample(FILE));
  const plan = nativePlan(sample(FILE));

  // What homing alone takes, which the plan leaves out. The device is the same each time it is switched on.
  await panel.connectVirtual();
  await panel.home();
  const homed = await panel.record();
  const homing = pulsesOf(homed);
  // A switch closes a little before or after its place, so all that follows is as much beside it.
  const beside = await Promise.all(
    AXES.map(async (axis) => place(homed, axis) - (await panel.position(axis))),
  );
  await panel.disconnect();

  await panel.connectVirtual();
  await panel.drop(sample(FILE));
  await panel.startPrint();
  await expect(panel.job.getByRole('progressbar', { name: 'Print progress' })).toBeVisible();
  await expect(panel.job).toContainText('The print is done.', { timeout: 120_000 });
  await expect(panel.status).toContainText('Ready');

  const record = await panel.record();
  const motors = Object.keys(plan.motors);
  expect(motors.sort()).toEqual(['extruder', 'stepper_x', 'stepper_y', 'stepper_z']);
  const pulses = pulsesOf(record);
  for (const name of motors) {
    const expected = (plan.motors[name]?.steps ?? 0) + (homing[name] ?? 0);
    const spread = name === 'extruder' ? 0 : HOMING_SPREAD;
    expect(Math.abs((pulses[name] ?? 0) - expected), `steps of ${name}`).toBeLessThanOrEqual(spread);
  }

  const ends = endOf(gcode.toString());
  for (const [index, axis] of AXES.entries()) {
    const error = place(record, axis) - (ends[index] ?? Number.NaN) - (beside[index] ?? Number.NaN);
    expect(Math.abs(error), `the end of ${axis}`).toBeLessThan(PLACE_ERROR_MM);
  }
  expect(Math.abs(motor(record, 'extruder').position_mm - plan.filament_mm)).toBeLessThan(PLACE_ERROR_MM);
  expect(record.motors.map(({ lost_steps }) => lost_steps)).toEqual([0, 0, 0, 0]);
  expect(record.shutdown).toBeNull();
});
