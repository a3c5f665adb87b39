// A command in the background tells how it ended, and is ended with everything that it started.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';

import { inBackground } from '../lib/background.mjs';

const node = (code) => [process.execPath, '--eval', code];

test('a command that succeeds is done, with what it said', async () => {
  const { outcome, output } = await inBackground(node('console.log("built")')).done;
  assert.equal(outcome, 'done');
  assert.match(output, /built/);
});

test('a command that fails keeps the reason, and only the end of a long story', async () => {
  const code = 'for (let i = 0; i < 5000; i += 1) console.log("line", i); console.error("the reason"); process.exitCode = 3';
  const { outcome, output } = await inBackground(node(code)).done;
  assert.equal(outcome, 'failed');
  assert.match(output, /the reason\n$/);
  assert.match(output, /line 4999\n/);
  assert.ok(output.length <= 16_000, `${output.length} characters`);
});

test('a program that is not there is a failure, not an exception', async () => {
  const { outcome, output } = await inBackground(['stepcast-no-such-program']).done;
  assert.equal(outcome, 'failed');
  assert.notEqual(output, '');
});

test('ending it ends what it started, too', { skip: process.platform === 'win32' && 'needs process groups' }, async () => {
  // The grandchild says that it runs, and holds the stream open as long as it does.
  const grandchild = 'console.log("runs"); setInterval(() => {}, 1000)';
  const code = `
    require('node:child_process').spawn(process.execPath, ['--eval', ${JSON.stringify(grandchild)}], { stdio: 'inherit' });
    setInterval(() => {}, 1000);`;
  const { done, end, said } = inBackground(node(code));
  try {
    for (const tries = { left: 500 }; !/runs/.test(said()); tries.left -= 1) {
      assert.ok(tries.left > 0, 'the grandchild does not run');
      await sleep(20);
    }
    end();
    const late = sleep(10_000, { outcome: 'still there after ten seconds' }, { ref: false });
    assert.equal((await Promise.race([done, late])).outcome, 'ended');
    // A second time is harmless.
    end();
  } finally {
    end();
  }
});
