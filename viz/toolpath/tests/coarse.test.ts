import { describe, expect, test } from 'vitest';
import { LEAD_TEXELS, VERTICES_PER_CHUNK, VertexStore } from '../src/chunks';
import { Rough, TOLERANCE_MM } from '../src/coarse';
import { LayerList } from '../src/layers';
import { TEXEL_BITS, TEXEL_MASK } from '../src/segments';
import { encodeVertex, type FeatureName, FLAGS, field, positionMm } from '../src/vertex';

const HEADER = { originMm: [0, 0, 0], stepMm: 2 ** -10 } as const;
type Point = readonly [x: number, y: number, flags?: number, feature?: FeatureName, layer?: number];

function encoded(points: readonly Point[]): Uint32Array {
  const words = new Uint32Array(points.length * 4);
  points.forEach(([x, y, flags = 0, feature = 'outerWall', layer = 0], at) => {
    encodeVertex(HEADER, words, at, {
      positionMm: [x, y, 0.2],
      widthMm: 0.4,
      heightMm: 0.2,
      feature,
      layer,
      flags,
    });
  });
  return words;
}

interface Segment {
  readonly isOuter: boolean;
  /** Vertices of the file. */
  readonly from: number;
  readonly to: number;
}

function roughOf(words: Uint32Array, piece = words.length / 4): Rough {
  const rough = new Rough(HEADER);
  for (let at = 0; at < words.length; at += piece * 4) rough.append(words.subarray(at, at + piece * 4));
  rough.end();
  return rough;
}

/** The listed segments, in the order of the file. */
function listed(rough: Rough): Segment[] {
  const all = [true, false].flatMap((isOuter) => {
    const { segments } = isOuter ? rough.outer : rough.inner;
    return segments.chunks.flatMap(({ index, data, count }) => {
      const before = index * VERTICES_PER_CHUNK - LEAD_TEXELS;
      return Array.from(data.subarray(0, count), (pair) => ({
        isOuter,
        from: before + (pair >>> TEXEL_BITS),
        to: before + (pair & TEXEL_MASK),
      }));
    });
  });
  return all.sort((one, other) => one.to - other.to);
}

const segmentsOf = (words: Uint32Array, piece?: number): Segment[] => listed(roughOf(words, piece));

const circle = (sides: number): Point[] =>
  Array.from({ length: sides + 1 }, (_, side) => {
    const angle = (side / sides) * 2 * Math.PI;
    return [50 + 20 * Math.cos(angle), 50 + 20 * Math.sin(angle), side === 0 ? FLAGS.break : 0];
  });

describe('the coarse path', () => {
  test('a line of many pieces becomes one segment', () => {
    const line: Point[] = Array.from({ length: 100 }, (_, at) => [at, 5, at === 0 ? FLAGS.break : 0]);
    expect(segmentsOf(encoded(line))).toEqual([{ isOuter: true, from: 0, to: 99 }]);
  });

  test('a circle keeps within the tolerance with far fewer segments, without a gap', () => {
    const words = encoded(circle(2000));
    const segments = segmentsOf(words);
    expect(segments.length).toBeLessThan(120);
    expect(segments.length).toBeGreaterThan(12);
    let at = 0;
    for (const { from, to } of segments) {
      expect(from).toBe(at);
      at = to;
      const [ax, ay] = positionMm(HEADER, words, from);
      const [bx, by] = positionMm(HEADER, words, to);
      const fromCentre = Math.hypot((ax + bx) / 2 - 50, (ay + by) / 2 - 50);
      expect(20 - fromCentre).toBeLessThanOrEqual(2 * TOLERANCE_MM);
    }
    expect(at).toBe(2000);
  });

  test.each([1, 2, 7, 500])('pieces of %i vertices give the same', (piece) => {
    const words = encoded(circle(300));
    expect(segmentsOf(words, piece)).toEqual(segmentsOf(words));
  });

  test('corners, other features and layers are kept; travels are in no list', () => {
    const points: Point[] = [
      [0, 0, FLAGS.break],
      [10, 0],
      [10, 10],
      [20, 10, FLAGS.travel],
      [30, 10, FLAGS.travel],
      [40, 10],
      [50, 10, 0, 'infill'],
      [60, 10, 0, 'infill', 1],
      [70, 10, 0, 'overhangWall', 1],
    ];
    expect(segmentsOf(encoded(points)).map(({ isOuter, from, to }) => [isOuter, from, to])).toEqual([
      [true, 0, 1],
      [true, 1, 2],
      [true, 4, 5],
      [false, 5, 6],
      [false, 6, 7],
      [true, 7, 8],
    ]);
  });

  test('turning back on the same line is kept', () => {
    const points: Point[] = [
      [0, 0, FLAGS.break],
      [10, 0],
      [4, 0],
      [8, 0],
    ];
    expect(segmentsOf(encoded(points))).toHaveLength(3);
  });

  test('a run ends with its chunk, and the next begins at the vertex before, which both have', () => {
    const count = VERTICES_PER_CHUNK + 100;
    const line: Point[] = Array.from({ length: count }, (_, at) => [at / 128, 5, at === 0 ? FLAGS.break : 0]);
    const segments = segmentsOf(encoded(line));
    expect(segments.reduce((sum, { from, to }) => sum + to - from, 0)).toBe(count - 1);
    expect(segments.find(({ to }) => to === VERTICES_PER_CHUNK - 1)).toBeDefined();
    expect(segments.find(({ from }) => from === VERTICES_PER_CHUNK - 1)).toBeDefined();
  });
});

describe('what is drawn of it', () => {
  test('layers and places are found again', () => {
    const points: Point[] = Array.from({ length: 40 }, (_, at) => [
      at % 20,
      0,
      at === 0 ? FLAGS.break : 0,
      'outerWall',
      at < 20 ? 0 : 1,
    ]);
    const words = encoded(points);
    const { outer } = roughOf(words);
    const store = new VertexStore(HEADER);
    store.append(words);
    const layers = new LayerList([
      { firstVertex: 0, zMm: 0.2 },
      { firstVertex: 20, zMm: 0.4 },
    ]);
    const { ranges } = outer.reduced({ first: 20, end: 40 }, layers, 1000);
    const parts = ranges.flatMap((range) => outer.segments.split(range));
    expect(parts.map(({ count }) => count)).toEqual([2]);
    for (const { chunk, first, count } of parts) {
      for (let at = first; at < first + count; at++) {
        const texel = (chunk.data[at] ?? 0) & TEXEL_MASK;
        expect(field(store.chunks[0]?.data ?? new Uint32Array(), texel, 'layer')).toBe(1);
      }
    }
    expect(outer.segments.entryAt(0)).toBe(0);
    expect(outer.segments.entryAt(1_000_000)).toBe(outer.segments.count);
  });

  test('outer walls have the budget first, and the rest what is left', () => {
    const layers = Array.from({ length: 30 }, (_, layer): Point[] => [
      [0, layer, FLAGS.travel, 'outerWall', layer],
      [5, layer, 0, 'outerWall', layer],
      [5, layer + 5, 0, 'outerWall', layer],
      [0, layer + 9, 0, 'infill', layer],
      [7, layer + 2, 0, 'infill', layer],
    ]);
    const rough = roughOf(encoded(layers.flat()));
    const all = [{ first: 0, end: 150 }];
    expect([rough.outer.total(all), rough.inner.total(all)]).toEqual([60, 60]);
    expect(rough.shares(all, 1000)).toEqual([60, 60]);
    // Every layer's outer walls stay.
    expect(rough.shares(all, 100)).toEqual([60, 40]);
    const [outer, inner] = rough.shares(all, 80);
    expect(outer).toBeCloseTo(52);
    expect(outer + inner).toBeCloseTo(80);
    // Where there are none, the rest has all of it.
    const plain = roughOf(encoded(Array.from({ length: 50 }, (_, at): Point => [at % 2, at, 0, 'other'])));
    expect(plain.shares([{ first: 0, end: 50 }], 20)).toEqual([0, 20]);
  });
});
