// What goes wrong on the line and in the computer while it prints: what repairs itself is counted and not in the way,
// what does not is said with the way on.
import { made, plannedBehind } from '../fixtures/pulses.ts';
import { expect, type SerialPanel, test } from '../fixtures/serial.ts';
import { stall } from '../fixtures/worker.ts';
import { sectionOf } from '../pages/record.ts';
import { strolling } from '../serial/gcode.ts';
import type { StreamErrorName } from '../serial/messages.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;

async function startPrint(panel: SerialPanel, printer: PrinterDevice, gcode: string): Promise<void> {
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(gcode);
  await panel.startPrint();
  await expect.poll(() => printer.state().motors[1]?.position_mm ?? 0).toBeGreaterThan(60);
}

const LINE_ERRORS: readonly (readonly [StreamErrorName, string])[] = [
  ['BreakError', 'break'],
  ['FramingError', 'framing error'],
  ['ParityError', 'parity error'],
  ['BufferOverrunError', 'overrun'],
  ['UnknownError', 'error of the system'],
];

test('each error class of the line is recovered from while printing: a count in the log, no step lost', async ({
  bridge,
  open,
}) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  const gcode = strolling(60);
  await startPrint(panel, printer, gcode);
  for (const [name] of LINE_ERRORS) {
    const before = port.counts.toHost;
    port.lineError(name);
    // The page reads on behind it.
    await expect.poll(() => port.counts.toHost).toBeGreaterThan(before + 50);
    await expect(panel.alert).toBeEmpty();
  }
  await expect(panel.job).toContainText('The print is done.');
  await expect.poll(() => made(printer)).toEqual(plannedBehind(gcode, 'G4'));
  expect(printer.state().motors.map((motor) => motor.lost_steps)).toEqual([0, 0, 0, 0]);
  await expect(panel.alert).toBeEmpty();
  await expect(panel.messages).toContainText(/On the line so far: .*What was lost was sent again\./);
  const counts = JSON.parse(sectionOf(await panel.report(), 'Machine now')) as {
    link: { lineErrors: Record<string, number> };
  };
  expect(counts.link.lineErrors).toEqual({ break: 1, framing: 1, parity: 1, overrun: 1, system: 1 });
});

for (const isTerminal of [false, true]) {
  const what = isTerminal ? 'a terminal that hung up' : 'an unplugged printer';
  test(`${what}: what it means is said, and one press reconnects once it is there again`, async ({
    bridge,
    open,
  }) => {
    const printer = new PrinterDevice();
    const port = bridge.add(printer, { ...FAST, isTerminal });
    const panel = await open();
    await panel.pickAndConnect(bridge, port);
    await startPrint(panel, printer, strolling(600));
    bridge.unplug(port);
    await expect(panel.alert).toContainText('The printer was unplugged, or its board switched off.');
    await expect(panel.alert).toContainText('a print does not start again by itself');
    await expect(panel.job).toContainText('The print stopped before its end.');
    const reconnect = panel.alert.getByRole('button', { name: 'Reconnect' });
    // The port of a terminal stays where it is.
    if (!isTerminal) await expect(reconnect).toHaveCount(0);
    bridge.replug(port);
    await expect(panel.alert).toContainText('The device is there again.');
    expect(port.counts.openings).toBe(1);
    await reconnect.click();
    await expect(panel.status).toContainText(/Holding a print|Held|Ready/);
    expect(port.counts.openings).toBe(2);
  });
}

test('of two devices alike none is taken for the one that was lost', async ({ bridge, open }) => {
  const [first, second] = [
    bridge.add(new PrinterDevice(), FAST),
    bridge.add(new PrinterDevice(), { ...FAST, granted: true }),
  ];
  const panel = await open();
  await panel.pickAndConnect(bridge, first);
  await expect(panel.status).toContainText('Ready');
  bridge.unplug(first);
  await expect(panel.alert).toContainText('unplugged');
  bridge.replug(first);
  await expect
    .poll(() => panel.page.evaluate(async () => (await navigator.serial.getPorts()).length))
    .toBe(2);
  await expect(panel.alert.getByRole('button', { name: 'Reconnect' })).toHaveCount(0);
  expect(second.counts.openings).toBe(0);
});

test('a stall of the worker is told quietly, with its length, and stands in the report', async ({ open }) => {
  const panel = await open();
  const notices = panel.page.getByRole('status', { name: 'Notices' });
  await panel.connectVirtual('Real time');
  await expect(panel.heater('Nozzle')).toContainText('Off');
  await expect(notices).toBeEmpty();
  await stall(panel.page, 1600);
  await expect(notices).toContainText(/What drives the printer was held up for 1\.[4-9] s at \d\d:\d\d:\d\d/);
  await expect(panel.alert).toBeEmpty();
  await stall(panel.page, 2600);
  await expect(notices).toContainText('So far 2 times');
  await expect(notices.getByRole('listitem')).toHaveCount(1);
  await expect(panel.messages).toContainText('held up for 1.');
  await expect(panel.messages).toContainText('held up for 2.');
  const { count, kept } = JSON.parse(sectionOf(await panel.report(), 'Stalls')) as {
    count: number;
    kept: { seconds: number; isPrinting: boolean }[];
  };
  expect([count, ...kept.map(({ seconds }) => Math.floor(seconds))]).toEqual([2, 1, 2]);
  await notices.getByRole('button', { name: 'Put this notice away' }).click();
  await expect(notices).toBeEmpty();
});
