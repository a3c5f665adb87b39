#!/usr/bin/env node
// Draws each case of cases.ts and compares it with the picture that is kept of it: `node harness/visual.mjs [--update] [NAME…]`.
// The harness must be built. Where one differs, what was drawn lies in harness/dist/differs.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { DIST, withBrowser } from './browser.mjs';

const KEPT = fileURLToPath(new URL('./pictures', import.meta.url));
const DIFFERS = join(DIST, 'differs');
const SIZE = { width: 320, height: 240 };
/** Nothing is drawn for so long: the picture is done. */
const QUIET_MS = 400;
/** A colour's channel may differ by so much, and so many pixels of a thousand by more. */
const CHANNEL_MAX = 40;
const PIXELS_MAX = 3;

const update = process.argv.includes('--update');
const chosen = process.argv.slice(2).filter((word) => !word.startsWith('--'));

/** Of a thousand pixels, those that differ from all the nine around their place in the other picture; runs in the page. */
async function differing({ first, second, channelMax }) {
  const pixels = async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, bitmap.width, bitmap.height);
  };
  const [a, b] = [await pixels(first), await pixels(second)];
  if (a.width !== b.width || a.height !== b.height) return 1000;
  const near = (one, other, x, y) => {
    const at = (y * a.width + x) * 4;
    for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, a.height - 1); v++) {
      for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, a.width - 1); u++) {
        const to = (v * a.width + u) * 4;
        if ([0, 1, 2].every((c) => Math.abs(one.data[at + c] - other.data[to + c]) <= channelMax))
          return true;
      }
    }
    return false;
  };
  let count = 0;
  for (let y = 0; y < a.height; y++) {
    for (let x = 0; x < a.width; x++) if (!near(a, b, x, y) || !near(b, a, x, y)) count += 1;
  }
  return (1000 * count) / (a.width * a.height);
}

async function drawn(page, name, theme) {
  await page.evaluate(
    ([case_, shade]) => {
      window.harness.latest.delete('ranges');
      window.harness.frames.length = 0;
      window.harness.seen = 0;
      window.harness.show(case_, shade);
    },
    [name, theme],
  );
  await page.waitForFunction(
    (quietMs) => {
      const { harness } = window;
      const { frames, latest } = harness;
      if (!latest.get('ranges')?.isWhole || (frames.at(-1)?.kind ?? 'quick') === 'quick') return false;
      if (harness.seen !== frames.length) {
        harness.seen = frames.length;
        harness.since = performance.now();
      }
      return performance.now() - harness.since > quietMs;
    },
    QUIET_MS,
    { timeout: 60_000, polling: 50 },
  );
  return page.screenshot();
}

async function compare(page, name, theme) {
  const taken = await drawn(page, name, theme);
  const file = join(KEPT, `${name}-${theme}.png`);
  if (update) {
    mkdirSync(KEPT, { recursive: true });
    writeFileSync(file, taken);
    return true;
  }
  const share = existsSync(file)
    ? await page.evaluate(differing, {
        first: readFileSync(file).toString('base64'),
        second: taken.toString('base64'),
        channelMax: CHANNEL_MAX,
      })
    : 1000;
  const same = share <= PIXELS_MAX;
  if (!same) {
    mkdirSync(DIFFERS, { recursive: true });
    writeFileSync(join(DIFFERS, `${name}-${theme}.png`), taken);
  }
  console.log(`${same ? 'same' : 'DIFFERS'}  ${name}-${theme}: ${share.toFixed(1)} ‰ of the pixels`);
  return same;
}

const began = Date.now();
const failed = await withBrowser(async (browser, url) => {
  const page = await browser.newPage({ viewport: SIZE });
  page.on(
    'console',
    (message) => message.type() !== 'log' && console.log(`  [${message.type()}] ${message.text()}`),
  );
  page.on('pageerror', (error) => console.log(`  [page] ${error}`));
  await page.goto(`${url}?case=`);
  await page.waitForFunction(() => window.harness?.ready);
  const names = await page.evaluate(() => window.harness.cases);
  let count = 0;
  for (const [at, name] of names.entries()) {
    if (chosen.length > 0 && !chosen.includes(name)) continue;
    // Both themes take turns.
    if (!(await compare(page, name, at % 2 === 0 ? 'light' : 'dark'))) count += 1;
  }
  return count;
});
console.log(`${failed} of the pictures differ, ${((Date.now() - began) / 1000).toFixed(1)} s`);
process.exitCode = failed > 0 ? 1 : 0;
