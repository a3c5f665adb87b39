import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { test } from 'node:test';

import { countTests } from '../lib/steps.mjs';

test('tests are counted from what the runners write, colours or not', () => {
  const output = [
    'test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.01s',
    'test result: \x1b[31mFAILED\x1b[0m. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out',
    '\x1b[34mℹ tests 5\x1b[39m',
    '\x1b[34mℹ pass 4\x1b[39m',
    '\x1b[34mℹ fail 0\x1b[39m',
    'ℹ skipped 1',
    '\x1b[2m      Tests \x1b[22m \x1b[31m4 failed\x1b[39m | \x1b[32m56 passed\x1b[39m (60)',
    '      Tests  7 passed (7)',
    '  1 failed',
    '    specs/print.spec.ts:13:1 › 2 passed',
    '  1 skipped',
    '  18 passed (7.2m)',
  ].join('\n');
  assert.deepEqual(countTests(output), { passed: 100, failed: 7, skipped: 3 });
});

/** Runs steps in a Node of their own and gives its exit status and its output. */
function runApart(steps) {
  const module = new URL('../lib/steps.mjs', import.meta.url).href;
  const script = `import { runSteps } from ${JSON.stringify(module)};
    const node = (code) => [process.execPath, '-e', code];
    process.exitCode = (await runSteps(${steps}, { cwd: '.', env: process.env })) ? 0 : 1;`;
  const { status, stdout } = spawnSync(process.execPath, ['--input-type=module', '-e', script], { encoding: 'utf8' });
  return { status, stdout };
}

test('steps that need a failed one are not run, the others are, and the closing line adds up', () => {
  const { status, stdout } = runApart(`[
    { name: 'one', commands: [node('console.log("hello")')] },
    { name: 'two', commands: [node('process.exit(3)'), node('console.log("never")')] },
    { name: 'three', needs: ['two'], commands: [node('console.log("never")')] },
    { name: 'four', needs: ['one'], commands: [node('')] },
    { name: 'five', absent: () => 'a tool (how to get it)', commands: [node('console.log("never")')] },
  ]`);
  assert.equal(status, 1);
  assert.match(stdout, /^hello$/m);
  assert.doesNotMatch(stdout, /^never$/m);
  assert.match(stdout, /two +failed .*exit status 3/);
  assert.match(stdout, /three +not run .*"two" did not pass/);
  assert.match(stdout, /five +not run .*a tool \(how to get it\)/);
  assert.match(stdout, /\n2 passed, 1 failed, 2 skipped\n$/);
});

test('a program that is not there fails its step', () => {
  const { status, stdout } = runApart("[{ name: 'one', commands: [['no-such-program-anywhere']] }]");
  assert.equal(status, 1);
  assert.match(stdout, /\n0 passed, 1 failed\n$/);
});
