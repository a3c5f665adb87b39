// A whole print inside WebAssembly: session and virtual printer in one loop, on one virtual clock, as the page runs them;
// and the preview of a file. Knows the bindings for Node, not the page.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { test } from 'node:test';
import { brotliCompressSync } from 'node:zlib';

import { root, targetFolder } from '../lib/target.mjs';

const folder = join(targetFolder(), 'wasm-bindings');
const wasm = createRequire(import.meta.url)(join(folder, 'node', 'planner_wasm.js'));
const config = readFileSync(join(root, 'samples', 'printer.cfg'), 'utf8');
/** The session is called again after this time at the earliest, whatever it asks for. */
const WAKE_MIN_S = 50e-6;
/** The module's size as it travels, in bytes. */
const BROTLI_BYTES_MAX = 480 * 1024;

/** A square of two layers; what homing does not touch. */
const tiny = `M83
G90
M104 S200
M109 S200
G1 X100 Y100 Z0.4 F6000
;LAYER_CHANGE
;Z:0.4
;HEIGHT:0.4
;TYPE:External perimeter
;WIDTH:0.45
G1 X120 E1.2 F1800
G1 Y120 E1.2
G1 X100 E1.2
G1 Y100 E1.2
G1 E-0.8 F2100
;LAYER_CHANGE
;Z:0.8
;HEIGHT:0.4
G1 Z0.8 F600
G1 X110 Y110 F9000
G1 E0.8 F2100
G2 X110 Y110 I5 J0 E2 F1800
M104 S0
`;

/** A session and a virtual printer that share a clock. */
class Pair {
  constructor({ board, faults = '' } = {}) {
    this.printer = new wasm.VirtualPrinter(config, board, 7, faults);
    this.session = wasm.PrinterSession.for_virtual_printer(config, board, this.printer.now_s());
    this.events = [];
    this.gcode = undefined;
    this.moves = 0;
  }

  attend() {
    const now = this.printer.now_s();
    this.feed();
    const bytes = this.session.poll(now);
    if (bytes.length > 0) this.printer.write(bytes);
    this.events.push(...JSON.parse(this.session.take_events()));
    const moves = this.session.take_moves(now);
    assert.equal(moves.length % 11, 0);
    this.moves += moves.length / 11;
  }

  feed() {
    while (this.gcode) {
      const wants = this.session.job_wants();
      if (wants === 0) return;
      this.session.job_feed(this.gcode.subarray(0, wants));
      this.gcode = this.gcode.subarray(wants);
      if (this.gcode.length > 0) continue;
      this.session.job_end();
      this.gcode = undefined;
    }
  }

  /** Lets virtual time pass until `done` says so. */
  runUntil(done, limitS = 3600) {
    const end = this.printer.now_s() + limitS;
    this.attend();
    while (!done(this)) {
      const now = this.printer.now_s();
      assert.ok(now < end, `nothing came of it in ${limitS} s: ${JSON.stringify(this.events.slice(-5))}`);
      const bytes = this.printer.run_until_s(Math.max(this.session.wake_s(), now + WAKE_MIN_S));
      if (bytes.length > 0) this.session.receive(bytes, this.printer.now_s());
      this.attend();
    }
  }

  saw(type) {
    return this.events.some((event) => event.type === type);
  }

  snapshot() {
    return JSON.parse(this.session.snapshot(this.printer.now_s()));
  }

  state() {
    return JSON.parse(this.printer.state());
  }

  request(request) {
    this.session.request(JSON.stringify(request), this.printer.now_s());
  }

  connectAndHome() {
    this.runUntil(() => this.snapshot().phase === 'ready');
    this.request({ type: 'home', axes: [] });
    this.runUntil(() => this.events.filter((event) => event.type === 'homed').length === 3);
    this.runUntil(() => this.snapshot().queued_s === null);
    // The board has made what was queued a little later.
    const rest = this.printer.now_s() + 1;
    this.runUntil(() => this.printer.now_s() > rest);
  }

  print(gcode) {
    this.gcode = Buffer.from(gcode);
    this.session.start_job(JSON.stringify({ confirmed_lines: [], confirm_all: false }), this.printer.now_s());
  }
}

const error = (act) => {
  try {
    act();
  } catch (thrown) {
    return JSON.parse(thrown.message);
  }
  return assert.fail('nothing was thrown');
};

function planned(gcode) {
  const stream = new wasm.PlanStream(config);
  stream.feed(Buffer.from(`G28\n${gcode}`));
  return [...stream.finish().steps].map(Number);
}

for (const board of ['rp2040', 'stm32f103']) {
  test(`a print on a virtual ${board}: every planned step is a pulse, and it ends where the file ends`, () => {
    const pair = new Pair({ board });
    pair.connectAndHome();
    const before = pair.state();
    assert.ok(before.motors.every((motor) => motor.lost_steps === 0));
    pair.print(tiny);
    let fastest = 0;
    pair.runUntil(() => {
      const speeds = pair.session.planned_speed(pair.printer.now_s(), 1, 5);
      for (let at = 1; at < speeds.length; at += 2) fastest = Math.max(fastest, speeds[at]);
      return pair.saw('job-done') || pair.saw('error');
    });
    // The travel at F9000.
    assert.ok(fastest > 100 && fastest < 150.001, `${fastest} mm/s`);
    const rest = pair.printer.now_s() + 2;
    pair.runUntil(() => pair.printer.now_s() > rest);
    assert.deepEqual(pair.events.filter((event) => event.type === 'error'), []);
    const after = pair.state();
    const made = after.motors.map((motor, index) => motor.pulses - before.motors[index].pulses);
    assert.deepEqual(made, planned(tiny));
    assert.ok(made.every((steps) => steps > 0), `${made}`);
    assert.ok(after.motors.every((motor) => motor.lost_steps === 0));
    // Switches close a step or two from where they should.
    [110, 110, 0.8].forEach((end, axis) => {
      assert.ok(Math.abs(after.motors[axis].position_mm - end) < 0.05, `${axis}: ${after.motors[axis].position_mm}`);
    });
    assert.equal(after.shutdown, null);
    const snapshot = pair.snapshot();
    assert.equal(snapshot.job.status, 'none');
    assert.equal(snapshot.job.fed_bytes, tiny.length);
    assert.deepEqual(snapshot.homed, [true, true, true]);
    assert.equal(snapshot.temperatures.length, 2);
    assert.ok(snapshot.job.elapsed_s > 1 && pair.saw('progress') && pair.moves > 5);
    assert.ok(Math.abs(snapshot.live_mm[0] - 110) < 0.001, `${snapshot.live_mm}`);
  });
}

test('a sensor that comes off stops everything, with what to do', () => {
  const pair = new Pair({ faults: 'sensor-open=extruder@60' });
  pair.runUntil(() => pair.snapshot().phase === 'ready');
  pair.request({ type: 'set-temperature', heater: 'extruder', target_c: 200 });
  pair.runUntil(() => pair.saw('error'), 300);
  const { error: told } = pair.events.find((event) => event.type === 'error');
  assert.ok(['sensor-below-min', 'board-sensor-range'].includes(told.code), told.code);
  for (const text of [told.what_happened, told.what_is_safe, told.what_to_do]) assert.ok(text.length > 20);
  assert.equal(pair.snapshot().phase, 'shutdown');
  pair.runUntil(() => pair.state().heaters.every((heater) => heater.duty === 0), 5);
});

test('errors are thrown as the catalogue has them', () => {
  const bad = '[printer]\nkinematics: hexapod\n';
  assert.equal(error(() => new wasm.PrinterSession(bad, 0)).code, 'config-invalid');
  assert.match(error(() => new wasm.PlanStream(bad)).what_happened, /line 2/);
  assert.equal(error(() => new wasm.VirtualPrinter(config, 'z80', 1, '')).code, 'config-unsupported');
  assert.equal(error(() => new wasm.VirtualPrinter(config, undefined, 1, 'rain@3')).code, 'config-unsupported');
  const session = new wasm.PrinterSession(config, 0);
  assert.equal(error(() => session.request('{"type":"pause"}', 0)).code, 'not-connected');
  assert.equal(error(() => session.request('{"type":"dance"}', 0)).code, 'internal');
  const report = JSON.parse(wasm.parse_config(bad));
  assert.equal(report.machine, null);
  assert.ok(report.findings.some((finding) => finding.line === 2 && finding.severity === 'error'));
  assert.deepEqual(JSON.parse(wasm.parse_config(wasm.usual_printer_cfg())).machine.max_mm.length, 3);
  assert.equal(JSON.parse(wasm.file_kind(Buffer.from('GCDE\x01\x00'), 'a.gcode')).kind, 'binary-gcode');
});

/** Reads a whole file through the preview, as a worker does. */
function preview(gcode, printerCfg) {
  const reader = new wasm.Preview(printerCfg);
  const words = [];
  const take = () => {
    for (let some = reader.take_vertices(); some.length > 0; some = reader.take_vertices()) words.push(some);
  };
  for (let at = 0; at < gcode.length; ) {
    const end = Math.min(gcode.length, at + Math.min(reader.wants(), 65_536));
    reader.feed(gcode.subarray(at, end));
    at = end;
    take();
    assert.equal(reader.progress, at);
  }
  reader.finish();
  take();
  const [origin, step] = [reader.origin_mm, reader.step_mm];
  return { words: words.flatMap((some) => [...some]), origin, step, summary: JSON.parse(reader.summary()) };
}

test('the preview of a sample', () => {
  const gcode = readFileSync(join(root, 'samples', 'test-part.gcode'));
  const { words, origin, step, summary } = preview(gcode, config);
  assert.equal(words.length, 4 * summary.vertices);
  assert.ok(summary.printable && summary.layers.length > 1 && summary.print_time_s > 60);
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  const place = (vertex, axis) => origin[axis] + (words[4 * vertex + axis] & 0xfffff) * step;
  for (let vertex = 1; vertex < summary.vertices; vertex += 1) {
    if (words[4 * vertex + 2] & (1 << 25)) continue;
    for (let axis = 0; axis < 3; axis += 1) {
      const [from, to] = [place(vertex - 1, axis), place(vertex, axis)];
      low[axis] = Math.min(low[axis], from, to);
      high[axis] = Math.max(high[axis], from, to);
    }
  }
  [low, high].forEach((corner, which) => {
    corner.forEach((value, axis) => assert.ok(Math.abs(value - summary.bounds_mm[which][axis]) < 0.001));
  });
  const stream = new wasm.PlanStream(config);
  for (let at = 0; at < gcode.length; at += 30_000) stream.feed(gcode.subarray(at, at + 30_000));
  const time = stream.finish().print_time_s;
  assert.ok(Math.abs(summary.print_time_s - time) < 0.001 * time, `${summary.print_time_s} ${time}`);
});

test('a preview is told when it is fed too much, and does without a machine', () => {
  const reader = new wasm.Preview(undefined);
  const tooMuch = Buffer.alloc(reader.wants() + 1, 'G1 X1\n');
  assert.equal(error(() => reader.feed(tooMuch)).code, 'internal');
  const { summary } = preview(Buffer.from('G28\nG1 X5 E1 F600\nFOO\n'), undefined);
  assert.equal(summary.print_time_s, null);
  assert.deepEqual(summary.blocking.map(({ line }) => line), [3]);
});

test('the module is small', (context) => {
  const bytes = readFileSync(join(folder, 'web', 'planner_wasm_bg.wasm'));
  const packed = brotliCompressSync(bytes).length;
  context.diagnostic(`planner_wasm_bg.wasm: ${bytes.length} bytes, ${packed} with brotli`);
  assert.ok(packed <= BROTLI_BYTES_MAX, `${packed} bytes`);
});
