// The worker that drives the printer stops in the middle of a print, or hangs: the page says so, lets go of the
// printer, and goes on with a new worker.
import type { Worker } from '@playwright/test';
import { travels } from '../fixtures/gcode.ts';
import { expectLooksAfterItself } from '../fixtures/on_its_own.ts';
import { expect, type SerialPanel, test } from '../fixtures/serial.ts';
import { machineWorker } from '../fixtures/worker.ts';
import { strolling } from '../serial/gcode.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;

/** From now on the planner fails whenever it is asked how things are. */
const breakPlanner = (worker: Worker): Promise<void> =>
  worker.evaluate(() => {
    const parse = JSON.parse;
    JSON.parse = (text: string) => {
      if (text.includes('"temperatures"')) throw new WebAssembly.RuntimeError('unreachable');
      return parse(text) as unknown;
    };
  });

async function expectTold(panel: SerialPanel): Promise<void> {
  await expect(panel.status).toContainText('Not connected');
  await expect(panel.alert).toContainText(
    'The part of the page that drives the printer has stopped. (unreachable)',
  );
  await expect(panel.job).toContainText('The print stopped before its end.');
}

test('with a printer on USB: the port is free again, and connecting works', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(strolling(600));
  await panel.startPrint();
  await breakPlanner(await machineWorker(panel.page));
  await expectTold(panel);
  await expect(panel.alert).toContainText('The printer is on its own');
  await expect.poll(() => port.holder).toBeUndefined();
  await expectLooksAfterItself(printer);
  // The board holds what it had, and the new worker gets through to it.
  await panel.connectOffered();
  await expect(panel.status).toContainText(/Holding a print|Held|Ready/);
  expect(port.counts.openings).toBe(2);
});

test('with the virtual printer: the page does not go on as if it printed', async ({ open }) => {
  const panel = await open();
  await panel.connectVirtual();
  await panel.dropText(travels(3000).gcode);
  await panel.startPrint();
  await breakPlanner(await machineWorker(panel.page));
  await expectTold(panel);
  await expect(panel.alert).toContainText('The virtual printer was a part of the page');
  await panel.connectVirtual();
  await expect(panel.alert).toBeEmpty();
});

test('an error that nobody caught ends the connection, too', async ({ open }) => {
  const panel = await open();
  await panel.connectVirtual();
  const worker = await machineWorker(panel.page);
  await worker.evaluate(() => void Promise.reject(new Error('nobody catches this')));
  await expect(panel.alert).toContainText('has stopped. (nobody catches this)');
  await panel.connectVirtual();
});

test('a worker that hangs: what is shown is marked as old, and disconnecting ends it', async ({ open }) => {
  const panel = await open();
  await panel.connectVirtual();
  await expect(panel.heater('Nozzle')).toContainText('Off');
  const worker = await machineWorker(panel.page);
  await worker.evaluate(() => {
    setTimeout(() => {
      for (;;);
    });
  });
  await expect(panel.status).toContainText('Not responding');
  await expect(panel.heater('Nozzle')).toContainText('Last reading');
  await panel.emergencyStop.click();
  await expect(panel.alert).toContainText('No emergency stop could be sent');
  await expect(panel.alert).toContainText('cut its power');
  await panel.top.getByRole('button', { name: 'Disconnect' }).click();
  await expect(panel.status).toContainText('Not connected');
  await panel.connectVirtual();
});

test('an emergency stop before the board is known is sent as soon as it is', async ({ bridge, open }) => {
  const printer = new PrinterDevice();
  // The session gives a silent board up after seconds of this time: slow enough for the stop to be pressed before.
  const port = bridge.add(printer, { ...FAST, speed: 0.25 });
  const panel = await open();
  port.isMute = true;
  await panel.pickAndConnect(bridge, port);
  await expect(panel.messages).toContainText('asking the board who it is');
  await panel.emergencyStop.click();
  await expect(panel.alert).toContainText('No emergency stop could be sent: the board has not said yet');
  expect(printer.state().shutdown).toBeNull();
  port.isMute = false;
  await expect(panel.status).toContainText('Stopped');
  await expect(panel.alert).toContainText('The emergency stop was asked for.');
  await expect.poll(() => printer.state().shutdown).not.toBeNull();
});
