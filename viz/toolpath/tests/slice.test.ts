import { expect, test } from 'vitest';
import { VERTICES_PER_CHUNK, VertexStore } from '../src/chunks';
import { SLICE_MAX, sliceOf } from '../src/slice';
import { encodeVertex, positionMm } from '../src/vertex';

const header = { originMm: [0, 0, 0], stepMm: 1 } as const;
const COUNT = VERTICES_PER_CHUNK + 1000;

function stored(): VertexStore {
  const store = new VertexStore(header);
  const words = new Uint32Array(COUNT * 4);
  for (let at = 0; at < COUNT; at++) encodeVertex(header, words, at, { positionMm: [at, 1, 2] });
  store.append(words);
  return store;
}

test('vertices come as they went in, over the seam of two chunks too', () => {
  const store = stored();
  for (const first of [0, 1000, VERTICES_PER_CHUNK - 2]) {
    const words = sliceOf(store, { first, end: first + 5 });
    const found = [0, 1, 2, 3, 4].map((at) => positionMm(header, words, at)[0]);
    expect(found).toEqual([0, 1, 2, 3, 4].map((at) => first + at));
  }
});

test('never more than there are, nor than may be asked for', () => {
  const store = stored();
  expect(sliceOf(store, { first: COUNT - 2, end: COUNT + 9 }).length).toBe(2 * 4);
  expect(sliceOf(store, { first: COUNT + 2, end: COUNT + 9 }).length).toBe(0);
  expect(sliceOf(store, { first: 5, end: 3 }).length).toBe(0);
  expect(sliceOf(store, { first: 0, end: COUNT }).length).toBe(Math.min(SLICE_MAX, COUNT) * 4);
});
