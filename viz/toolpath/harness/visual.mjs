#!/usr/bin/env node
// Draws each case of cases.ts and compares it with the picture that is kept of it: `node harness/visual.mjs [--update] [NAME…]`.
// The harness must be built. Where one differs, what was drawn lies in harness/dist/differs.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { DIST, withBrowser } from './browser.mjs';
import { difference, drawn } from './compare.mjs';

const KEPT = fileURLToPath(new URL('./pictures', import.meta.url));
const DIFFERS = join(DIST, 'differs');
const SIZE = { width: 320, height: 240 };
/** So many pixels of a thousand may differ. */
const PIXELS_MAX = 3;

const update = process.argv.includes('--update');
const chosen = process.argv.slice(2).filter((word) => !word.startsWith('--'));

async function compare(page, name, theme) {
  const taken = await drawn(page, name, theme);
  const file = join(KEPT, `${name}-${theme}.png`);
  if (update) {
    mkdirSync(KEPT, { recursive: true });
    writeFileSync(file, taken);
    return true;
  }
  const share = existsSync(file) ? await difference(page, readFileSync(file), taken) : 1000;
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
  for (const name of names) {
    if (chosen.length > 0 && !chosen.includes(name)) continue;
    // Each has a theme of its own, which other cases do not change.
    if (!(await compare(page, name, name.length % 2 === 0 ? 'light' : 'dark'))) count += 1;
  }
  return count;
});
console.log(`${failed} of the pictures differ, ${((Date.now() - began) / 1000).toFixed(1)} s`);
process.exitCode = failed > 0 ? 1 : 0;
