// The planner that the page loads makes, in the browser, the very bytes that the native command makes.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../scripts/lib/target.mjs';
import { nativePlan } from '../fixtures/plan.ts';
import { expect, test } from '../fixtures/test.ts';
import { sample } from '../pages/panel.ts';

const FILE = 'test-part-small.gcode';
/** What a stream of a few thousand moves has at least. */
const BLOCK_BYTES_MIN = 50_000;

/** The generated glue, as the parts of it that the test uses. */
interface Planner {
  default(options: { module_or_path: string }): Promise<unknown>;
  PlanStream: new (
    config: string,
  ) => {
    wants(): number;
    feed(gcode: Uint8Array): Uint8Array<ArrayBuffer>;
    finish(): { readonly blocks: Uint8Array<ArrayBuffer> };
  };
}

// The test itself plans, on the main thread: nothing of the page does.
test.use({ areTasksJudged: false });

test('the browser’s planner gives the native planner’s bytes', async ({ page, panel, watch }) => {
  // The module that the page itself has loaded; its own glue leaves out what only this test calls.
  const isModule = (address: string): boolean => /\/assets\/planner_wasm_bg-[^/]+\.wasm$/.test(address);
  await expect.poll(() => watch.requests.filter(isModule).length).toBeGreaterThan(0);
  const module = watch.requests.find(isModule) ?? '';
  const serve = (name: string, path: string, contentType: string): Promise<unknown> =>
    page.route(`**/test/${name}`, (route) => route.fulfill({ body: readFileSync(path), contentType }));
  await serve('glue.js', join(root, 'web/src/bindings/wasm/planner_wasm.js'), 'text/javascript');
  await serve('sample.gcode', sample(FILE), 'text/plain');
  await serve('printer.cfg', sample('printer.cfg'), 'text/plain');

  const made = await panel.page.evaluate(async (module) => {
    const glue = new URL('./test/glue.js', location.href).href;
    const planner = (await import(glue)) as Planner;
    await planner.default({ module_or_path: module });
    const text = async (name: string): Promise<string> => (await fetch(`./test/${name}`)).text();
    const stream = new planner.PlanStream(await text('printer.cfg'));
    const gcode = new TextEncoder().encode(await text('sample.gcode'));
    const blocks: BlobPart[] = [];
    for (let at = 0; at < gcode.length; ) {
      const end = at + Math.min(4096, stream.wants());
      if (end === at) throw new Error('a planner that was run wants more');
      blocks.push(stream.feed(gcode.subarray(at, end)));
      at = end;
    }
    blocks.push(stream.finish().blocks);
    const bytes = await new Blob(blocks).arrayBuffer();
    const digest = new Uint8Array(await crypto.subtle.digest('SHA-256', bytes));
    return {
      length: bytes.byteLength,
      sha256: Array.from(digest, (byte) => byte.toString(16).padStart(2, '0')).join(''),
    };
  }, module);

  const { blocks } = nativePlan(sample(FILE));
  expect(blocks.length).toBeGreaterThan(BLOCK_BYTES_MIN);
  expect(made).toEqual({ length: blocks.length, sha256: createHash('sha256').update(blocks).digest('hex') });
});
