import { describe, expect, test } from 'vitest';
import { LEAD_TEXELS, VERTICES_PER_CHUNK, VertexStore } from '../src/chunks';
import { encodeVertex, FLAGS, field, hasFlag } from '../src/vertex';

const HEADER = { originMm: [0, 0, 0], stepMm: 2 ** -10 } as const;

/** Vertices whose x, y and layer tell their number. */
function numbered(first: number, count: number): Uint32Array {
  const words = new Uint32Array(count * 4);
  for (let at = 0; at < count; at++) {
    const n = first + at;
    encodeVertex(HEADER, words, at, {
      positionMm: [(n & 1023) / 1024, (n >> 10) / 1024, 1],
      layer: n,
      feature: 'infill',
      flags: n === 0 ? FLAGS.break : 0,
    });
  }
  return words;
}

function filled(count: number, piece: number): VertexStore {
  const store = new VertexStore(HEADER);
  for (let at = 0; at < count; at += piece) store.append(numbered(at, Math.min(piece, count - at)));
  return store;
}

describe('the store of vertices', () => {
  test.each([1, 777, 50_000, 1 << 20])('pieces of %i vertices end up the same', (piece) => {
    const count = piece === 1 ? 3_000 : 2 * VERTICES_PER_CHUNK + 5;
    const store = filled(count, piece);
    expect(store.count).toBe(count);
    for (const chunk of store.chunks) {
      for (let at = 0; at < chunk.count; at += 97) {
        expect(field(chunk.data, LEAD_TEXELS + at, 'layer')).toBe((chunk.firstVertex + at) & 0xf_ffff);
      }
    }
  });

  test('each chunk has its neighbours before and behind', () => {
    const store = filled(2 * VERTICES_PER_CHUNK + 5, 10_000);
    expect(store.chunks.map(({ count }) => count)).toEqual([VERTICES_PER_CHUNK, VERTICES_PER_CHUNK, 5]);
    const [first, second] = store.chunks;
    if (!first || !second) throw new Error('no chunks');
    expect(field(second.data, 0, 'layer')).toBe(VERTICES_PER_CHUNK - 2);
    expect(field(second.data, 1, 'layer')).toBe(VERTICES_PER_CHUNK - 1);
    expect(field(first.data, LEAD_TEXELS + VERTICES_PER_CHUNK, 'layer')).toBe(VERTICES_PER_CHUNK);
  });

  test('behind the last vertex nothing looks like a neighbour', () => {
    const store = filled(10, 3);
    const chunk = store.chunks[0];
    expect(chunk && hasFlag(chunk.data, LEAD_TEXELS + 10, FLAGS.break)).toBe(true);
    expect(chunk?.rows).toBe(1);
  });

  test('a range is split among the chunks', () => {
    const store = filled(2 * VERTICES_PER_CHUNK + 5, 50_000);
    const parts = store.split({ first: VERTICES_PER_CHUNK - 3, end: 2 * VERTICES_PER_CHUNK + 2 });
    expect(parts.map(({ first, count }) => [first, count])).toEqual([
      [VERTICES_PER_CHUNK - 3, 3],
      [0, VERTICES_PER_CHUNK],
      [0, 2],
    ]);
    expect(store.split({ first: 5, end: 5 })).toEqual([]);
  });

  test('the box is that of the part: no travels, no skirt', () => {
    const store = new VertexStore(HEADER);
    const words = new Uint32Array(16);
    const place = (at: number, x: number, feature: 'skirt' | 'outerWall', flags = 0): void =>
      encodeVertex(HEADER, words, at, { positionMm: [x, x, 0.2], feature, flags });
    place(0, 900, 'outerWall', FLAGS.break);
    place(1, 1, 'skirt');
    place(2, 10, 'outerWall');
    place(3, 20, 'outerWall');
    store.append(words);
    expect(store.box()?.min.slice(0, 2)).toEqual([10, 10]);
    expect(store.box()?.max.slice(0, 2)).toEqual([20, 20]);
    expect(store.boxOfAll()?.min[0]).toBe(1);
    expect(store.boxOfPlaces()?.max[0]).toBe(900);
    expect(new VertexStore(HEADER).box()).toBeNull();
  });
});
