#!/usr/bin/env node
// What the view does in a browser, apart from what it looks like: `node harness/checks.mjs`. The harness must be built.
// The view draws on the main thread here, so that its calls of WebGL can be counted.
import assert from 'node:assert/strict';
import { loseContext, withBrowser } from './browser.mjs';
import { atRest, difference, drawn } from './compare.mjs';

const SIZE = { width: 320, height: 240 };

/** Counts what goes to the GPU and what is read back; runs in the page before anything else. */
function countCalls() {
  const counts = { uploadedBytes: 0, waitingReads: 0, reads: 0 };
  window.counts = counts;
  const { prototype } = WebGL2RenderingContext;
  const bytesOf = (given) =>
    given.reduce((sum, value) => sum + (ArrayBuffer.isView(value) ? value.byteLength : 0), 0);
  for (const name of [
    'bufferData',
    'bufferSubData',
    'texImage2D',
    'texSubImage2D',
    'texImage3D',
    'texSubImage3D',
  ]) {
    const original = prototype[name];
    prototype[name] = function upload(...given) {
      counts.uploadedBytes += bytesOf(given);
      return original.apply(this, given);
    };
  }
  const { readPixels } = prototype;
  prototype.readPixels = function read(...given) {
    counts.reads += 1;
    if (ArrayBuffer.isView(given[6])) counts.waitingReads += 1;
    return readPixels.apply(this, given);
  };
}

const emptied = (page, act) =>
  page.evaluate(
    ([body]) => {
      window.harness.frames.length = 0;
      return new Function('host', body)(window.harness.host);
    },
    [act],
  );

const answer = (page, type) =>
  page
    .waitForFunction((name) => window.harness.latest.get(name), type, { timeout: 30_000 })
    .then((handle) => handle.jsonValue());

async function uploadsNothing(page) {
  await drawn(page, 'colour-feature', 'light');
  await page.evaluate(() => {
    window.counts.uploadedBytes = 0;
  });
  const acts = [
    ...[
      'height',
      'feed',
      'speed',
      'flow',
      'flowAsked',
      'temperature',
      'fan',
      'layerTime',
      'tool',
      'object',
    ].map((mode) => `host.setColour('${mode}')`),
    "host.setColour('speed'); host.setColourRange('speed', [10, 20])",
    'host.show({ layerFrom: 2, layerTo: 7 })',
    'host.show({ vertexFrom: 312, vertexTo: 314 })',
    "host.show({ hiddenFeatures: ['support'], hiddenObjects: [1] })",
    'host.show({ travel: true, wipes: true, retractions: true, seams: true, toolChanges: true, pauses: true })',
    'host.setHighlightedObject(2)',
    'host.setVolume({ min: [0, 0, 0], max: [10, 10, 1] })',
    'host.setPrintedUpTo(100)',
    'host.orbit(20, 10)',
    "host.setProjection('orthographic')",
  ];
  let before = await page.screenshot();
  for (const act of acts) {
    await emptied(page, act);
    const after = await atRest(page).catch(() => assert.fail(`${act} draws nothing`));
    assert.ok((await difference(page, before, after)) > 0.5, `${act} changes the picture`);
    before = after;
  }
  const { uploadedBytes } = await page.evaluate(() => window.counts);
  assert.equal(uploadedBytes, 0, 'bytes uploaded by colours, ranges, marks and the camera');
}

async function picks(page) {
  await drawn(page, 'top', 'light');
  const pick = async (x, y) => {
    await page.evaluate(
      ([u, v]) => {
        window.harness.latest.delete('picked');
        window.harness.host.pick(u, v, 7);
      },
      [x, y],
    );
    return answer(page, 'picked');
  };
  const beside = await pick(5, 5);
  assert.deepEqual([beside.id, beside.vertex], [7, null], 'nothing beside the part');
  // Where the picture has the last post's outer wall.
  const on = await pick(280, 98);
  assert.ok(on.vertex > 300, `a vertex of the upper layers: ${on.vertex}`);
  const before = await page.screenshot();
  await emptied(page, `host.setHighlight(${on.vertex})`);
  const after = await atRest(page);
  const changed = await difference(page, before, after);
  assert.ok(changed > 0.5 && changed < 60, `the mark covers one segment: ${changed} ‰`);
}

async function keepsPictures(page) {
  const seen = await drawn(page, 'colour-speed', 'dark');
  const bytes = await page.evaluate(async () => {
    const { host, latest } = window.harness;
    host.picture(9, { width: 320, height: 240 });
    while (!latest.get('picture')) await new Promise((resolve) => requestAnimationFrame(resolve));
    const { id, blob } = latest.get('picture');
    return { id, type: blob.type, data: [...new Uint8Array(await blob.arrayBuffer())] };
  });
  assert.equal(bytes.id, 9);
  assert.equal(bytes.type, 'image/png');
  const share = await difference(page, seen, Buffer.from(bytes.data));
  assert.ok(share < 3, `the PNG shows what the view shows: ${share} ‰ differ`);
  const { reads, waitingReads } = await page.evaluate(() => window.counts);
  assert.ok(reads > 0, 'the picture was read back');
  assert.equal(waitingReads, 0, 'reads that wait for the GPU');
}

async function comesBack(page) {
  for (const name of ['colour-layer-time', 'colour-speed', 'mesh']) {
    const before = await drawn(page, name, 'light');
    await loseContext(page);
    const share = await difference(page, before, await atRest(page));
    assert.ok(share < 0.5, `${name} is as before the context was lost: ${share} ‰ differ`);
  }
}

const CHECKS = { uploadsNothing, picks, keepsPictures, comesBack };

await withBrowser(async (browser, url) => {
  const page = await browser.newPage({ viewport: SIZE });
  page.on('pageerror', (error) => console.log(`  [page] ${error}`));
  await page.addInitScript(countCalls);
  await page.goto(`${url}?case=&main=1`);
  await page.waitForFunction(() => window.harness?.ready);
  for (const [name, check] of Object.entries(CHECKS)) {
    try {
      await check(page);
      console.log(`passed  ${name}`);
    } catch (error) {
      console.log(`FAILED  ${name}: ${error.message}`);
      process.exitCode = 1;
    }
  }
});
