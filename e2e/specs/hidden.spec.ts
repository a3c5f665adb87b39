// A hidden page with its timers throttled as far as Chromium goes, while another tab burns the processor: the board
// never runs short of motion. In a browser as people have it; Playwright's own keeps pages visible.
//
// STEPCAST_HIDDEN_S makes it longer. Chromium throttles a page in two steps: timers come once a second from the start, and
// once a minute after five minutes (and for a few seconds whenever the title changes); only a run of more than that sees the
// second.

import { MainThread } from '../fixtures/main_thread.ts';
import { type PlainBrowser, type Tab, Wire, withPlainBrowser } from '../fixtures/plain_browser.ts';
import { expect, measured, SerialPanel, test } from '../fixtures/serial.ts';
import { judgeTasks } from '../fixtures/test.ts';
import type { View } from '../fixtures/views.ts';
import { strolling } from '../serial/gcode.ts';
import type { BridgePort } from '../serial/port.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;
const HIDDEN_S = Number(process.env['STEPCAST_HIDDEN_S'] ?? 30);
/** Timers of a hidden page come once a second; after so long in the background once a minute. */
const GRACE_S = 310;
/** So long that a percent of it, which the title shows, takes a minute: a page that changes its title is throttled less. */
const PRINT_S = 6000;
/** Motion on the board at least, in s. */
const QUEUED_MIN_S = 0.5;

interface Probe {
  /** When a timer of a tenth of a second came, in ms. */
  readonly ticks: number[];
  readonly views: View[];
}

/** Notes the page's timers and what the worker tells other tabs. */
function probe(): void {
  const found: Probe = { ticks: [], views: [] };
  setInterval(() => found.ticks.push(performance.now()), 100);
  const channel = new BroadcastChannel('stepcast-machines-1');
  channel.onmessage = ({ data }) => {
    if (data.kind === 'view') found.views.push({ at: performance.now(), snapshot: data.view.snapshot });
  };
  Object.assign(globalThis, { probe: found, channel });
}

/** Two threads that do nothing but burn. */
function burn(): void {
  const code = URL.createObjectURL(new Blob(['for (;;);'], { type: 'text/javascript' }));
  const worker = new Worker(code);
  const turn = (): void => {
    const until = performance.now() + 90;
    while (performance.now() < until);
    setTimeout(turn);
  };
  turn();
  Object.assign(globalThis, { worker });
}

const isHidden = (tab: Tab): Promise<string> => tab.evaluate(() => document.visibilityState);

/** Until so much of the device's time has passed. */
async function passes(printer: PrinterDevice, seconds: number): Promise<void> {
  const since = printer.now();
  await expect
    .poll(() => printer.now() - since, { timeout: seconds * 2000 + 20_000 })
    .toBeGreaterThan(seconds);
}

async function startPrint(
  browser: PlainBrowser,
  url: string,
  double: string,
  printer: PrinterDevice,
): Promise<void> {
  await browser.withPlaywright(async (context) => {
    await context.addInitScript({ content: double });
    const panel = new SerialPanel(await context.newPage());
    await panel.page.goto(url);
    await panel.connectOffered();
    await expect(panel.status).toContainText('Ready');
    await panel.dropText(strolling(PRINT_S));
    await panel.startPrint();
    await expect.poll(() => printer.state().motors[1]?.position_mm ?? 0).toBeGreaterThan(60);
  });
}

function judge({ ticks, views }: Probe, hiddenAt: number): void {
  const during = views.filter(({ at }) => at > hiddenAt);
  const queued = during.map(({ snapshot }) => snapshot.queued ?? 0);
  const late = during.at(-1)?.snapshot.wakeUps;
  const after = (seconds: number): number => ticks.filter((at) => at > hiddenAt + seconds * 1000).length;
  const seconds = ((during.at(-1)?.at ?? 0) - hiddenAt) / 1000;
  measured(`hidden for ${seconds.toFixed(0)} s; the page's timers of 0.1 s came ${after(0)} times`);
  if (seconds > GRACE_S)
    measured(`of these ${after(GRACE_S)} in the last ${(seconds - GRACE_S).toFixed(0)} s`);
  measured(`queued on the board: at least ${Math.min(...queued).toFixed(2)} s (${queued.length} looks)`);
  measured(
    `worker's timers: ${late?.missed} missed by a second, the latest by ${((late?.latest ?? 0) * 1000).toFixed(0)} ms`,
  );
  expect(queued.length).toBeGreaterThan(HIDDEN_S);
  expect(new Set(during.map(({ snapshot }) => snapshot.job))).toEqual(new Set(['printing']));
  expect(Math.min(...queued)).toBeGreaterThan(QUEUED_MIN_S);
  // Else nothing was throttled, and nothing is proved.
  expect(after(2)).toBeLessThan(seconds * 1.2);
  if (seconds > GRACE_S) expect(after(GRACE_S)).toBeLessThan((seconds - GRACE_S) / 5);
}

async function hide(wire: Wire, url: string, port: BridgePort, printer: PrinterDevice): Promise<void> {
  const page = await wire.attach(url);
  await page.evaluate(probe);
  port.goOnInRealTime();
  await passes(printer, 1);
  const { targetId } = await wire.send('Target.createTarget', { url: 'about:blank' });
  await wire.send('Target.activateTarget', { targetId });
  await expect.poll(() => isHidden(page)).toBe('hidden');
  const hiddenAt = await page.evaluate(() => performance.now());
  const other = await wire.attachTo(String(targetId));
  await other.evaluate(burn);
  await passes(printer, HIDDEN_S);
  judge(await page.evaluate(() => (globalThis as unknown as { probe: Probe }).probe), hiddenAt);
  expect(await isHidden(page)).toBe('hidden');
}

test('hidden and throttled while another tab burns the processor: 0 underruns, 0 holds', async ({
  bridge,
  site,
  double,
}) => {
  test.setTimeout(90_000 + HIDDEN_S * 2000);
  const printer = new PrinterDevice();
  const port = bridge.add(printer, { ...FAST, granted: true });
  // Nobody looks at the view, and drawing it in software takes what the test needs.
  await withPlainBrowser(['--disable-3d-apis'], async (browser) => {
    const wire = await Wire.open(browser.url);
    try {
      const mainThread = await MainThread.watchOver(wire, site.url);
      await startPrint(browser, site.url, double, printer);
      await hide(wire, site.url, port, printer);
      await judgeTasks(mainThread, test.info().annotations);
    } finally {
      wire.close();
    }
    const { motors, shutdown } = printer.state();
    expect([shutdown, ...motors.map((motor) => motor.lost_steps)]).toEqual([null, 0, 0, 0, 0]);
  });
});
