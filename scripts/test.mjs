#!/usr/bin/env node
// `npm test`: sets up what a fresh machine lacks, builds, and checks everything. CI runs the same.
//
//   npm test                    all steps
//   npm test -- layers clippy   only the steps whose names contain one of these words
//   npm test -- --list          the steps' names
//
// Installs the Rust toolchain of rust-toolchain.toml and the npm packages of package-lock.json, nothing else.
// Plain Node, built-ins only: it has to run before anything is installed.
import { join } from 'node:path';

import { BROWSER_ADVICE, obtainBrowser } from './lib/browser.mjs';
import { setUp } from './lib/setup.mjs';
import { runSteps } from './lib/steps.mjs';
import { root } from './lib/target.mjs';
import { advice, has } from './lib/toolchain.mjs';

/** Cargo's parallel jobs where the machine is shared: more run out of memory while linking. */
const CI_JOBS = '2';

const nodeTests = (...files) => [
  process.execPath, '--test', '--test-reporter=spec', ...files.map((file) => join('scripts', 'tests', file)),
];

/** A program of an npm package. */
const packaged = (name, ...args) => [process.execPath, join('node_modules', ...name.split('/')), ...args];

/** Why the browser tests cannot run. Continuous integration has no excuse: there the step runs, and fails. */
function browserAbsent() {
  try {
    return obtainBrowser() || process.env.CI ? undefined : BROWSER_ADVICE;
  } catch {
    // CHROME_PATH names no browser: the step says so, and fails.
    return undefined;
  }
}

const steps = [
  { name: 'scripts', commands: [nodeTests('steps.test.mjs', 'toolchain.test.mjs', 'server.test.mjs', 'start.test.mjs', 'browser.test.mjs')] },
  { name: 'format', commands: [['cargo', 'fmt', '--all', '--check']] },
  { name: 'layers', commands: [['cargo', 'xtask', 'layers']] },
  {
    name: 'clippy',
    commands: [['cargo', 'clippy', '--workspace', '--all-targets', '--', '--deny', 'warnings']],
  },
  {
    name: 'firmware for thumbv6m',
    commands: [['cargo', 'build', '--package', 'firmware-core', '--target', 'thumbv6m-none-eabi', '--release']],
  },
  {
    name: 'virtual printer for WebAssembly',
    commands: [['cargo', 'build', '--package', 'virtual-printer', '--target', 'wasm32-unknown-unknown']],
  },
  { name: 'Rust tests', commands: [['cargo', 'test', '--workspace']] },
  { name: 'release build', commands: [['cargo', 'build', '--release', '--package', 'stepcast']] },
  {
    name: 'the stepcast command on the samples',
    needs: ['release build'],
    commands: [nodeTests('stepcast.test.mjs')],
  },
  {
    name: 'WebAssembly equals native',
    needs: ['release build'],
    commands: [['cargo', 'xtask', 'wasm'], nodeTests('wasm.test.mjs', 'wasm_session.test.mjs')],
  },
  { name: 'messages as TypeScript', commands: [['cargo', 'xtask', 'bindings', '--check']] },
  { name: 'biome', commands: [packaged('@biomejs/biome/bin/biome', 'check', '--error-on-warnings')] },
  {
    name: 'TypeScript',
    needs: ['WebAssembly equals native'],
    commands: ['web/tsconfig.json', 'web/tsconfig.node.json', 'viz/toolpath/tsconfig.json', 'e2e/tsconfig.json'].map((file) =>
      packaged('typescript/bin/tsc', '--noEmit', '--project', file),
    ),
  },
  {
    name: 'TypeScript tests',
    commands: ['web', 'viz/toolpath'].map((folder) => packaged('vitest/vitest.mjs', 'run', '--root', folder)),
  },
  {
    name: 'the 3D view in a browser',
    absent: browserAbsent,
    commands: [
      packaged('vite/bin/vite.js', 'build', join('viz', 'toolpath', 'harness')),
      [process.execPath, join('viz', 'toolpath', 'harness', 'visual.mjs')],
      [process.execPath, join('viz', 'toolpath', 'harness', 'checks.mjs')],
    ],
  },
  // Before the page, which takes them along.
  { name: 'instruments build', commands: [['cargo', 'xtask', 'instruments']] },
  {
    name: 'page build',
    needs: ['WebAssembly equals native'],
    commands: [packaged('vite/bin/vite.js', 'build', 'web')],
  },
  {
    name: 'browser tests',
    needs: ['page build', 'instruments build', 'release build'],
    absent: browserAbsent,
    commands: [packaged('@playwright/test/cli.js', 'test', '--config', join('e2e', 'playwright.config.ts'))],
  },
  {
    name: 'instructions a step',
    needs: ['release build'],
    absent: () => (has('valgrind') ? undefined : `valgrind (${advice('valgrind')})`),
    commands: [['cargo', 'xtask', 'bench', 'motion', join('samples', 'test-part-small.gcode')]],
  },
  {
    name: 'licences and sources',
    absent: () => (has('cargo', ['deny', '--version']) ? undefined : `cargo-deny (${advice('cargo-deny')})`),
    commands: [['cargo', 'deny', '--workspace', 'check', 'bans', 'licenses', 'sources']],
  },
];

async function main(words) {
  if (words.includes('--list')) {
    for (const step of steps) console.log(step.name);
    return true;
  }
  const chosen = steps.filter((step) => words.length === 0 || words.some((word) => step.name.includes(word)));
  if (chosen.length === 0) {
    console.error(`no step is named like ${words.join(', ')}; npm test -- --list names them`);
    return false;
  }
  if (!setUp()) return false;
  const env = { ...process.env };
  if (env.CI) env.CARGO_BUILD_JOBS ??= CI_JOBS;
  return runSteps(chosen, { cwd: root, env });
}

process.exitCode = (await main(process.argv.slice(2))) ? 0 : 1;
