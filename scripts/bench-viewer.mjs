#!/usr/bin/env node
// Our viewer beside others, on the same files, in one run: `npm run bench:viewer -- [FILE]`. Prints JSON.
//
// In a headless Chromium of its own each: the page as it is built (`npm test` or `npx vite build web` builds it), three's
// GCodeLoader, gcode-preview with lines and with tubes. Without a file it makes its own of 3, 20 and 100 MB from the sample.
//
// load_s: from the file's being chosen until all of its geometry is built. planned_s, ours alone: until the planner has gone
// through it too, for times, actual speeds and what the machine cannot do.
// first_frame_s: until the first picture of some of it is shown. full_frame_s: how long one picture in full detail takes.
// longest_block_ms: the main thread's longest task by the clock, over load and drawing; …_cpu_ms: by processor time.
// orbit_fps: pictures a second while the view is turned. slider_upload_bytes: to the GPU, while the layer slider moves;
// null where there is none. gpu_bytes_per_segment: uploaded for the load. Renderer and GPU process: resident, at rest;
// renderer_peak_mb: the most that it had.
import { mkdtempSync, readFileSync, rmSync, statSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from 'playwright-core';
import { build } from 'vite';

import { stack } from './bench/stack.mjs';
import { BROWSER_ADVICE, browserArguments, findBrowser } from './lib/browser.mjs';
import { fileServer, listen } from './lib/server.mjs';
import { root } from './lib/target.mjs';

const OWN_FILES_MB = [3, 20, 100];
/** A viewer that has not loaded a file by then is given up. */
const LOAD_TIMEOUT_MS = Number(process.env.BENCH_TIMEOUT_S ?? 180) * 1000;
const ORBIT_MS = 5000;
const VIEWERS = ['stepcast', 'three GCodeLoader', 'gcode-preview', 'gcode-preview tubes'];
const SIZE = { width: 1200, height: 800 };
const MB = 1e6;

/** Counts what is handed to the GPU in this realm. Runs in pages and in workers. */
function countUploads() {
  if (globalThis.uploads) return;
  globalThis.uploads = { bytes: 0 };
  const sizeOf = (value) => (typeof value === 'number' ? 0 : (value?.byteLength ?? 0));
  for (const kind of [globalThis.WebGLRenderingContext, globalThis.WebGL2RenderingContext]) {
    const face = kind?.prototype;
    for (const name of ['texImage2D', 'texSubImage2D', 'texImage3D', 'texSubImage3D', 'bufferData', 'bufferSubData']) {
      const real = face?.[name];
      if (!real) continue;
      face[name] = function (...values) {
        const data = values.find((value) => ArrayBuffer.isView(value) || value instanceof ArrayBuffer);
        globalThis.uploads.bytes += sizeOf(data);
        return real.apply(this, values);
      };
    }
  }
}

/** Notes when our workers tell of pictures and of the file's end. Runs in the page. */
function watchWorkers() {
  globalThis.seen = { chosen: 0, frames: [], built: null, summary: null, failed: null };
  const { seen } = globalThis;
  const Real = globalThis.Worker;
  globalThis.Worker = class extends Real {
    constructor(...args) {
      super(...args);
      this.addEventListener('message', ({ data }) => {
        const at = performance.now();
        if (data?.type === 'frame') seen.frames.push({ at, ...data.report });
        else if (data?.type === 'built') seen.built = { at, vertices: data.vertices };
        else if (data?.kind === 'summary') seen.summary = { at, vertices: data.summary.vertices };
        else if (data?.kind === 'failed' || data?.type === 'failed') seen.failed = JSON.stringify(data).slice(0, 300);
      });
    }
  };
  // Before the page's own listener hears of it.
  const click = HTMLInputElement.prototype.click;
  HTMLInputElement.prototype.click = function () {
    this.addEventListener('change', () => { seen.chosen = performance.now(); }, { capture: true, once: true });
    const { onchange } = this;
    if (onchange) this.onchange = (event) => { seen.chosen = performance.now(); onchange.call(this, event); };
    return click.call(this);
  };
}

/** The longest task of the page's main thread while `act` runs. */
async function blocksOf(browser, act) {
  const session = await browser.newBrowserCDPSession();
  const events = [];
  session.on('Tracing.dataCollected', ({ value }) => {
    for (const event of value) if (event.name === 'RunTask' || event.name === 'thread_name') events.push(event);
  });
  await session.send('Tracing.start', {
    transferMode: 'ReportEvents',
    traceConfig: { includedCategories: ['disabled-by-default-devtools.timeline', '__metadata'], traceBufferSizeInKb: 400_000 },
  });
  try {
    await act();
  } finally {
    const over = new Promise((done) => session.once('Tracing.tracingComplete', done));
    await session.send('Tracing.end');
    await over;
    await session.detach();
  }
  const main = new Set(events.filter((event) => event.args?.name === 'CrRendererMain').map(({ pid, tid }) => `${pid}:${tid}`));
  const tasks = events.filter(({ name, pid, tid }) => name === 'RunTask' && main.has(`${pid}:${tid}`));
  const longest = (of) => Math.round(tasks.reduce((most, task) => Math.max(most, of(task) ?? 0), 0) / 100) / 10;
  return { longest_block_ms: longest(({ dur }) => dur), longest_block_cpu_ms: longest(({ tdur }) => tdur) };
}

function residentMb(pid, field = 'VmRSS') {
  try {
    return Math.round((Number(new RegExp(`^${field}:\\s+(\\d+)`, 'm').exec(readFileSync(`/proc/${pid}/status`, 'utf8'))?.[1]) * 1024) / MB);
  } catch {
    // Only Linux tells.
    return null;
  }
}

async function memory(browser, page) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send('SystemInfo.getProcessInfo');
  await session.detach();
  const of = (type, field) => {
    const found = processInfo.filter((one) => one.type === type).map(({ id }) => residentMb(id, field));
    return found.length === 0 || found.includes(null) ? null : Math.max(...found);
  };
  const ours = await page.context().newCDPSession(page);
  await ours.send('Performance.enable');
  const { metrics } = await ours.send('Performance.getMetrics');
  await ours.detach();
  const heap = metrics.find(({ name }) => name === 'JSHeapUsedSize')?.value ?? 0;
  return { js_heap_mb: Math.round(heap / MB), renderer_rss_mb: of('renderer'), renderer_peak_mb: of('renderer', 'VmHWM'), gpu_process_rss_mb: of('GPU') };
}

const rounded = (value, digits = 3) => (Number.isFinite(value) ? Number(value.toFixed(digits)) : null);

/** The page as visitors get it. */
async function stepcast(browser, url, file, result) {
  const context = await browser.newContext({ viewport: SIZE, serviceWorkers: 'block' });
  const page = await context.newPage();
  await page.addInitScript(watchWorkers);
  const drawers = [];
  page.on('worker', (worker) => drawers.push(worker.evaluate(countUploads).then(() => worker, () => null)));
  const uploaded = async () => {
    let bytes = 0;
    for (const worker of await Promise.all(drawers)) bytes += (await worker?.evaluate(() => globalThis.uploads.bytes).catch(() => 0)) ?? 0;
    return bytes;
  };
  await page.goto(url);
  const choose = page.getByRole('button', { name: 'Choose a file' });
  await choose.waitFor();
  // Everything is loaded, the empty bed is drawn.
  await page.waitForFunction(() => globalThis.seen.frames.some(({ kind }) => kind === 'full'), null, { timeout: 60_000 });
  const before = await uploaded();
  const blocks = await blocksOf(browser, async () => {
    const chooser = page.waitForEvent('filechooser');
    await choose.click();
    const empty = await page.evaluate(() => globalThis.seen.frames.length);
    await (await chooser).setFiles(file);
    await page.waitForFunction(() => (globalThis.seen.built && globalThis.seen.summary) || globalThis.seen.failed, null, { timeout: LOAD_TIMEOUT_MS });
    const failed = await page.evaluate(() => globalThis.seen.failed);
    if (failed) throw new Error(failed);
    const { chosen, built, summary } = await page.evaluate(() => globalThis.seen);
    result.load_s = rounded((built.at - chosen) / 1000);
    result.planned_s = rounded((summary.at - chosen) / 1000);
    result.segments = built.vertices;
    Object.assign(result, await memory(browser, page));
    // The picture of all of it, at rest: one that was not begun beside the planner.
    const still = await page.evaluate(() => performance.now());
    await page.getByRole('application').first().press('ArrowRight');
    await page.waitForFunction(
      (since) => globalThis.seen.frames.some(({ kind, at, totalMs }) => kind === 'full' && at - totalMs > since),
      still,
      { timeout: LOAD_TIMEOUT_MS },
    );
    const { frames } = await page.evaluate(() => globalThis.seen);
    const shown = frames.slice(empty).find(({ segments, at }) => segments > 0 && at > chosen);
    const full = frames.findLast(({ kind }) => kind === 'full');
    result.first_frame_s = rounded((shown?.at - chosen) / 1000);
    result.full_frame_s = rounded(full.totalMs / 1000);
    result.gpu_bytes_per_segment = rounded(((await uploaded()) - before) / summary.vertices, 1);
    result.orbit_fps = rounded(await orbit(page), 1);
    result.slider_upload_bytes = await slide(page, uploaded);
  });
  Object.assign(result, blocks, await memory(browser, page));
}

/** Turns the view with the mouse, and counts pictures. */
async function orbit(page) {
  const place = await page.getByRole('application').first().boundingBox();
  const [x, y] = [place.x + place.width / 2, place.y + place.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  const began = Date.now();
  const from = await page.evaluate(() => globalThis.seen.frames.length);
  for (let step = 0; Date.now() - began < ORBIT_MS; step += 1) {
    await page.mouse.move(x + 200 * Math.sin(step / 40), y + 40 * Math.cos(step / 40));
  }
  const frames = await page.evaluate((first) => globalThis.seen.frames.slice(first).filter(({ kind }) => kind === 'quick' || kind === 'full').length, from);
  const elapsed = Date.now() - began;
  await page.mouse.up();
  return (frames * 1000) / elapsed;
}

/** Moves every slider of the view by its keys. */
async function slide(page, uploaded) {
  const before = await uploaded();
  const sliders = page.getByRole('region', { name: 'Preview' }).getByRole('slider');
  const count = await sliders.count();
  if (count === 0) throw new Error('the page shows no slider');
  for (let at = 0; at < count; at += 1) {
    if (!(await sliders.nth(at).isVisible())) continue;
    await sliders.nth(at).focus();
    for (const key of ['ArrowLeft', 'ArrowDown', 'PageDown', 'ArrowRight', 'End', 'Home']) await page.keyboard.press(key);
  }
  // What they asked for is drawn: whatever that takes to the GPU is there.
  await page.locator('[role=application][aria-busy=false]').first().waitFor({ timeout: LOAD_TIMEOUT_MS });
  return (await uploaded()) - before;
}

async function peer(browser, url, file, viewer, result) {
  const page = await (await browser.newContext({ viewport: SIZE })).newPage();
  await page.addInitScript(countUploads);
  page.setDefaultTimeout(LOAD_TIMEOUT_MS);
  await page.goto(`${url}?viewer=${encodeURIComponent(viewer)}`);
  await page.waitForFunction(() => globalThis.isReady);
  const bytes = () => page.evaluate(() => globalThis.uploads.bytes);
  const blocks = await blocksOf(browser, async () => {
    const before = await bytes();
    await page.locator('#file').setInputFiles(file);
    await page.waitForFunction(() => globalThis.loaded);
    const { load_s, first_frame_s, full_frame_s, segments, failed } = await page.evaluate(() => globalThis.loaded);
    if (failed) throw new Error(failed);
    Object.assign(result, { load_s: rounded(load_s), first_frame_s: rounded(first_frame_s), full_frame_s: rounded(full_frame_s), segments });
    result.gpu_bytes_per_segment = rounded(((await bytes()) - before) / Math.max(1, segments), 1);
    result.orbit_fps = rounded(await page.evaluate((ms) => globalThis.orbit(ms), ORBIT_MS), 2);
    const still = await bytes();
    result.slider_upload_bytes = (await page.evaluate(() => globalThis.slide())) ? (await bytes()) - still : null;
  });
  Object.assign(result, blocks, await memory(browser, page));
}

/** One viewer, in a browser of its own, so that memory is its own. */
async function measure(viewer, urls, file) {
  const executablePath = findBrowser();
  if (!executablePath) throw new Error(`Missing: ${BROWSER_ADVICE}`);
  const browser = await chromium.launch({ executablePath, args: browserArguments() });
  const result = { viewer };
  let timer;
  try {
    const work = viewer === 'stepcast' ? stepcast(browser, urls.ours, file, result) : peer(browser, urls.peers, file, viewer, result);
    const late = new Promise((_, fail) => {
      timer = setTimeout(() => fail(new Error('timeout')), 2 * LOAD_TIMEOUT_MS + 60_000);
    });
    await Promise.race([work, late]);
  } catch (error) {
    // What was measured until then is told.
    result.failed = String(error.message ?? error).split('\n')[0];
  } finally {
    clearTimeout(timer);
    await browser.close();
  }
  return result;
}

/** Ours by each other's; what is missing on either side is left out. */
function ratios(results) {
  const [ours, ...others] = results;
  const names = ['load_s', 'first_frame_s', 'full_frame_s', 'longest_block_ms', 'orbit_fps', 'gpu_bytes_per_segment', 'renderer_rss_mb', 'renderer_peak_mb'];
  return others.filter(({ failed }) => !failed).map((other) => {
    const known = names.filter((name) => Number.isFinite(ours[name]) && other[name] > 0);
    return { to: other.viewer, ...Object.fromEntries(known.map((name) => [name, rounded(ours[name] / other[name])])) };
  });
}

async function main(given) {
  const folder = mkdtempSync(join(tmpdir(), 'stepcast-bench-'));
  const servers = [];
  const serve = async (path) => {
    const server = fileServer(path);
    servers.push(server);
    return listen(server);
  };
  try {
    const peers = join(folder, 'peers');
    await build({ root: join(root, 'scripts', 'bench', 'peers'), base: './', logLevel: 'warn', build: { outDir: peers, target: 'esnext', emptyOutDir: true, chunkSizeWarningLimit: 5000 } });
    const urls = { ours: await serve(join(root, 'web', 'dist')), peers: await serve(peers) };
    const files = given.length > 0 ? given : OWN_FILES_MB.map((mb) => {
      const path = join(folder, `stacked-${mb}.gcode`);
      stack(path, mb);
      return path;
    });
    const viewers = process.env.BENCH_VIEWERS?.split(',') ?? VIEWERS;
    const report = [];
    for (const file of files) {
      const results = [];
      for (const viewer of viewers) {
        process.stderr.write(`${file}: ${viewer} …\n`);
        results.push(await measure(viewer, urls, file));
      }
      report.push({ file_mb: rounded(statSync(file).size / MB, 1), viewers: results, ratios: ratios(results) });
      // What is known is not lost if a later one is broken off.
      process.stderr.write(`${JSON.stringify(report.at(-1))}\n`);
    }
    console.log(JSON.stringify(report, null, 2));
  } finally {
    for (const server of servers) {
      server.closeAllConnections();
      server.close();
    }
    rmSync(folder, { recursive: true, force: true });
  }
}

await main(process.argv.slice(2));
