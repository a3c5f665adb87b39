#!/usr/bin/env node
// Opens the built harness in a real Chromium, takes pictures and measures: `npm run harness [-- OUTPUT_FOLDER]`.
// The browser is that of the browser tests. Software GL, so that every machine gives the same pictures.
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { DIST, drawnAtRest, frameCount, loseContext, withBrowser } from './browser.mjs';

const out = process.argv[2] ?? join(DIST, 'pictures');
const only = process.argv[3];

async function open(browser, url, query, size = { width: 1200, height: 800 }) {
  const page = await browser.newPage({ viewport: size });
  page.on(
    'console',
    (message) => message.type() !== 'log' && console.log(`  [${message.type()}] ${message.text()}`),
  );
  page.on('pageerror', (error) => console.log(`  [page] ${error}`));
  await page.goto(`${url}?${query}`);
  await drawnAtRest(page);
  return page;
}

async function act(page, name, body) {
  await page.evaluate(body);
  await drawnAtRest(page);
  await page.screenshot({ path: join(out, `${name}.png`) });
}

async function pictures(browser, url) {
  for (const theme of ['light', 'dark']) {
    const page = await open(browser, url, `theme=${theme}&segments=60000`);
    await act(page, `${theme}-whole`, () => window.harness.host.fit());
    await act(page, `${theme}-cut`, () =>
      window.harness.host.show({ layerTo: 20, travel: true, retractions: true, seams: true }),
    );
    await act(page, `${theme}-near`, () => {
      const { host } = window.harness;
      host.show({ layerTo: 30, travel: false, retractions: false, seams: false });
      host.zoom(0.16, [230, 60]);
    });
    await act(page, `${theme}-corner`, () => window.harness.host.zoom(0.3, [0, 0]));
    await act(page, `${theme}-top`, () => {
      const { host } = window.harness;
      host.show({ layerTo: 1000 });
      host.fit({ azimuth: 0, elevation: 1.5 });
    });
    await act(page, `${theme}-printed`, () => {
      const { host, vertexCount } = window.harness;
      host.fit({ azimuth: -0.5, elevation: 0.5 });
      host.setPrintedUpTo(Math.round(vertexCount * 0.4));
    });
    await page.close();
  }
}

async function robustness(browser, url) {
  const page = await open(browser, url, 'main=1&segments=60000&theme=dark');
  await page.screenshot({ path: join(out, 'main-thread.png') });
  await loseContext(page);
  await drawnAtRest(page);
  await page.screenshot({ path: join(out, 'restored.png') });
  console.log(
    'context lost and restored:',
    await page.evaluate(() => window.harness.events.filter((e) => e.startsWith('context')).join(', ')),
  );
  await page.close();
}

async function measure(browser, url) {
  for (const segments of [200_000, 1_000_000]) {
    const page = await browser.newPage({ viewport: { width: 1200, height: 800 } });
    await page.goto(`${url}?segments=${segments}`);
    await drawnAtRest(page);
    const rest = await page.evaluate(() => window.harness.frames.filter((f) => f.kind === 'full').at(-1));
    const since = await frameCount(page);
    await page.evaluate(async () => {
      for (let step = 0; step < 120; step++) {
        window.harness.host.orbit(4, step % 2);
        // As often as a pointer moves.
        await new Promise((resolve) => setTimeout(resolve, 16));
      }
    });
    const moving = await page.evaluate((n) => window.harness.frames.slice(n), since);
    await page.screenshot({ path: join(out, `moving-${segments}.png`) });
    const times = moving.map((f) => f.longestMs).sort((a, b) => a - b);
    const at = (p) => times[Math.min(Math.floor(times.length * p), times.length - 1)]?.toFixed(0);
    const vertices = await page.evaluate(() => window.harness.vertexCount);
    console.log(
      `${vertices} vertices: full picture ${rest.totalMs.toFixed(0)} ms (longest slice ${rest.longestMs.toFixed(0)}); ` +
        `moving: ${moving.length} frames in 2 s (${moving.at(-1)?.kind}, ${Math.round(moving.at(-1)?.segments ?? 0)} segments), p50 ${at(0.5)} p95 ${at(0.95)} max ${at(1)} ms`,
    );
    await page.close();
  }
}

mkdirSync(out, { recursive: true });
await withBrowser(async (browser, url) => {
  if (!only || only === 'pictures') await pictures(browser, url);
  if (!only || only === 'robustness') await robustness(browser, url);
  if (!only || only === 'measure') await measure(browser, url);
});
