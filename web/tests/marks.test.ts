// Lines and vertices find each other, wherever the marks lie.
import { expect, test } from 'vitest';
import { LineMarks } from '../src/state/marks';

/** The line of each vertex; a mark every so many vertices, and where a step is too long. */
function marksOf(lines: readonly number[], every: number): LineMarks {
  const marks = new LineMarks();
  lines.forEach((line, vertex) => {
    const step = line - (lines[vertex - 1] ?? 0);
    marks.appendSteps(Uint8Array.of(Math.min(step, 255)));
    if (vertex % every === every - 1 || step >= 255) marks.append(Uint32Array.of(line, vertex));
  });
  return marks;
}

// Arcs have many vertices a line, comments none; there are long texts between some.
const LINES = Array.from({ length: 3000 }, (_, at) => at).reduce<number[]>((all, at) => {
  const last = all.at(-1) ?? 2;
  const step = at % 500 === 499 ? 4000 : at % 7 === 0 ? 0 : (at * at) % 5;
  all.push(last + step);
  return all;
}, []);

test.each([1, 5, 32, 10_000])('exactly, with a mark every %i vertices', (every) => {
  const marks = marksOf(LINES, every);
  LINES.forEach((line, vertex) => {
    expect(marks.lineAt(vertex)).toBe(line);
    const last = LINES.lastIndexOf(line);
    expect(marks.vertexAt(line)).toBe(last);
    const next = LINES[last + 1];
    if (next !== undefined) expect(marks.vertexAt(next - 1)).toBe(last);
  });
});

test('before the first vertex, behind the last, and of an empty file', () => {
  const marks = marksOf(LINES, 32);
  expect([marks.vertexAt(0), marks.vertexAt(1e9)]).toEqual([0, LINES.length - 1]);
  expect(marks.lineAt(LINES.length)).toBeNull();
  expect([new LineMarks().vertexAt(9), new LineMarks().lineAt(0)]).toEqual([0, null]);
});

test('without steps a line is found by the mark before it', () => {
  const marks = new LineMarks();
  marks.append(Uint32Array.of(10, 3, 20, 30));
  expect([marks.vertexAt(9), marks.vertexAt(10), marks.vertexAt(19), marks.vertexAt(99)]).toEqual([
    0, 3, 3, 30,
  ]);
});
