// Prints on a printer on USB through the page, judged by the device's own record.
import { made, plannedBehind } from '../fixtures/pulses.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { endOf, slice, strolling } from '../serial/gcode.ts';
import { PrinterDevice } from '../serial/printer.ts';

/** At most so much faster than real; where the computer is slower, both clocks wait. */
const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 100 } as const;
const PRINT_TIMEOUT_MS = 100_000;
/** Switches close a step or two from where they should. */
const HOMING_ERROR_MM = 0.05;

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
  expect(made(printer)).toEqual(plannedBehind(gcode, 'M109'));
  expect(state.motors.map((motor) => motor.lost_steps)).toEqual([0, 0, 0, 0]);
  endOf(gcode).forEach((end, axis) => {
    expect(Math.abs((state.motors[axis]?.position_mm ?? Number.NaN) - end)).toBeLessThan(HOMING_ERROR_MM);
  });
  expect(state.heaters.map((heater) => heater.duty)).toEqual([0, 0]);
  expect(state.shutdown).toBeNull();
}

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
  const tookS = (performance.now() - began) / 1000;
  measured(`${printer.now().toFixed(0)} s of the device in ${tookS.toFixed(1)} s`);
});

test('a noisy line loses no step', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  port.framingErrorEvery = 499;
  port.corruptShare = 1 / 1000;
  const gcode = strolling(30);
  await printAll(panel, gcode);
  await expect.poll(() => made(printer)).toEqual(plannedBehind(gcode, 'G4'));
  const { motors, shutdown } = printer.state();
  expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  measured(`${port.counts.damaged} damaged bytes, ${port.counts.toDevice + port.counts.toHost} in all`);
  expect(port.counts.damaged).toBeGreaterThan(20);
});
