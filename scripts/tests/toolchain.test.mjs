import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { advice, atLeast, installArguments, isInstalled, isNodeGood, readToolchain } from '../lib/toolchain.mjs';

test('versions compare by number, not by letter', () => {
  assert.ok(atLeast('20.19.0', [20, 19]));
  assert.ok(atLeast('v22.1.0', [20, 19]));
  assert.ok(!atLeast('20.9.0', [20, 19]));
  assert.ok(!atLeast('18.20.4', [20, 19]));
});

test('Node is judged as the page\'s build judges it', () => {
  for (const good of ['20.19.0', '20.20.1', '22.12.0', '22.20.0', '23.0.0', '24.1.0']) assert.ok(isNodeGood(good), good);
  for (const bad of ['18.20.4', '20.18.3', '21.7.3', '22.0.0', '22.11.0']) assert.ok(!isNodeGood(bad), bad);
  const { engines } = JSON.parse(readFileSync(new URL('../../package.json', import.meta.url), 'utf8'));
  assert.equal(engines.node, '^20.19.0 || >=22.12.0');
});

test('the toolchain is read from the file that rustup reads', () => {
  const text = '[toolchain]\nchannel = "1.2.3"\ncomponents = ["clippy",\n  "rustfmt"]\ntargets = ["a-b-c"]\n';
  assert.deepEqual(installArguments(readToolchain(text)), [
    'toolchain', 'install', '1.2.3', '--no-self-update', '--profile', 'minimal',
    '--component', 'clippy', '--component', 'rustfmt', '--target', 'a-b-c',
  ]);
  assert.throws(() => readToolchain('[toolchain]\n'), /no channel/);
});

test('this repository asks for what its steps use', () => {
  const toolchain = readToolchain(readFileSync(new URL('../../rust-toolchain.toml', import.meta.url), 'utf8'));
  assert.match(toolchain.channel, /^\d+\.\d+\.\d+$/);
  assert.deepEqual(toolchain.components.toSorted(), ['clippy', 'rustfmt']);
  assert.deepEqual(toolchain.targets.toSorted(), ['thumbv6m-none-eabi', 'wasm32-unknown-unknown']);
});

test('whatever is missing, on whatever system, there is advice', () => {
  for (const what of ['node', 'rustup', 'linker', 'valgrind', 'cargo-deny']) {
    for (const platform of ['linux', 'darwin', 'win32', 'freebsd']) {
      assert.ok(advice(what, platform).length > 5, `${what} on ${platform}`);
    }
  }
});

test('a toolchain is only taken for complete when all of it is there', () => {
  const none = { channel: '0.0.1', components: ['clippy'], targets: [] };
  assert.equal(isInstalled(none), false);
  const toolchain = readToolchain(readFileSync(new URL('../../rust-toolchain.toml', import.meta.url), 'utf8'));
  assert.equal(isInstalled({ ...toolchain, targets: [...toolchain.targets, 'no-such-target'] }), false);
});
