// The watch over long tasks sees the page's own, and takes a test's for what they are.
import { createServer } from 'node:http';
import { listen } from '../../scripts/lib/server.mjs';
import { MainThread } from '../fixtures/main_thread.ts';
import { expect, test } from '../fixtures/test.ts';

/** Long by the clock, so that it is long by the processor too when others want that as well. */
const SPIN_MS = 400;
const LONG_MS = 40;
const PAGE = `<!doctype html><title>Busy</title><button>Spin</button><script>
  const spin = () => { for (const until = performance.now() + ${SPIN_MS}; performance.now() < until;); };
  document.querySelector('button').addEventListener('click', spin);
  setTimeout(() => { spin(); document.title = 'Ready'; }, 100);
</script>`;

test('long tasks of the page are seen, those of tests told apart', async ({ browser }) => {
  const server = createServer((_, response) => {
    response.setHeader('Content-Type', 'text/html');
    response.end(PAGE);
  });
  const url = await listen(server);
  const context = await browser.newContext();
  try {
    const mainThread = MainThread.watch(browser, context, url);
    const page = await context.newPage();
    await page.goto(url);
    await expect(page).toHaveTitle('Ready');
    // A test's own scripts, at once and in a task of their own …
    await page.evaluate((ms) => {
      const spin = () => {
        for (const until = performance.now() + ms; performance.now() < until; );
      };
      spin();
      return new Promise<void>((done) =>
        setTimeout(() => {
          spin();
          done();
        }),
      );
    }, SPIN_MS);
    // … and the page's, called by a test.
    await page.getByRole('button').evaluate((button: HTMLElement) => button.click());
    const seen = await mainThread.end();
    expect(seen?.isWhole).toBe(true);
    const long = seen?.tasks.filter(({ cpu }) => cpu > LONG_MS) ?? [];
    expect(long, JSON.stringify(seen?.tasks.slice(0, 4))).toHaveLength(2);
    for (const { cpu, wall } of long) {
      expect(cpu).toBeLessThanOrEqual(wall);
      expect(wall).toBeGreaterThanOrEqual(SPIN_MS);
    }
  } finally {
    await context.close();
    server.close();
  }
});
