// A file in large pieces, whole and in order.
import { expect, test } from 'vitest';
import { SlicedFile } from '../src/preview/sliced_file';

test.each([0, 1, 100_000, 3_000_000])('a file of %i bytes comes whole and in order', async (size) => {
  const bytes = Uint8Array.from({ length: size }, (_, at) => (at * 7 + (at >> 8)) & 255);
  const file = new SlicedFile(new Blob([bytes]));
  let at = 0;
  for (let piece = await file.next(); piece; piece = await file.next()) {
    expect(Buffer.compare(piece, bytes.subarray(at, at + piece.byteLength))).toBe(0);
    at += piece.byteLength;
    expect(file.bytesRead).toBe(at);
  }
  expect(at).toBe(size);
  expect(await file.next()).toBeUndefined();
});

test('one piece is fetched ahead, and no more', async () => {
  const blob = new Blob([new Uint8Array(10_000_000)]);
  const asked: number[] = [];
  const slice = blob.slice.bind(blob);
  Object.defineProperty(blob, 'slice', {
    value: (from: number, to: number) => {
      asked.push(to - from);
      return slice(from, to);
    },
  });
  const file = new SlicedFile(blob);
  await file.next();
  expect(asked).toHaveLength(2);
  await file.next();
  expect(asked).toHaveLength(3);
  expect(Math.max(...asked)).toBeLessThanOrEqual(1024 * 1024);
});

test('a file that cannot be read is said to be so when its bytes are asked for', async () => {
  const file = new Blob(['G28\n'.repeat(100_000)]);
  const slice = file.slice.bind(file);
  const broken = { arrayBuffer: () => Promise.reject(new Error('gone')) } as unknown as Blob;
  Object.defineProperty(file, 'slice', {
    value: (from: number, to: number) => (from === 0 ? slice(from, to) : broken),
  });
  const pieces = new SlicedFile(file);
  expect((await pieces.next())?.byteLength).toBeGreaterThan(0);
  await expect(pieces.next()).rejects.toThrow('gone');
});
