import { describe, expect, test } from 'vitest';
import { decodeVertex, encodeVertex, FEATURES, FIELDS, FLAGS, featureNumber } from '../src/vertex';

const HEADER = { originMm: [-10, -20, 0], stepMm: 2 ** -10 } as const;
/** The test vector of docs/vertex.md. */
const VECTOR = new Uint32Array([0x06e05a00, 0x0320c900, 0x20100133, 0x00100007]);

describe('the bits of a vertex', () => {
  test('the documented test vector is decoded', () => {
    const vertex = decodeVertex(HEADER, VECTOR, 0);
    expect(vertex.positionMm[0]).toBe(12.5);
    expect(vertex.positionMm[1]).toBe(30.25);
    expect(vertex.positionMm[2]).toBeCloseTo(0.3, 3);
    expect(vertex.widthMm).toBeCloseTo(0.44, 9);
    expect(vertex.heightMm).toBeCloseTo(0.2, 9);
    expect(vertex).toMatchObject({
      feature: 'outerWall',
      layer: 7,
      tool: 1,
      seam: true,
      travel: false,
      break: false,
    });
  });

  test('and encoded to the same words', () => {
    const words = new Uint32Array(4);
    encodeVertex(HEADER, words, 0, {
      positionMm: [12.5, 30.25, 0.3],
      widthMm: 0.44,
      heightMm: 0.2,
      feature: 'outerWall',
      layer: 7,
      tool: 1,
      flags: FLAGS.seam,
    });
    expect([...words]).toEqual([...VECTOR]);
  });

  test('no two fields share a bit', () => {
    const used = [0, 0, 0, 0];
    for (const { word, shift, bits } of Object.values(FIELDS)) {
      const mask = ((2 ** bits - 1) << shift) >>> 0;
      expect((used[word] ?? 0) & mask).toBe(0);
      used[word] = ((used[word] ?? 0) | mask) >>> 0;
    }
    for (const flag of Object.values(FLAGS)) {
      expect((used[2] ?? 0) & flag).toBe(0);
      used[2] = ((used[2] ?? 0) | flag) >>> 0;
    }
  });

  test('values out of range saturate and leave their neighbours alone', () => {
    const words = new Uint32Array(4);
    encodeVertex(HEADER, words, 0, {
      positionMm: [1e9, -1e9, 0],
      widthMm: 99,
      heightMm: 99,
      layer: 1e9,
      tool: 99,
    });
    const vertex = decodeVertex(HEADER, words, 0);
    expect(vertex.positionMm[0]).toBeCloseTo(-10 + (2 ** 20 - 1) / 1024, 6);
    expect(vertex.positionMm[1]).toBe(-20);
    expect(vertex.widthMm).toBeCloseTo(4.092, 6);
    expect(vertex.heightMm).toBeCloseTo(2.044, 6);
    expect(vertex).toMatchObject({ layer: 2 ** 20 - 1, tool: 15, feature: 'other', travel: false });
  });

  test('features keep the numbers of the document', () => {
    expect(FEATURES).toHaveLength(17);
    expect(featureNumber('bridge')).toBe(8);
    expect(featureNumber('other')).toBe(16);
  });
});
