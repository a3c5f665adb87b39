#!/usr/bin/env node
// `npm test`: sets up what a fresh machine lacks, builds, and checks everything. CI runs the same.
//
//   npm test                    all steps
//   npm test -- layers clippy   only the steps whose names contain one of these words
//   npm test -- --list          the steps' names
//
// Installs the Rust toolchain of rust-toolchain.toml and the npm packages of package-lock.json, nothing else.
// Plain Node, built-ins only: it has to run before anything is installed.
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

import { runSteps } from './lib/steps.mjs';
import { advice, has, installArguments, isInstalled, missing, readToolchain } from './lib/toolchain.mjs';

const root = dirname(dirname(fileURLToPath(import.meta.url)));
/** Cargo's parallel jobs where the machine is shared: more run out of memory while linking. */
const CI_JOBS = '2';

const nodeTests = (...files) => [
  process.execPath, '--test', '--test-reporter=spec', ...files.map((file) => join('scripts', 'tests', file)),
];

const steps = [
  { name: 'scripts', commands: [nodeTests('steps.test.mjs', 'toolchain.test.mjs')] },
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
    commands: [['cargo', 'xtask', 'wasm'], nodeTests('wasm.test.mjs')],
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

/** Runs a command with its output shown; true when it succeeded. */
function shown(program, args) {
  console.log(`$ ${[program, ...args].join(' ')}`);
  const shell = process.platform === 'win32';
  return spawnSync(program, args, { cwd: root, stdio: 'inherit', shell }).status === 0;
}

function setUpRust() {
  const toolchain = readToolchain(readFileSync(join(root, 'rust-toolchain.toml'), 'utf8'));
  if (shown('rustup', installArguments(toolchain))) return true;
  if (isInstalled(toolchain)) {
    console.log(`rustup could not look for news; Rust ${toolchain.channel} is complete, so it goes on`);
    return true;
  }
  console.error(`rustup could not install Rust ${toolchain.channel}: is the network there?`);
  return false;
}

/** `npm ci`, unless there is nothing to install or the lock file is the one that was installed last. */
function setUpNpm() {
  const lock = readFileSync(join(root, 'package-lock.json'), 'utf8');
  if (Object.keys(JSON.parse(lock).packages).length <= 1) return true;
  const stamp = join(root, 'node_modules', '.stepcast-lock');
  const digest = createHash('sha256').update(lock).digest('hex');
  if (existsSync(stamp) && readFileSync(stamp, 'utf8') === digest) return true;
  if (!shown('npm', ['ci', '--no-audit', '--no-fund'])) return false;
  mkdirSync(dirname(stamp), { recursive: true });
  writeFileSync(stamp, digest);
  return true;
}

async function main(words) {
  if (words.includes('--list')) {
    for (const step of steps) console.log(step.name);
    return true;
  }
  const lacking = missing();
  if (lacking.length > 0) {
    console.error(`Missing on this machine:\n${lacking.map((line) => `  ${line}`).join('\n')}`);
    return false;
  }
  const chosen = steps.filter((step) => words.length === 0 || words.some((word) => step.name.includes(word)));
  if (chosen.length === 0) {
    console.error(`no step is named like ${words.join(', ')}; npm test -- --list names them`);
    return false;
  }
  if (!setUpRust() || !setUpNpm()) return false;
  const env = { ...process.env };
  if (env.CI) env.CARGO_BUILD_JOBS ??= CI_JOBS;
  return runSteps(chosen, { cwd: root, env });
}

process.exitCode = (await main(process.argv.slice(2))) ? 0 : 1;
