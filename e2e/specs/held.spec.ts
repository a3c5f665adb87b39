// The worker that drives the printer stands still longer than the board waits for its host: the head comes to rest on
// its path, the page says so, and only the user's word goes on or ends it.
import { made, plannedBehind } from '../fixtures/pulses.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { stall } from '../fixtures/worker.ts';
import { strolling } from '../serial/gcode.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;
/** The host counts as alive for two seconds after its last word. */
const STALL_MS = 4000;
const pulses = (printer: PrinterDevice): number[] => printer.state().motors.map((motor) => motor.pulses);

interface Held {
  readonly printer: PrinterDevice;
  readonly port: BridgePort;
  readonly panel: SerialPanel;
}

type Given = Parameters<Parameters<typeof test>[2]>[0];

/** A print, cold so that no heater has its say, that the board holds. */
async function held({ bridge, open }: Pick<Given, 'bridge' | 'open'>, gcode: string): Promise<Held> {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(gcode);
  await panel.startPrint();
  // Looked at often: at this speed the whole print takes less than a second.
  await expect
    .poll(() => printer.state().motors[1]?.position_mm ?? 0, { intervals: [20] })
    .toBeGreaterThan(60);
  port.goOnInRealTime();
  await stall(panel.page, STALL_MS);
  await expect(panel.status).toContainText('Held');
  await expect(panel.alert).toContainText('The computer did not reach the printer in time');
  await expect(panel.job).toContainText('Held: the head rests on its path, with no step lost.');
  const still = pulses(printer);
  const since = printer.now();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(1);
  expect(pulses(printer), 'nothing goes on by itself').toEqual(still);
  expect(printer.state().shutdown).toBeNull();
  return { printer, port, panel };
}

test('held, then resumed: every step of the plan is made, and none besides', async ({ bridge, open }) => {
  test.setTimeout(120_000);
  const gcode = strolling(30, true);
  const { panel, printer } = await held({ bridge, open }, gcode);
  await panel.job.getByRole('button', { name: 'Resume' }).click();
  await expect(panel.status).toContainText('Printing');
  await expect(panel.alert).toBeEmpty();
  await expect(panel.job).toContainText('The print is done.', { timeout: 60_000 });
  await expect.poll(() => made(printer)).toEqual(plannedBehind(gcode, 'G4'));
  const { motors, shutdown } = printer.state();
  expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  measured(`pulses as planned: ${made(printer).join(', ')}`);
});

test('held, then cancelled: the print ends where it rests', async ({ bridge, open }) => {
  const { panel, printer } = await held({ bridge, open }, strolling(600, true));
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
  await expect(panel.status).toContainText('Ready');
  const still = pulses(printer);
  const since = printer.now();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(1);
  expect(pulses(printer)).toEqual(still);
  expect(printer.state().motors.map((motor) => motor.lost_steps)).toEqual([0, 0, 0, 0]);
});
