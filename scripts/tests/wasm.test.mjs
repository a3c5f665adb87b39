// The planner as WebAssembly gives the very bytes that the native command gives.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';

import { root, stepcast, targetFolder } from '../lib/target.mjs';

const planner = createRequire(import.meta.url)(join(targetFolder(), 'wasm-bindings', 'node', 'planner_wasm.js'));
const command = stepcast();
const config = join(root, 'samples', 'printer.cfg');
const folder = mkdtempSync(join(tmpdir(), 'stepcast-wasm-'));
after(() => rmSync(folder, { recursive: true }));

const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');

/** Plans in WebAssembly, feeding at most `chunk` bytes at once. */
function planInWasm(gcode, chunk) {
  const stream = new planner.PlanStream(readFileSync(config, 'utf8'));
  const blocks = [];
  for (let at = 0; at < gcode.length; ) {
    const end = at + Math.min(chunk, stream.wants());
    assert.ok(end > at, 'a planner that was run wants more');
    blocks.push(stream.feed(gcode.subarray(at, end)));
    at = end;
  }
  const plan = stream.finish();
  blocks.push(plan.blocks);
  return { blocks: Buffer.concat(blocks), printTime: plan.print_time_s, steps: [...plan.steps].map(Number) };
}

for (const sample of ['test-part.gcode', 'test-part-small.gcode']) {
  test(`${sample}: the same bytes natively and in WebAssembly, however it is fed`, () => {
    const file = join(root, 'samples', sample);
    const dump = join(folder, `${sample}.blocks`);
    const args = ['plan', file, '--config', config, '--json', '--dump-stream', dump];
    const { status, stdout, stderr } = spawnSync(command, args, { encoding: 'utf8' });
    assert.equal(status, 0, stderr);
    const native = { report: JSON.parse(stdout), blocks: readFileSync(dump) };
    const gcode = readFileSync(file);
    const whole = planInWasm(gcode, Infinity);
    assert.ok(native.blocks.length > 50_000, `${native.blocks.length} bytes are too few to mean anything`);
    assert.equal(whole.blocks.length, native.blocks.length);
    assert.equal(sha256(whole.blocks), sha256(native.blocks));
    assert.equal(sha256(planInWasm(gcode, 777).blocks), sha256(native.blocks));
    assert.equal(native.report.bytes, native.blocks.length);
    assert.equal(whole.printTime, native.report.print_time_s);
    const names = ['stepper_x', 'stepper_y', 'stepper_z', 'extruder'];
    assert.deepEqual(whole.steps, names.map((name) => native.report.motors[name].steps));
  });
}

test('a configuration that cannot be used is an error with its line', () => {
  assert.throws(() => new planner.PlanStream('[printer]\nkinematics: hexapod\n'), /line/i);
});

test('a move before homing is an error, not a crash', () => {
  const stream = new planner.PlanStream(readFileSync(config, 'utf8'));
  assert.throws(() => stream.feed(Buffer.from('G1 X10 F3000\nG1 X20\nM400\n')), Error);
});
