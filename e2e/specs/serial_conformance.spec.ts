// The double of the Web Serial API behaves as the real one was seen to: what the other specs rest on.
import { expect, type SerialPanel, test } from '../fixtures/serial.ts';
import type { DeviceBridge } from '../serial/bridge.ts';
import { ScriptedDevice } from '../serial/device.ts';
import { installKit, type Kit, type Realm } from '../serial/kit.ts';
import { ROWS } from '../serial/rows.ts';

/** In the realm. */
declare const kit: Kit;

// What is tested here are the tests' own doubles, on whatever thread they run.
test.use({ areTasksJudged: false });

const VENDOR = 0x1209;

async function machineWorker(panel: SerialPanel): Promise<Realm> {
  for (const worker of panel.page.workers())
    if ((await worker.evaluate(() => self.name)) === 'machine') return worker;
  throw new Error('the page has no machine worker');
}

async function goThrough(realm: Realm, bridge: DeviceBridge): Promise<void> {
  await installKit(realm);
  for (const row of ROWS) {
    await test.step(row.name, async () => {
      const device = new ScriptedDevice();
      const id = 1 + bridge.ports.length;
      const port = bridge.add(device, { vendor: VENDOR, product: id, granted: true, ...row.options });
      await row.run({ realm, bridge, port, device, id });
    });
  }
}

test('in a window', async ({ bridge, open }) => {
  const panel = await open();
  await goThrough(panel.page, bridge);
});

test('in a worker', async ({ bridge, open }) => {
  const panel = await open();
  const worker = await machineWorker(panel);
  await goThrough(worker, bridge);
  const has = await worker.evaluate(() => [
    'requestPort' in navigator.serial,
    'getPorts' in navigator.serial,
  ]);
  expect(has).toEqual([false, true]);
});

test('a window asks for ports only after a gesture, and gets what the user chooses', async ({
  bridge,
  context,
  open,
}) => {
  await context.addInitScript(() => {
    const early = navigator.serial.requestPort().then(
      () => 'resolves',
      (error: unknown) => (error instanceof DOMException ? error.name : 'odd'),
    );
    Object.assign(globalThis, { early });
  });
  const port = bridge.add(new ScriptedDevice(), { vendor: VENDOR, product: 7 });
  const { page } = await open();
  await installKit(page);
  expect(await page.evaluate(() => (globalThis as unknown as { early: Promise<string> }).early)).toBe(
    'SecurityError',
  );
  const refused = await page.evaluate(async () => {
    const filters = [{}, { usbProductId: 1 }, { usbVendorId: 1, bluetoothServiceClassId: 2 }];
    return await Promise.all(
      filters.map((filter) => kit.outcome(navigator.serial.requestPort({ filters: [filter] }))),
    );
  });
  expect(refused).toEqual(['TypeError', 'TypeError', 'TypeError']);
  const request = (vendor?: number): Promise<string> =>
    page.evaluate((vendor) => {
      const filters = vendor === undefined ? [] : [{ usbVendorId: vendor }];
      return kit.outcome(navigator.serial.requestPort({ filters }));
    }, vendor);
  bridge.nextAnswer('is not asked');
  expect(await request()).toBe('SecurityError');
  bridge.nextAnswer('cancels');
  expect(await request()).toBe('NotFoundError');
  bridge.nextAnswer(port);
  expect(await request(VENDOR + 1)).toBe('NotFoundError');
  expect(await page.evaluate(async () => (await navigator.serial.getPorts()).length)).toBe(0);
  bridge.nextAnswer(port);
  const isSame = await page.evaluate(async (usbVendorId) => {
    const port = await navigator.serial.requestPort({ filters: [{ usbVendorId }] });
    return (await navigator.serial.getPorts())[0] === port;
  }, VENDOR);
  expect(isSame).toBe(true);
});

test('one port in window and worker: two objects, one opening, known by getInfo() alone', async ({
  bridge,
  open,
}) => {
  const port = bridge.add(new ScriptedDevice(), { vendor: VENDOR, product: 9, granted: true });
  const panel = await open();
  const worker = await machineWorker(panel);
  await installKit(panel.page);
  await installKit(worker);
  const open9 = () => kit.port(9).then((one) => kit.outcome(one.open({ baudRate: 9600 })));
  const info = () => kit.port(9).then((one) => one.getInfo());
  expect(await panel.page.evaluate(info)).toEqual({ usbVendorId: VENDOR, usbProductId: 9 });
  expect(await worker.evaluate(info)).toEqual({ usbVendorId: VENDOR, usbProductId: 9 });
  expect(await worker.evaluate(open9)).toBe('resolves');
  expect(await panel.page.evaluate(open9)).toBe('NetworkError');
  // A page that goes away closes its ports; what the user allowed stays.
  await panel.page.reload();
  await expect.poll(() => port.holder).toBeUndefined();
  await installKit(panel.page);
  expect(await panel.page.evaluate(open9)).toBe('resolves');
});

test('streams do not end when nobody refers to the port', async ({ bridge, open }) => {
  const device = new ScriptedDevice();
  bridge.add(device, { vendor: VENDOR, product: 3, granted: true });
  const { page } = await open();
  await installKit(page);
  await page.evaluate(async () => {
    const port = await kit.port(3);
    await port.open({ baudRate: 9600 });
    kit.kept['got'] = new Promise((resolve) => {
      const writable = new WritableStream<Uint8Array>({ write: (chunk) => resolve(chunk.join()) });
      void port.readable?.pipeTo(writable);
    });
  });
  const session = await page.context().newCDPSession(page);
  await session.send('HeapProfiler.collectGarbage');
  device.say(Uint8Array.of(4, 2));
  expect(await page.evaluate(() => kit.kept['got'])).toBe('4,2');
});
