// A port that is not given, not there, not free, or goes away: what the page says, and what the printer does meanwhile.

import { expectLooksAfterItself } from '../fixtures/on_its_own.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { clickedAt, stampClick, stopped } from '../fixtures/stops.ts';
import type { DeviceBridge } from '../serial/bridge.ts';
import { strolling } from '../serial/gcode.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const USB = { vendor: 0x1d50, product: 0x614e } as const;
/** At most so much faster than real; where the computer is slower, both clocks wait. */
const FAST = { ...USB, shared: true, speed: 50 } as const;
/** The click and its way through page, worker and port; the rest is the computer's other work. */
const STOP_MS_MAX = 500;

const pulses = (printer: PrinterDevice): number[] => printer.state().motors.map((motor) => motor.pulses);
const duties = (printer: PrinterDevice): number[] => printer.state().heaters.map((heater) => heater.duty);

/** Prints a long file; returns when the head moves and the heaters are on. */
async function startPrint(panel: SerialPanel, printer: PrinterDevice, seconds = 600): Promise<void> {
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(strolling(seconds));
  await panel.startPrint();
  // Beyond homing: all axes are at rest there in between, and 100 mm are 8000 steps.
  await expect.poll(() => printer.state().motors[1]?.position_mm ?? 0).toBeGreaterThan(60);
  expect(Math.max(...duties(printer))).toBeGreaterThan(0);
}

async function expectOffered(panel: SerialPanel, port: BridgePort, openings: number): Promise<void> {
  const dialog = await panel.chooseSerial();
  await expect(dialog.getByRole('radio', { name: /1d50:614e/ })).toBeChecked();
  expect([port.counts.openings, port.holder]).toEqual([openings, undefined]);
  await panel.closeDialog(dialog);
}

test('a refused permission and an empty choice say what to do', async ({ bridge, open }) => {
  const panel = await open();
  const dialog = await panel.chooseSerial();
  const choose = dialog.getByRole('button', { name: 'Choose a port' });
  bridge.nextAnswer('is not asked');
  await choose.click();
  await expect(dialog.getByRole('status')).toContainText('does not allow this page to use serial ports');
  bridge.nextAnswer('cancels');
  await choose.click();
  await expect(dialog.getByRole('status')).toContainText('No port was chosen.');
  await expect(dialog.getByRole('status')).toContainText('does the cable carry data?');
  await expect(dialog.getByRole('button', { name: 'Connect', exact: true })).toBeDisabled();
  await expect(dialog).toContainText('Choose a port first.');
});

test('a port that another program holds', async ({ bridge, open }) => {
  const port = bridge.add(new PrinterDevice(), FAST);
  const panel = await open();
  port.isHeldElsewhere = true;
  await panel.pickAndConnect(bridge, port);
  await expect(panel.alert).toContainText('The port could not be opened.');
  await expect(panel.alert).toContainText(/Another program or another tab .*close slicers/);
  await expect(panel.status).toContainText('Not connected');
  port.isHeldElsewhere = false;
  await panel.connectOffered();
  await expect(panel.status).toContainText('Ready');
});

test('of two boards alike, the one that is chosen is opened, whichever is unplugged before', async ({
  bridge,
  open,
}) => {
  const [first, second] = [bridge.add(new PrinterDevice(), FAST), bridge.add(new PrinterDevice(), FAST)];
  const panel = await open();
  const dialog = await panel.chooseSerial();
  for (const port of [second, first]) {
    bridge.nextAnswer(port);
    await dialog.getByRole('button', { name: /^Choose (a|another) port$/ }).click();
  }
  const choices = dialog.getByRole('radio', { name: /1d50:614e/ });
  await expect(choices).toHaveCount(2);
  await expect(choices.first()).toBeChecked();
  // What was chosen goes away: the other one is not taken unasked.
  bridge.unplug(first);
  await expect(choices).toHaveCount(1);
  await expect(choices).not.toBeChecked();
  await expect(dialog.getByRole('status')).toContainText('no longer there');
  await expect(dialog.getByRole('button', { name: 'Connect', exact: true })).toBeDisabled();
  // What is chosen stays so when its place in the list changes.
  bridge.replug(first);
  await expect(choices).toHaveCount(2);
  await choices.nth(1).check();
  bridge.unplug(first);
  await expect(choices).toHaveCount(1);
  await expect(choices).toBeChecked();
  await panel.connectIn(dialog);
  await expect(panel.status).toContainText('Ready');
  expect([first.counts.openings, second.counts.openings]).toEqual([0, 1]);
});

async function unplugWhilePrinting(
  panel: SerialPanel,
  bridge: DeviceBridge,
  port: BridgePort,
  printer: PrinterDevice,
): Promise<void> {
  await panel.pickAndConnect(bridge, port);
  await startPrint(panel, printer);
  bridge.unplug(port);
  await expect(panel.alert).toContainText('The printer was unplugged, or its board switched off.');
  await expect(panel.alert).toContainText('does not start again by itself');
  await expect(panel.alert).toContainText(/heaters off within 5 seconds/);
  await expect(panel.status).toContainText('Not connected');
  await expect(panel.job).toContainText('The print stopped before its end.');
  await expectLooksAfterItself(printer);
}

test('unplugged while printing: the board comes to rest by itself, and nothing starts again by itself', async ({
  bridge,
  open,
}) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await unplugWhilePrinting(panel, bridge, port, printer);
  const still = pulses(printer);
  bridge.replug(port);
  await expectOffered(panel, port, 1);
  await panel.connectOffered();
  // The board holds the print, which is found again and still waits for the user.
  await expect(panel.status).toContainText('Held');
  expect(pulses(printer)).toEqual(still);
});

test('a terminal that hangs up without a word is lost too', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, { ...FAST, isTerminal: true });
  const panel = await open();
  await unplugWhilePrinting(panel, bridge, port, printer);
});

test('a board that dies in the middle of a block', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  // A block is five bytes at least.
  printer.dieAfter(1003);
  await expect(panel.alert).toContainText('The connection to the printer broke.');
  await expect(panel.alert).toContainText(/Check cable and power, connect again, and home/);
  await expect(panel.status).toContainText('Failed');
});

test('a board that takes no more bytes can still be disconnected', async ({ bridge, open }) => {
  const port = bridge.add(new PrinterDevice(), FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  port.holdBack(true);
  await panel.disconnect();
  await expect.poll(() => port.holder).toBeUndefined();
  port.holdBack(false);
  await panel.connectOffered();
  await expect(panel.status).toContainText('Ready');
});

test('a second tab is refused the printer, and the first prints on', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  // As root, Linux lets two programs open one terminal: the page must not rely on it.
  const port = bridge.add(printer, { ...FAST, isExclusive: false });
  const first = await open();
  await first.pickAndConnect(bridge, port);
  await startPrint(first, printer);
  const second = await open();
  await second.connectOffered();
  await expect(second.alert).toContainText('Another tab of this browser is connected to this printer.');
  await expect(second.alert).toContainText('Go on in that tab, or disconnect there first.');
  await expect(second.status).toContainText('Viewer: printing');
  const before = pulses(printer)[0] ?? 0;
  await expect.poll(() => pulses(printer)[0]).toBeGreaterThan(before + 8000);
  await expect(first.status).toContainText('Printing');
  expect(port.counts.openings).toBe(1);
});

test('after a reload the port is offered, not driven; connecting again works', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.page.reload();
  await expect(panel.status).toContainText('Not connected');
  await expect.poll(() => port.holder).toBeUndefined();
  await expectOffered(panel, port, 1);
  await panel.connectOffered();
  await expect(panel.status).toContainText('Ready');
  expect(port.counts.openings).toBe(2);
});

test('errors of the system on reading and writing are survived', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  for (let round = 0; round < 5; round += 1) {
    const before = port.counts.toHost;
    port.lineError('UnknownError');
    port.writeError();
    port.lineError('BufferOverrunError');
    await expect.poll(() => port.counts.toHost).toBeGreaterThan(before + 100);
  }
  await expect(panel.status).toContainText('Ready');
  await expect(panel.alert).toBeEmpty();
});

test('the emergency stop reaches the board at once', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  port.goOnInRealTime();
  await panel.send('M104 S200');
  await expect.poll(() => Math.max(...duties(printer))).toBeGreaterThan(0);
  await stampClick(panel.page);
  const stop = stopped(port, printer);
  await panel.emergencyStop.click();
  const tookMs = (await stop).atMs - (await clickedAt(panel.page));
  measured(`click to bytes: ${tookMs.toFixed(1)} ms`);
  expect(tookMs).toBeGreaterThan(0);
  expect(tookMs).toBeLessThan(STOP_MS_MAX);
  expect(duties(printer)).toEqual([0, 0]);
  await expect(panel.alert).toContainText('The emergency stop was asked for');
  await expect(panel.status).toContainText('Stopped');
});
