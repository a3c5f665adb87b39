// From a line of a file to its vertex and back.
import { expect, test } from 'vitest';
import { LineMarks } from '../src/state/marks';

/** Marks and steps as the preview makes them, for vertices that come from these lines, in pieces of some vertices. */
function marksOf(lines: readonly number[], piece: number): LineMarks {
  const marks = new LineMarks();
  for (let from = 0; from < lines.length; from += piece) {
    const pairs: number[] = [];
    const steps = lines.slice(from, from + piece).map((line, at) => {
      const vertex = from + at;
      const step = Math.min(255, line - (lines[vertex - 1] ?? 0));
      if (step === 255 || vertex % 32 === 0) pairs.push(line, vertex);
      return step;
    });
    marks.append(Uint32Array.from(pairs));
    marks.appendSteps(Uint8Array.from(steps));
  }
  return marks;
}

test('every vertex has its line, and every line its last vertex', () => {
  const lines: number[] = [];
  // Arcs of several vertices, lines without any, and long comments.
  for (let line = 7; lines.length < 20_000; line += [1, 1, 0, 0, 3, 254, 255, 4000][lines.length % 8] ?? 1)
    lines.push(line);
  const marks = marksOf(lines, 1000);
  for (let vertex = 0; vertex < lines.length; vertex += 1) expect(marks.lineAt(vertex)).toBe(lines[vertex]);
  for (let vertex = 0; vertex < 500; vertex += 1) {
    const line = lines[vertex] ?? 0;
    expect(marks.vertexAt(line)).toBe(lines.lastIndexOf(line));
    expect(marks.vertexAt(line - 1)).toBe(
      Math.max(
        0,
        lines.findLastIndex((one) => one < line),
      ),
    );
  }
  expect(marks.vertexAt(1e9)).toBe(lines.length - 1);
});

test('what has not come yet is not known', () => {
  const marks = marksOf([3, 4, 5], 3);
  expect([marks.lineAt(2), marks.lineAt(3)]).toEqual([5, null]);
  expect([new LineMarks().lineAt(0), new LineMarks().vertexAt(9)]).toEqual([null, 0]);
});
