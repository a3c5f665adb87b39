// Two tabs of one browser: the second one shows what the first one drives, and can stop it, whatever the first one's
// page does. When the first tab goes, the second says so and takes over only when it is told to.

import { expectLooksAfterItself } from '../fixtures/on_its_own.ts';
import { expect, measured, type SerialPanel, test } from '../fixtures/serial.ts';
import { block, clickedAt, stampClick, stopped } from '../fixtures/stops.ts';
import type { Watch } from '../fixtures/watch.ts';
import { strolling } from '../serial/gcode.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const USB = { vendor: 0x1d50, product: 0x614e } as const;
const FAST = { ...USB, shared: true, speed: 50 } as const;
/** From the press to the orders in the board. */
const STOP_MS_MAX = 100;
/** From the end of a tab to the word of it in another one: the browser takes its time to end a tab. */
const GONE_MS_MAX = 1500;

async function printing(panel: SerialPanel, printer: PrinterDevice): Promise<void> {
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(strolling(600), 'stroll.gcode');
  await panel.startPrint();
  await expect.poll(() => printer.state().motors[1]?.position_mm ?? 0).toBeGreaterThan(60);
}

interface Tabs {
  readonly printer: PrinterDevice;
  readonly port: BridgePort;
  readonly first: SerialPanel;
  readonly second: SerialPanel;
}

type Given = Parameters<Parameters<typeof test>[2]>[0];

/** A tab that prints, and another one that is opened then. */
async function twoTabs({ bridge, open }: Pick<Given, 'bridge' | 'open'>): Promise<Tabs> {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const first = await open();
  await first.pickAndConnect(bridge, port);
  await printing(first, printer);
  const second = await open();
  await expect(second.status).toContainText('Viewer: printing');
  return { printer, port, first, second };
}

test('a second tab shows the running print, live, and offers nothing but the emergency stop', async ({
  bridge,
  open,
}) => {
  const { second } = await twoTabs({ bridge, open });
  const card = second.page.getByRole('region', { name: 'Sample machine' });
  await expect(card).toContainText('Another tab of this browser drives this printer');
  await expect(card).toContainText('stroll.gcode');
  const line = second.fact(card, 'Line');
  const before = Number(await line.innerText());
  await expect.poll(async () => Number(await line.innerText())).toBeGreaterThan(before);
  await expect(second.fact(card, 'Nozzle')).toContainText('of 200');
  await expect(card.getByRole('progressbar')).toBeVisible();
  await expect(card.getByRole('button')).toHaveCount(0);
  for (const region of [second.motion, second.temperatures, second.tuning])
    await expect(region).toHaveCount(0);
  await expect(second.emergencyStop).toBeEnabled();
  await expect(second.alert).toBeEmpty();
});

test('the emergency stop of the second tab reaches the board while the first tab’s page is blocked', async ({
  bridge,
  open,
}) => {
  const { first, second, port, printer } = await twoTabs({ bridge, open });
  port.goOnInRealTime();
  await block(first.page, 5000);
  await stampClick(second.page);
  const stop = stopped(port, printer);
  await second.emergencyStop.click();
  const tookMs = (await stop).atMs - (await clickedAt(second.page));
  measured(`click in the other tab to bytes in the board, its page blocked: ${tookMs.toFixed(1)} ms`);
  // Were the first page asked, it would answer after its five seconds.
  expect(tookMs).toBeLessThan(STOP_MS_MAX);
  expect(printer.state().heaters.map(({ duty }) => duty)).toEqual([0, 0]);
  await expect(second.status).toContainText('Viewer: stopped');
  await expect(first.status).toContainText('Stopped');
  await expect(first.alert).toContainText('The emergency stop was asked for');
});

/** Ends the first tab; how long it took until the second one said so, in ms. */
async function toldAfter(
  { first, second }: Tabs,
  end: (panel: SerialPanel) => Promise<unknown>,
): Promise<number> {
  await second.page.evaluate(() => {
    const place = document.querySelector('[role="alert"]');
    const look = new MutationObserver(() => {
      document.documentElement.dataset['toldAt'] = String(performance.timeOrigin + performance.now());
      look.disconnect();
    });
    if (place) look.observe(place, { childList: true, subtree: true });
  });
  const endedAt = performance.timeOrigin + performance.now();
  await end(first);
  await expect(second.alert).toContainText(
    'The tab that drove Sample machine is gone in the middle of a print.',
  );
  return Number(await second.page.locator('html').getAttribute('data-told-at')) - endedAt;
}

test('when the first tab is closed the second one says so at once, and takes over when it is told to', async ({
  bridge,
  open,
}) => {
  const tabs = await twoTabs({ bridge, open });
  const { second, port, printer } = tabs;
  const tookMs = await toldAfter(tabs, (panel) => panel.page.close());
  measured(`tab closed to told in the other: ${tookMs.toFixed(0)} ms`);
  expect(tookMs).toBeLessThan(GONE_MS_MAX);
  await expect(second.alert).toContainText('A print does not start again by itself.');
  await expect(second.status).toContainText('Not connected');
  await expectLooksAfterItself(printer);
  expect(port.counts.openings, 'nothing is opened without a word').toBe(1);
  await second.alert.getByRole('button', { name: 'Connect here' }).click();
  await second.chooseSerialIn(second.dialog('Connect'));
  await second.connectIn(second.dialog('Connect'));
  await expect(second.status).toContainText(/Holding a print|Held|Ready/);
  expect(port.counts.openings).toBe(2);
});

test('when the first tab crashes the second one says so at once', async ({ bridge, open, watch }) => {
  const tabs = await twoTabs({ bridge, open });
  (watch as Watch).expectError(/the page crashed/);
  const tookMs = await toldAfter(tabs, async ({ page }) => {
    const session = await page.context().newCDPSession(page);
    void session.send('Page.crash').catch(() => undefined);
  });
  measured(`tab crashed to told in the other: ${tookMs.toFixed(0)} ms`);
  expect(tookMs).toBeLessThan(GONE_MS_MAX);
});

test('disconnecting in order is no alarm; a tab with a printer of its own shows only that', async ({
  bridge,
  open,
}) => {
  const port = bridge.add(new PrinterDevice(), FAST);
  const first = await open();
  await first.pickAndConnect(bridge, port);
  await expect(first.status).toContainText('Ready');
  const second = await open();
  await expect(second.status).toContainText('Viewer: ready');
  await second.connectVirtual();
  await expect(second.motion).toBeVisible();
  await expect(second.page.getByText('Another tab of this browser')).toHaveCount(0);
  await expect(first.status).toContainText('Ready');
  await second.top.getByRole('button', { name: 'Disconnect' }).click();
  await expect(second.status).toContainText('Viewer: ready');
  await first.disconnect();
  await expect(second.status).toContainText('Not connected');
  await expect(first.alert).toBeEmpty();
  await expect(second.alert).toBeEmpty();
  await expect(second.messages).toContainText('Sample machine: disconnected in its tab.');
});
