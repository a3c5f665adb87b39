// The native command on the samples, as a user runs it: exit status, JSON, and what a noisy line must not change.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { closeSync, mkdtempSync, openSync, readFileSync, rmSync, writeFileSync, writeSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { platform } from 'node:process';
import { after, test } from 'node:test';
import { gzipSync } from 'node:zlib';

import { root, stepcast } from '../lib/target.mjs';

const command = stepcast();
const sample = (name) => join(root, 'samples', name);
const [part, small, config] = ['test-part.gcode', 'test-part-small.gcode', 'printer.cfg'].map(sample);
const folder = mkdtempSync(join(tmpdir(), 'stepcast-test-'));
after(() => rmSync(folder, { recursive: true }));

const MOTORS = ['extruder', 'stepper_x', 'stepper_y', 'stepper_z'];

/** Runs the command; gives its exit status and both outputs. */
function run(...args) {
  return new Promise((resolve, reject) => {
    const child = spawn(command, args, { stdio: ['ignore', 'pipe', 'pipe'] });
    const [stdout, stderr] = [[], []];
    child.stdout.on('data', (chunk) => stdout.push(chunk));
    child.stderr.on('data', (chunk) => stderr.push(chunk));
    child.on('error', reject);
    child.on('close', (status) => resolve({ status, stdout: Buffer.concat(stdout).toString(), stderr: Buffer.concat(stderr).toString() }));
  });
}

/** Runs the command with --json; gives the object, after the exit status was the expected one. */
async function json(expected, ...args) {
  const { status, stdout, stderr } = await run(...args, '--json');
  assert.equal(status, expected, stderr);
  return JSON.parse(stdout);
}

function file(name, content) {
  const path = join(folder, name);
  writeFileSync(path, content);
  return path;
}

const plan = (path) => json(0, 'plan', path, '--config', config);

test('check: the samples have nothing to complain about', async () => {
  for (const path of [part, small]) {
    const { status, stdout, stderr } = await run('check', path, '--config', config);
    assert.equal(status, 0, stdout + stderr);
  }
});

test('check: an unknown macro is named with its line and blocks', async () => {
  const path = file('macro.gcode', 'G28\nSTART_PRINT BED=60\nG1 X10 F3000\n');
  const { status, stdout } = await run('check', path);
  assert.equal(status, 1);
  assert.match(stdout, /2/);
  assert.match(stdout, /START_PRINT/);
});

test('plan: the sample takes about what its slicer says', async () => {
  const report = await plan(part);
  assert.ok(report.print_time_s > 600 && report.print_time_s < 1200, `${report.print_time_s} s`);
  assert.deepEqual(Object.keys(report.motors).toSorted(), MOTORS);
  for (const name of MOTORS) {
    const { steps, queue_steps: queueSteps, peak_steps_per_s: peak } = report.motors[name];
    assert.ok(steps > 0 && queueSteps > 0 && queueSteps <= steps && peak > 0, name);
  }
  const steps = Object.values(report.motors).reduce((sum, motor) => sum + motor.steps, 0);
  assert.ok(Math.abs(report.bytes / steps - report.bytes_per_step) < 1e-6);
  assert.ok(report.max_step_error_us <= 25, `${report.max_step_error_us} us`);
  const filament = Number(/^; filament used \[mm\] = (.*)$/m.exec(readFileSync(part, 'utf8'))[1]);
  assert.ok(Math.abs(report.filament_mm - filament) < 10, `${report.filament_mm} mm, the slicer says ${filament}`);
});

test('plan: a gzip file gives what the plain one gives', async () => {
  const packed = file('small.gcode.gz', gzipSync(readFileSync(small)));
  assert.deepEqual(await plan(packed), await plan(small));
});

/** Writes a file of any size, piece by piece. */
function longFile(name, lines) {
  const path = join(folder, name);
  const out = openSync(path, 'w');
  let piece = '';
  for (const line of lines) {
    piece += line;
    if (piece.length > 1 << 20) {
      writeSync(out, piece);
      piece = '';
    }
  }
  writeSync(out, piece);
  closeSync(out);
  return path;
}

/** An hour of pieces of 10 µm, to and fro: 100 MB. */
function* crawling() {
  yield 'G28\nM83\nG1 X20 Y20 F600\n';
  let [x, y, step] = [20_000, 20_000, 10];
  for (let piece = 0; piece < 3_600_000; piece += 1) {
    x += step;
    if (x === 20_000 || x === 180_000) {
      step = -step;
      y += 10;
    }
    yield `G1 X${(x / 1000).toFixed(3)} Y${(y / 1000).toFixed(3)} E0.00033\n`;
  }
}

test('plan: 100 MB take no more memory than a small file', { skip: platform !== 'linux' && 'memory is read from /proc' }, async () => {
  const peaks = [];
  for (const path of [small, longFile('hour.gcode', crawling())]) {
    const child = spawn(command, ['plan', path, '--config', config, '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
    let [output, peak] = ['', 0];
    child.stdout.on('data', (data) => (output += data));
    const look = () => {
      try {
        peak = Number(/VmHWM:\s+(\d+) kB/.exec(readFileSync(`/proc/${child.pid}/status`, 'utf8'))?.[1] ?? peak);
      } catch {
        // It is over.
      }
    };
    const looks = setInterval(look, 5);
    const status = await new Promise((resolve) => child.on('close', resolve));
    clearInterval(looks);
    assert.equal(status, 0);
    peaks.push({ kib: peak, seconds: JSON.parse(output).print_time_s });
  }
  const [little, much] = peaks;
  assert.ok(much.seconds > 3600 && much.seconds < 3700, `${much.seconds} s`);
  assert.ok(little.kib > 0 && much.kib < little.kib + 16 * 1024, JSON.stringify(peaks));
});

test('plan: what makes no sense moves nothing, and all ends soon', async () => {
  const start = performance.now();
  const zero = await plan(longFile('zero.gcode', ['G28\nG1 X10 F600\n', ...Array(1_000_000).fill('G1 X10\n')]));
  assert.deepEqual([zero.moves, zero.motors.stepper_x.steps], [1, 800]);
  const absurd = ['X1e300', 'Xnan', 'Xinf', 'X-1e-300', `X${'9'.repeat(60)}`, 'X1e', 'X', 'X--1', 'X0x10'];
  const path = file('absurd.gcode', `G28\nG1 X10 F600\n${absurd.map((words) => `G1 ${words}\n`).join('')}G1 X20`);
  const report = await plan(path);
  assert.ok(report.print_time_s < 60 && report.motors.stepper_x.steps < 10_000, JSON.stringify(report));
  const { status, stdout } = await run('check', path, '--config', config);
  assert.equal(status, 1);
  for (const line of [3, 4, 5, 6, 7, 8, 9, 10, 11]) assert.match(stdout, new RegExp(`absurd.gcode:${line}:.*error`), stdout);
  assert.ok(performance.now() - start < 60_000);
});

/** A print on the virtual printer that has to come out right. */
async function print(path, ...args) {
  const report = await json(0, 'simulate', path, '--config', config, ...args);
  assert.equal(report.result, 'done', report.reason);
  for (const [name, motor] of Object.entries(report.motors)) {
    assert.equal(motor.counted_steps, motor.planned_steps, name);
    assert.equal(motor.lost_steps, 0, name);
  }
  assert.ok(report.path_error_max_mm <= 0.02, `${report.path_error_max_mm} mm off the path`);
  assert.ok(report.temperature_error_max_c <= 3, `${report.temperature_error_max_c} degrees off`);
  return report;
}

test('simulate: every pulse of the sample arrives, and fast', async () => {
  const start = performance.now();
  const report = await print(part);
  const seconds = (performance.now() - start) / 1000;
  assert.ok(report.min_queued_s >= 2, `${report.min_queued_s} s queued`);
  assert.equal(report.retransmitted_bytes, 0);
  assert.ok(report.print_time_s / seconds >= 100, `${(report.print_time_s / seconds).toFixed(0)}x real time`);
});

test('simulate: a line that corrupts 1 % of all bytes changes no pulse', async () => {
  const clean = await print(part);
  const noisy = await print(part, '--fault', 'corrupt=0.01');
  assert.ok(noisy.retransmitted_bytes > 0);
  assert.match(clean.pulse_digest, /^[0-9a-f]{16}$/);
  assert.equal(noisy.pulse_digest, clean.pulse_digest);
});

test('simulate: the small sample prints on both boards', async () => {
  await print(small);
  await print(small, '--board', 'stm32f103');
});

test('simulate: a print that goes wrong ends with status 1 and says why', async () => {
  const report = await json(1, 'simulate', small, '--config', config, '--fault', 'sensor-open=extruder@60');
  assert.notEqual(report.result, 'done');
  assert.ok(report.reason.length > 0);
});

test('wrong usage is status 2, a file that is no G-code is status 1', async () => {
  assert.equal((await run('plan', part)).status, 2);
  assert.equal((await run('fly')).status, 2);
  const model = await run('plan', sample('test-part.stl'), '--config', config);
  assert.equal(model.status, 1);
  assert.match(model.stderr, /STL/i);
  assert.equal((await run('check', file('empty.gcode', ''))).status, 1);
});

test('completion scripts are written for the common shells', async () => {
  for (const shell of ['bash', 'zsh', 'fish', 'powershell']) {
    const { status, stdout } = await run('completions', shell);
    assert.equal(status, 0);
    assert.match(stdout, /stepcast/);
  }
});
