// Where cargo puts what it builds. Knows nothing of what that is.
import { spawnSync } from 'node:child_process';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

/** The repository's root. */
export const root = dirname(dirname(dirname(fileURLToPath(import.meta.url))));

/** Cargo's target folder, wherever the environment or a configuration puts it. */
export function targetFolder() {
  const args = ['metadata', '--no-deps', '--format-version', '1'];
  const { status, stdout, stderr } = spawnSync('cargo', args, { cwd: root, encoding: 'utf8', maxBuffer: 2 ** 26 });
  if (status !== 0) throw new Error(`cargo metadata failed: ${stderr}`);
  return JSON.parse(stdout).target_directory;
}

/** The native command. */
export function stepcast() {
  return join(targetFolder(), 'release', process.platform === 'win32' ? 'stepcast.exe' : 'stepcast');
}
