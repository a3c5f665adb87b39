// The sparse list of lines: every place it names is the beginning of that line, however the bytes come.
import { expect, test } from 'vitest';
import { LineIndex } from '../src/preview/line_index';

const bytesOf = (text: string): Uint8Array => new TextEncoder().encode(text);
const lineAt = (text: string, number: number): string => text.split('\n')[number - 1] ?? '';
const TEXT = Array.from({ length: 500 }, (_, at) => `G1 X${at * at}`).join('\n');

function indexOf(text: string, piece: number, stride: number, max: number): LineIndex {
  const index = new LineIndex(stride, max);
  const bytes = bytesOf(text);
  for (let at = 0; at < bytes.length; at += piece) index.add(bytes.subarray(at, at + piece));
  return index;
}

test.each([
  [1, 4, 1000],
  [7, 4, 1000],
  [64, 1, 8],
  [10_000, 3, 5],
  [10_000, 1024, 2],
])('pieces of %i bytes, every %i lines, %i places at most', (piece, stride, max) => {
  const index = indexOf(TEXT, piece, stride, max);
  expect(index.lines).toBe(500);
  for (let line = 1; line <= 500; line += 1) {
    const place = index.before(line);
    expect(place.line).toBeLessThanOrEqual(line);
    const rest = new TextDecoder().decode(bytesOf(TEXT).subarray(place.offset));
    expect(rest.split('\n')[0]).toBe(lineAt(TEXT, place.line));
  }
});

test('with room, no more than the stride lies between a line and its place', () => {
  const index = indexOf(TEXT, 100, 16, 1000);
  for (let line = 1; line <= 500; line += 1) expect(line - index.before(line).line).toBeLessThan(16);
});

test('the places stay few and their lines near, however many lines there are', () => {
  const index = new LineIndex(1, 16);
  const lines = bytesOf('\n'.repeat(1000));
  for (let times = 0; times < 100; times += 1) index.add(lines);
  expect(index.lines).toBe(100_000);
  expect(index.before(100_000).line).toBeGreaterThan(100_000 * (7 / 8) - 1);
  expect(index.before(50_000).offset).toBe(index.before(50_000).line - 1);
});

test('only line feeds end lines, at any place in memory', () => {
  const text = '\u000b\n\u0009\u000a\u0000\n\u008a\n\n\n\n\nX\u010a\n'.repeat(40);
  const bytes = bytesOf(text);
  const ends = bytes.filter((byte) => byte === 10).length;
  for (let shift = 0; shift < 9; shift += 1) {
    const memory = new Uint8Array(bytes.length + shift);
    memory.set(bytes, shift);
    for (const stride of [1, 3, 1024]) {
      const index = new LineIndex(stride, 1000);
      index.add(memory.subarray(shift, shift + 5));
      index.add(memory.subarray(shift + 5));
      expect(index.lines).toBe(ends);
      const { line, offset } = index.before(ends);
      expect(bytes.subarray(0, offset).filter((byte) => byte === 10)).toHaveLength(line - 1);
      expect(offset === 0 || bytes[offset - 1] === 10).toBe(true);
    }
  }
});

test('an empty file, and one without an end of its last line', () => {
  expect(new LineIndex().lines).toBe(0);
  expect(new LineIndex().before(1)).toEqual({ line: 1, offset: 0 });
  expect(indexOf('G28', 1, 4, 4).lines).toBe(1);
  expect(indexOf('G28\n', 1, 4, 4).lines).toBe(1);
});
