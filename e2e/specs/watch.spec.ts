// The watch over errors and requests sees what it is there for: in the page and in its workers.
import { createServer } from 'node:http';
import type { Route } from '@playwright/test';
import { listen } from '../../scripts/lib/server.mjs';
import { expect, test } from '../fixtures/test.ts';
import { ContextWatch } from '../fixtures/watch.ts';

const WORKER = `
  console.error('said by a worker');
  Promise.allSettled([fetch('/own.txt'), fetch(new URL(location.href).searchParams.get('other'))])
    .then(() => { throw new Error('thrown by a worker'); });
`;
const PAGE = `<!doctype html><title>Watched</title><script>
  const other = new URL(location.href).searchParams.get('other');
  new Worker('/worker.js?other=' + encodeURIComponent(other + 'of-worker'));
  fetch(other + 'of-page').catch(() => undefined);
</script>`;

/** A page without a policy, so that everything it tries goes out. */
const careless = () =>
  createServer((request, response) => {
    const isScript = request.url?.startsWith('/worker.js');
    response.setHeader('Content-Type', isScript ? 'text/javascript' : 'text/html');
    response.end(isScript ? WORKER : PAGE);
  });

test('requests, errors and console of page and workers are seen, other origins told apart', async ({
  browser,
}) => {
  const [own, other] = [careless(), careless()];
  const [ownUrl, otherUrl] = [await listen(own), await listen(other)];
  const context = await browser.newContext();
  try {
    const watch = new ContextWatch(context, [new URL(ownUrl).origin]);
    const page = await context.newPage();
    await page.goto(`${ownUrl}?other=${encodeURIComponent(otherUrl)}`);
    await expect.poll(() => watch.foreign).toHaveLength(2);
    expect([...watch.foreign].sort()).toEqual([`${otherUrl}of-page`, `${otherUrl}of-worker`]);
    expect(watch.requests).toContain(`${ownUrl}own.txt`);
    const told = () => watch.troubles().join('\n');
    await expect.poll(told).toContain('thrown by a worker');
    expect(told()).toContain('said by a worker');
    expect(told()).toContain('a request to another origin');
  } finally {
    await context.close();
    own.close();
    other.close();
  }
});

test('the page’s policy stops its workers from talking to anybody else', async ({ page, site, watch }) => {
  // A worker of the page’s own origin and policy that tries.
  const tries = `fetch('http://localhost:9/elsewhere').catch(() => console.info('refused'));\n`;
  const meddle = async (route: Route): Promise<void> => {
    const answer = await route.fetch();
    await route.fulfill({ response: answer, body: tries + (await answer.text()) });
  };
  await page.route('**/assets/worker-*.js', meddle, { times: 1 });
  watch.expectError(/stopped by the policy: connect-src http:\/\/localhost:9\/elsewhere/);
  const refused = page.waitForEvent('console', (message) => message.text() === 'refused');
  await page.goto(site.url);
  await refused;
  await expect.poll(() => watch.troubles()).toEqual([]);
  expect(watch.foreign).toEqual([]);
});

test('an expected error that does not come fails a test', async ({ context }) => {
  const watch = new ContextWatch(context, []);
  watch.expectError(/never/);
  expect(watch.troubles()).toEqual(['an error like /never/ was expected and did not come']);
});
