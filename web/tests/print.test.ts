// How far a print is, and what the tab says of it.
import { expect, test } from 'vitest';
import type { Layer } from '../src/preview/protocol';
import { LineMarks } from '../src/state/marks';
import { layerOf, progressOf, titleOf } from '../src/state/print';
import { mm, seconds, share } from '../src/units';
import { summaryOf } from './fake_summary';

const layers: Layer[] = [0, 100, 250].map((first, at) => ({
  first,
  z: mm(0.2 * (at + 1)),
  line: first + 10,
  time: seconds(10),
}));
const plan = summaryOf({
  lines: 400,
  moves: 300,
  filament: mm(900),
  vertices: 400,
  layers,
  time: seconds(200),
});
const file = { name: 'part.gcode', blob: new Blob() };

function marksOf(...pairs: readonly (readonly [number, number])[]): LineMarks {
  const marks = new LineMarks();
  for (const pair of pairs) marks.append(Uint32Array.from(pair));
  return marks;
}

const now = (line: number, elapsed: number, speed = 1, filament = 0) => ({
  line,
  elapsed: seconds(elapsed),
  speedFactor: share(speed),
  position: [mm(0), mm(0), mm(0), mm(filament)] as const,
});

test('marks give the last vertex at or before a line, however many there are', () => {
  const marks = new LineMarks();
  for (let at = 0; at < 5000; at++) marks.append(Uint32Array.of(at * 3 + 1, at * 7));
  expect([0, 1, 2, 4, 14_998, 1e9].map((line) => marks.vertexAt(line))).toEqual([
    0,
    0,
    0,
    7,
    4999 * 7,
    4999 * 7,
  ]);
});

test.each([
  [0, 1],
  [99, 1],
  [100, 2],
  [249, 2],
  [250, 3],
  [9999, 3],
])('vertex %i is in layer %i', (vertex, layer) => {
  expect(layerOf(layers, vertex)).toBe(layer);
});

test('a file without layers has none', () => expect(layerOf([], 5)).toBe(0));

test('progress goes by the plan’s time, and what is left by the speed that is set', () => {
  const job = { file, summary: plan, marks: marksOf([10, 20], [200, 120]), from: null };
  expect(progressOf(job, now(210, 50, 2, 350), 100)).toEqual({
    share: 0.25,
    elapsed: 50,
    left: 75,
    layer: 2,
    layers: 3,
    line: 210,
    filament: 250,
  });
  expect(progressOf(job, now(0, 0)).layer).toBe(0);
  expect(progressOf(job, now(400, 1e6))).toMatchObject({ share: 1, left: 0 });
});

test('where the plan has no time, lines count and nothing is said of what is left', () => {
  const job = { file, summary: { ...plan, time: null }, marks: marksOf(), from: null };
  expect(progressOf(job, now(100, 50))).toMatchObject({ share: 0.25, left: null });
});

test('filament is not known where the position is not', () => {
  const job = { file, summary: plan, marks: marksOf(), from: null };
  expect(progressOf(job, { ...now(1, 1), position: null }).filament).toBeNull();
});

test.each([
  ['part.gcode', 0.427, 'printing', '42 % – part.gcode – Stepcast'],
  ['part.gcode', 0.5, 'paused', 'Paused, 50 % – part.gcode – Stepcast'],
  ['part.gcode', null, 'done', 'Done – part.gcode – Stepcast'],
  ['part.gcode', null, 'stopped', 'Stopped – part.gcode – Stepcast'],
  ['part.gcode', null, '', 'Stepcast'],
  [null, null, 'done', 'Stepcast'],
])('the title of %s at %s, %s', (name, part, state, title) => {
  expect(titleOf(name, part, state)).toBe(title);
});
