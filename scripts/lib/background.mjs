// Runs a command beside everything else: quietly, with less right to the processor, and ended with all it started.
// Knows nothing of what the command does. Plain Node.
import { spawn, spawnSync } from 'node:child_process';
import { constants, setPriority } from 'node:os';

/** Of what a command says on each of its streams, the end is kept: the reason of a failure is there. In characters. */
const KEPT_MAX = 8000;

/**
 * Starts a command. `done` becomes { outcome: 'done' | 'failed' | 'ended', output }, where 'ended' is by `end()` and
 * `output` the end of what it said, errors last; it is over when all that it started is. Nothing is thrown: a program
 * that is not there is 'failed'. `said()` is what it has said so far.
 */
export function inBackground([program, ...args], { cwd, env } = {}) {
  const isWindows = process.platform === 'win32';
  // A process group of its own, so that what the command starts can be ended with it.
  const child = spawn(program, args, { cwd, env, detached: !isWindows, shell: isWindows, stdio: ['ignore', 'pipe', 'pipe'] });
  const said = { stdout: '', stderr: '' };
  const output = () => said.stdout + said.stderr;
  let isEnded = false;
  for (const stream of ['stdout', 'stderr']) {
    child[stream].setEncoding('utf8').on('data', (chunk) => {
      said[stream] = (said[stream] + chunk).slice(-KEPT_MAX);
    });
  }
  if (child.pid !== undefined) {
    try {
      setPriority(child.pid, constants.priority.PRIORITY_BELOW_NORMAL);
    } catch {
      // It may be over already, or the system may not allow it.
    }
  }
  const end = () => {
    if (isEnded || child.pid === undefined || child.exitCode !== null || child.signalCode !== null) return;
    isEnded = true;
    if (isWindows) spawnSync('taskkill', ['/pid', String(child.pid), '/t', '/f'], { stdio: 'ignore' });
    else {
      try {
        process.kill(-child.pid, 'SIGTERM');
      } catch {
        // All of it is over.
      }
    }
  };
  const atExit = () => end();
  process.once('exit', atExit);
  const done = new Promise((resolve) => {
    const settle = (outcome) => {
      process.off('exit', atExit);
      resolve({ outcome, output: output() });
    };
    child.once('error', (error) => {
      said.stderr += error.message;
      settle('failed');
    });
    child.once('close', (code) => settle(isEnded ? 'ended' : code === 0 ? 'done' : 'failed'));
  });
  return { done, end, said: output };
}
