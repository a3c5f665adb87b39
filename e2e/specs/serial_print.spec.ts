// Prints on a printer on USB through the page, judged by the device's own record.
import { expect, type SerialPanel, test } from '../fixtures/serial.ts';
import { endOf, slice, strolling, upTo } from '../serial/gcode.ts';
import { planned } from '../serial/planner.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

/** At most so much faster than real; where the computer is slower, both clocks wait. */
const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 100 } as const;
const PRINT_TIMEOUT_MS = 100_000;
/** The nozzle takes longer than this to get warm, and nothing else stands still so long. */
const REST_MIN_S = 5;
/** Switches close a step or two from where they should. */
const HOMING_ERROR_MM = 0.05;

/** The pulses made before the print proper: at the end of the last long rest before any filament moved. */
function pulsesBeforePrint(printer: PrinterDevice): readonly number[] {
  const still = printer.samples.filter(({ pulses }) => pulses[3] === 0 && (pulses[2] ?? 0) > 0);
  const rests = still.filter(({ timeS, pulses }) => {
    const before = still.find((other) => other.pulses.every((count, motor) => count === pulses[motor]));
    return before !== undefined && timeS - before.timeS >= REST_MIN_S;
  });
  const last = rests.at(-1);
  if (!last) throw new Error('the device never waited for the nozzle');
  return last.pulses;
}

async function printAll(panel: SerialPanel, gcode: string): Promise<void> {
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(gcode);
  await panel.startPrint();
  await expect(panel.job).toContainText('The print is done.', { timeout: PRINT_TIMEOUT_MS });
}

/** The device made every planned step and stands where the file ends, cold and still. */
async function expectPrinted(printer: PrinterDevice, gcode: string): Promise<void> {
  await expect.poll(() => printer.state().motors.every((motor) => !motor.energised)).toBe(true);
  const state = printer.state();
  const before = pulsesBeforePrint(printer);
  const made = state.motors.map((motor, index) => motor.pulses - (before[index] ?? 0));
  const start = planned(upTo(gcode, 'M109')).steps;
  expect(made).toEqual(planned(gcode).steps.map((steps, index) => steps - (start[index] ?? 0)));
  expect(state.motors.map((motor) => motor.lost_steps)).toEqual([0, 0, 0, 0]);
  endOf(gcode).forEach((end, axis) => {
    expect(Math.abs((state.motors[axis]?.position_mm ?? Number.NaN) - end)).toBeLessThan(HOMING_ERROR_MM);
  });
  expect(state.heaters.map((heater) => heater.duty)).toEqual([0, 0]);
  expect(state.shutdown).toBeNull();
}

const report = (printer: PrinterDevice, port: BridgePort, sinceMs: number): void => {
  const real = (performance.now() - sinceMs) / 1000;
  test.info().annotations.push({
    type: 'measured',
    description: `${printer.now().toFixed(0)} s of the device in ${real.toFixed(1)} s, ${JSON.stringify(port.counts)}`,
  });
};

test('prints the first layers of a real slice to the end', async ({ bridge, open }) => {
  test.setTimeout(PRINT_TIMEOUT_MS + 30_000);
  const gcode = slice(1);
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  const began = performance.now();
  await panel.pickAndConnect(bridge, port);
  await printAll(panel, gcode);
  await expectPrinted(printer, gcode);
  report(printer, port, began);
});

test('a noisy line loses no step', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.home();
  // After homing the axes come to rest where the switches closed.
  await expect.poll(() => printer.hasRestedFor(1)).toBe(true);
  const before = printer.state().motors.map((motor) => motor.pulses);
  port.framingErrorEvery = 499;
  port.corruptShare = 1 / 1000;
  const gcode = strolling(30, { homes: false });
  await printAll(panel, gcode);
  await expect.poll(() => printer.hasRestedFor(1)).toBe(true);
  const { motors, shutdown } = printer.state();
  const made = motors.map((motor, index) => motor.pulses - (before[index] ?? 0));
  expect(made).toEqual(planned(`G28\n${gcode}`).steps);
  expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  expect(port.counts.damaged).toBeGreaterThan(20);
});
