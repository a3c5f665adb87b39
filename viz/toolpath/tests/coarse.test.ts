import { describe, expect, test } from 'vitest';
import { Coarsener, Rough, TOLERANCE_MM } from '../src/coarse';
import { LayerList } from '../src/layers';
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

/** The kept vertices, fed in pieces. */
function kept(words: Uint32Array, piece = words.length / 4): Uint32Array {
  const coarsener = new Coarsener(HEADER);
  const out: number[] = [];
  for (let at = 0; at < words.length; at += piece * 4)
    out.push(...coarsener.push(words.subarray(at, at + piece * 4)));
  out.push(...coarsener.finish());
  expect(coarsener.count).toBe(out.length / 4);
  return new Uint32Array(out);
}

const circle = (sides: number): Point[] =>
  Array.from({ length: sides + 1 }, (_, side) => {
    const angle = (side / sides) * 2 * Math.PI;
    return [50 + 20 * Math.cos(angle), 50 + 20 * Math.sin(angle), side === 0 ? FLAGS.break : 0];
  });

describe('the coarse path', () => {
  test('a line of many pieces becomes one segment', () => {
    const line: Point[] = Array.from({ length: 100 }, (_, at) => [at, 5, at === 0 ? FLAGS.break : 0]);
    const words = kept(encoded(line));
    expect(words.length / 4).toBe(2);
    expect(positionMm(HEADER, words, 1)[0]).toBe(99);
  });

  test('a circle keeps within the tolerance with far fewer vertices', () => {
    const points = circle(2000);
    const words = kept(encoded(points));
    const count = words.length / 4;
    expect(count).toBeLessThan(120);
    expect(count).toBeGreaterThan(12);
    for (let at = 1; at < count; at++) {
      const [ax, ay] = positionMm(HEADER, words, at - 1);
      const [bx, by] = positionMm(HEADER, words, at);
      const fromCentre = Math.hypot((ax + bx) / 2 - 50, (ay + by) / 2 - 50);
      expect(20 - fromCentre).toBeLessThanOrEqual(2 * TOLERANCE_MM);
    }
  });

  test.each([1, 2, 7, 500])('pieces of %i vertices give the same', (piece) => {
    const words = encoded(circle(300));
    expect([...kept(words, piece)]).toEqual([...kept(words)]);
  });

  test('corners, travels, other features and layers are kept', () => {
    const points: Point[] = [
      [0, 0, FLAGS.break],
      [10, 0],
      [10, 10],
      [20, 10, FLAGS.travel],
      [30, 10, FLAGS.travel],
      [40, 10],
      [50, 10, 0, 'infill'],
      [60, 10, 0, 'infill', 1],
    ];
    expect(kept(encoded(points)).length / 4).toBe(points.length);
  });

  test('turning back on the same line is kept', () => {
    expect(
      kept(
        encoded([
          [0, 0, FLAGS.break],
          [10, 0],
          [4, 0],
          [8, 0],
        ]),
      ).length / 4,
    ).toBe(4);
  });

  test('layers and printed places are found again', () => {
    const points: Point[] = Array.from({ length: 40 }, (_, at) => [
      at % 20,
      0,
      at === 0 ? FLAGS.break : 0,
      'outerWall',
      at < 20 ? 0 : 1,
    ]);
    const rough = new Rough(HEADER);
    rough.append(encoded(points));
    rough.end();
    const layers = new LayerList([
      { firstVertex: 0, zMm: 0.2 },
      { firstVertex: 20, zMm: 0.4 },
    ]);
    const { ranges } = rough.reduced({ first: 20, end: 40 }, layers, 1000);
    const chunk = rough.store.chunks[0];
    if (!chunk || !ranges[0]) throw new Error('nothing kept');
    for (let at = ranges[0].first; at < ranges[0].end; at++)
      expect(field(chunk.data, at + 2, 'layer')).toBe(1);
    expect(ranges[0].end).toBe(rough.store.count);
    expect(rough.coarseOf(0)).toBe(0);
  });
});
