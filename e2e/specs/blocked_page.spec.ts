// The page's main thread does nothing for seconds: the print goes on, and a stop that is pressed meanwhile is not lost.
import { expect, measured, test } from '../fixtures/serial.ts';
import { block, blockEndedAt, clickedAt, pressBlindly, stampClick, stopped } from '../fixtures/stops.ts';
import { type View, Views } from '../fixtures/views.ts';
import { strolling } from '../serial/gcode.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;
const BLOCK_MS = 5000;
/** From the end of the block to the orders in the board. */
const STOP_MS_MAX = 100;
/** What may be under way to the board already, which nothing can overtake: the link's window. */
const BYTES_AHEAD_MAX = 1024;
/** Motion on the board at least, in s. */
const QUEUED_MIN_S = 1;
/** Half a second of these moves, corners included, is at least this part of the mean of all. */
const PULSES_SHARE_MIN = 0.7;

/** Pulses of X and Y in each half second of the board's time after `since`. */
function pace(printer: PrinterDevice, since: number): number[] {
  const seen = printer.samples.filter(({ timeS }) => timeS >= since);
  return seen.slice(1).map(({ pulses }, at) => {
    const before = seen[at]?.pulses ?? [];
    return [0, 1].reduce((sum, motor) => sum + (pulses[motor] ?? 0) - (before[motor] ?? 0), 0);
  });
}

test('the main thread blocked for 5 s: the stream goes on, and a stop pressed meanwhile comes through', async ({
  bridge,
  open,
  context,
  site,
}) => {
  const printer = new PrinterDevice();
  const port = bridge.add(printer, FAST);
  const panel = await open();
  const views = await Views.open(context, site.url);
  await panel.page.bringToFront();
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  await panel.dropText(strolling(600));
  await panel.startPrint();
  await expect.poll(() => printer.state().motors[1]?.position_mm ?? 0).toBeGreaterThan(60);
  port.goOnInRealTime();

  const since = printer.now();
  const press = await pressBlindly(panel.page, panel.emergencyStop);
  await stampClick(panel.page);
  const stop = stopped(port, printer);
  const blockedAt = performance.timeOrigin + performance.now();
  await block(panel.page, BLOCK_MS);
  await expect.poll(() => printer.now() - since).toBeGreaterThan(2);
  const pressed = press();
  await expect.poll(() => printer.now() - since).toBeGreaterThan(4);
  expect(printer.state().shutdown, 'the page does not even know of the press yet').toBeNull();
  const { atMs, bytesSince } = await stop;
  await pressed;

  const endedAt = await blockEndedAt(panel.page);
  measured(`pressed ${(endedAt - (await clickedAt(panel.page))).toFixed(0)} ms before the block's end`);
  measured(`end of the block to bytes in the board: ${(atMs - endedAt).toFixed(1)} ms`);
  measured(`bytes to the board from then on, the stop's own included: ${bytesSince(endedAt)}`);
  expect(endedAt - (await clickedAt(panel.page))).toBeGreaterThan(1000);
  expect(atMs).toBeGreaterThan(endedAt);
  expect(atMs - endedAt).toBeLessThan(STOP_MS_MAX);
  expect(bytesSince(endedAt)).toBeLessThan(BYTES_AHEAD_MAX);
  await expect(panel.status).toContainText('Stopped');

  const during = (await views.heard()).filter(({ at }: View) => at > blockedAt && at < endedAt);
  const queued = during.map(({ snapshot }) => snapshot.queued ?? 0);
  const inBlock = pace(printer, since).slice(0, 2 * (BLOCK_MS / 1000) - 1);
  const mean = inBlock.reduce((sum, pulses) => sum + pulses, 0) / inBlock.length;
  measured(
    `queued on the board during the block: at least ${Math.min(...queued).toFixed(2)} s (${queued.length} looks)`,
  );
  measured(`pulses in half a second: ${Math.min(...inBlock)} to ${Math.max(...inBlock)}`);
  expect(queued.length).toBeGreaterThan(10);
  expect(Math.min(...queued)).toBeGreaterThan(QUEUED_MIN_S);
  expect(during.map(({ snapshot }) => snapshot.job)).not.toContain('held');
  expect(inBlock.length).toBeGreaterThan(7);
  expect(Math.min(...inBlock)).toBeGreaterThan(mean * PULSES_SHARE_MIN);
});
