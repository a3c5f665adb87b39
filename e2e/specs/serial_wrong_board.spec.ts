// What answers wrongly is told apart, each with what to do next.
import { expect, test } from '../fixtures/serial.ts';
import {
  bootloaderBoard,
  gpsReceiver,
  greetingBootloader,
  marlinBoard,
  silentBoard,
} from '../serial/boards.ts';
import type { Device } from '../serial/device.ts';
import { PrinterDevice } from '../serial/printer.ts';

interface Case {
  readonly name: string;
  readonly device: () => Device;
  readonly happened: RegExp;
  readonly todo: RegExp;
}

const CASES: readonly Case[] = [
  {
    name: 'a silent board',
    device: silentBoard,
    happened: /does not answer/,
    todo: /power.*port.*baud rate/,
  },
  {
    name: 'Marlin',
    device: marlinBoard,
    happened: /answers in text, as Marlin/,
    todo: /Flash .*Klipper/,
  },
  {
    name: 'a bootloader that waits for a file',
    device: bootloaderBoard,
    happened: /bootloader answers/,
    todo: /Flash .*reset button/,
  },
  {
    name: 'a bootloader that greets',
    device: greetingBootloader,
    happened: /bootloader answers/,
    todo: /Flash .*reset button/,
  },
  {
    name: 'another device',
    device: gpsReceiver,
    happened: /text that this page does not know/,
    todo: /printer’s port/,
  },
  {
    name: 'the wrong baud rate',
    device: () => new PrinterDevice({ baudRate: 115_200 }),
    happened: /nothing that can be read/,
    todo: /baud rate.*250000.*115200/,
  },
];

test('what answers wrongly is told apart', async ({ bridge, open }) => {
  test.setTimeout(120_000);
  const panel = await open();
  for (const { name, device, happened, todo } of CASES) {
    await test.step(name, async () => {
      const port = bridge.add(device(), { vendor: 0x1a86, product: 0x7523, shared: true, speed: 100 });
      await panel.pickAndConnect(bridge, port, 250_000);
      await expect(panel.alert).toContainText(happened);
      await expect(panel.alert).toContainText(todo);
      await expect(panel.alert).toContainText('did not move and no heater was switched on');
      expect(port.baudRates).toEqual([250_000]);
      // Nothing is left open: the next try starts anew.
      await panel.disconnect();
      expect(port.holder).toBeUndefined();
    });
  }
});

test('the right baud rate after the wrong one connects', async ({ bridge, open }) => {
  const port = bridge.add(new PrinterDevice({ baudRate: 115_200 }), { shared: true, speed: 100 });
  const panel = await open();
  await panel.pickAndConnect(bridge, port, 250_000);
  await expect(panel.alert).toContainText('baud rate');
  await panel.disconnect();
  const dialog = await panel.chooseSerial();
  await dialog.getByRole('textbox', { name: 'Baud rate' }).fill('115200');
  await panel.connectIn(dialog);
  await expect(panel.status).toContainText('Ready');
  expect(port.baudRates).toEqual([250_000, 115_200]);
});
