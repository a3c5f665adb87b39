// Installs what the repository pins: the Rust toolchain and the npm packages. Nothing else, and only when they changed.
// Knows nothing of what is built with them.
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';

import { root } from './target.mjs';
import { installArguments, isInstalled, missing, readToolchain } from './toolchain.mjs';

/** Runs a command with its output shown; true when it succeeded. */
export function shown(program, args, env = process.env) {
  console.log(`$ ${[program, ...args].join(' ')}`);
  const shell = process.platform === 'win32';
  return spawnSync(program, args, { cwd: root, stdio: 'inherit', shell, env }).status === 0;
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

/** `npm ci`, unless the lock file is the one that was installed last. */
function setUpNpm() {
  const lock = readFileSync(join(root, 'package-lock.json'), 'utf8');
  const stamp = join(root, 'node_modules', '.stepcast-lock');
  const digest = createHash('sha256').update(lock).digest('hex');
  if (existsSync(stamp) && readFileSync(stamp, 'utf8') === digest) return true;
  if (!shown('npm', ['ci', '--no-audit', '--no-fund'])) {
    console.error('npm could not install the packages of package-lock.json: is the network there?');
    return false;
  }
  mkdirSync(dirname(stamp), { recursive: true });
  writeFileSync(stamp, digest);
  return true;
}

/** Names what is missing on this machine and installs what is pinned. True when all is there. */
export function setUp() {
  const lacking = missing();
  if (lacking.length > 0) {
    console.error(`Missing on this machine:\n${lacking.map((line) => `  ${line}`).join('\n')}`);
    return false;
  }
  return setUpRust() && setUpNpm();
}
