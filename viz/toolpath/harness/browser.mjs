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

/** Waits for a full picture drawn after the frame number `since`. */
export const drawnAtRest = (page, since) =>
  page.waitForFunction(
    (n) => window.harness.ready && window.harness.frames.slice(n).some((frame) => frame.kind === 'full'),
    since,
    { timeout: 120_000 },
  );

export const frameCount = (page) => page.evaluate(() => window.harness.frames.length);
