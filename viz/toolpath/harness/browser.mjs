// What the harness's scripts share: the built page in a Chromium with software GL, so that every machine draws the same.
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { BROWSER_ADVICE, browserArguments, findBrowser } from '../../../scripts/lib/browser.mjs';
import { fileServer, listen } from '../../../scripts/lib/server.mjs';

export const DIST = fileURLToPath(new URL('./dist', import.meta.url));
const SOFTWARE_GL = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

/** Starts both and hands them to `body`; ends them whatever happens. */
export async function withBrowser(body) {
  const executablePath = findBrowser();
  if (!executablePath) throw new Error(`Missing: ${BROWSER_ADVICE}`);
  const server = fileServer(DIST);
  const url = await listen(server);
  const browser = await chromium.launch({
    executablePath,
    args: [...new Set([...browserArguments(), ...SOFTWARE_GL])],
  });
  try {
    return await body(browser, url);
  } finally {
    await browser.close();
    server.close();
  }
}

/** Waits until the view shows all that it was asked for in full, and the browser shows that. */
export async function drawnAtRest(page) {
  await page.waitForFunction(() => window.harness?.ready);
  await page.evaluate(() => {
    const { host, latest } = window.harness;
    latest.delete('settled');
    host.settle(1);
  });
  await page.waitForFunction(() => window.harness.latest.has('settled'), null, { timeout: 120_000 });
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

/** Takes the view's context away and gives it one again, each when the view knows of the one before. */
export async function loseContext(page) {
  for (const [call, event] of [
    ['loseContext', 'contextLost'],
    ['restoreContext', 'contextRestored'],
  ]) {
    await page.evaluate(
      ([name, type]) => {
        const { latest, frames } = window.harness;
        latest.delete(type);
        frames.length = 0;
        const gl = document.querySelector('#view').getContext('webgl2');
        window.losing ??= gl.getExtension('WEBGL_lose_context');
        window.losing[name]();
      },
      [call, event],
    );
    await page.waitForFunction((type) => window.harness.latest.has(type), event, { timeout: 30_000 });
  }
}

export const frameCount = (page) => page.evaluate(() => window.harness.frames.length);
