// `npm run bench:browser [FILE] [PRINTER.CFG]`: what planning a file costs as WebAssembly in a real browser, against the native
// command, in one run. Both work on one thread; rounds alternate, and the shortest of each counts, so that a busy machine
// disturbs both alike. Needs what `npm test` builds: the release command and the bindings of `cargo xtask wasm`.
import { spawnSync } from 'node:child_process';
import { existsSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { dirname, join, resolve } from 'node:path';

import { chromium } from '@playwright/test';

import { BROWSER_ADVICE, browserArguments, findBrowser } from '../../scripts/lib/browser.mjs';
import { root, stepcast, targetFolder } from '../../scripts/lib/target.mjs';

const ROUNDS = 5;
const TYPES = {
  js: 'text/javascript',
  wasm: 'application/wasm',
  html: 'text/html',
  gcode: 'application/octet-stream',
};

const [file, config] = [
  process.argv[2] ?? 'samples/test-part.gcode',
  process.argv[3] ?? 'samples/printer.cfg',
].map((path, index) => (process.argv[index + 2] === undefined ? join(root, path) : resolve(path)));
const bindings = join(targetFolder(), 'wasm-bindings', 'web');
const program = findBrowser();
if (program === undefined) {
  console.log(`not run: no browser. ${BROWSER_ADVICE}`);
  process.exit(0);
}
for (const [what, path, how] of [
  ['the native command', stepcast(), 'cargo build --release --package stepcast'],
  ['the WebAssembly', join(bindings, 'planner_wasm.js'), 'cargo xtask wasm'],
]) {
  if (!existsSync(path)) throw new Error(`${what} is not built: ${how}`);
}

/** One native plan: its time in ms and the bytes it makes. */
function native() {
  const start = performance.now();
  const { status, stdout, stderr } = spawnSync(stepcast(), ['plan', file, '--config', config, '--json'], {
    encoding: 'utf8',
  });
  const time = performance.now() - start;
  if (status !== 0) throw new Error(stderr);
  return { time, bytes: JSON.parse(stdout).bytes };
}

/** One plan in the page; runs there. */
async function planInPage(cfg) {
  const planner = await import('/planner_wasm.js');
  await planner.default();
  const gcode = new Uint8Array(await (await fetch('/file.gcode')).arrayBuffer());
  const start = performance.now();
  const stream = new planner.PlanStream(cfg);
  let bytes = 0;
  for (let at = 0; at < gcode.length; ) {
    const end = at + Math.min(gcode.length - at, stream.wants());
    bytes += stream.feed(gcode.subarray(at, end)).length;
    at = end;
  }
  bytes += stream.finish().blocks.length;
  return { time: performance.now() - start, bytes };
}

const server = createServer((request, response) => {
  const name = (request.url ?? '/').slice(1);
  const path = name === 'file.gcode' ? file : join(bindings, name);
  if (name !== 'file.gcode' && (dirname(path) !== bindings || !existsSync(path))) {
    response.writeHead(name === '' ? 200 : 404, { 'content-type': TYPES.html }).end();
    return;
  }
  response
    .writeHead(200, { 'content-type': TYPES[path.split('.').pop()] ?? TYPES.gcode })
    .end(readFileSync(path));
});
await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
const browser = await chromium.launch({ executablePath: program, args: browserArguments() });
try {
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  const cfg = readFileSync(config, 'utf8');
  const best = { native: Infinity, browser: Infinity };
  for (let round = 0; round < ROUNDS; round += 1) {
    const [here, there] = [native(), await page.evaluate(planInPage, cfg)];
    if (here.bytes !== there.bytes)
      throw new Error(`${here.bytes} bytes natively, ${there.bytes} in the browser`);
    best.native = Math.min(best.native, here.time);
    best.browser = Math.min(best.browser, there.time);
  }
  console.log(`${file}: shortest of ${ROUNDS} rounds`);
  console.log(`  native, with its start  ${best.native.toFixed(0)} ms`);
  console.log(`  ${browser.browserType().name()} ${browser.version()}  ${best.browser.toFixed(0)} ms`);
  console.log(`  browser / native        ${(best.browser / best.native).toFixed(2)}`);
} finally {
  await browser.close();
  server.close();
}
