import { describe, expect, test } from 'vitest';
import { decodeVertex, EVENTS, encodeVertex, FEATURES, FIELDS, FLAGS, featureNumber } from '../src/vertex';

const HEADER = { originMm: [-10, -20, 0], stepMm: 2 ** -10 } as const;
/** The test vector of docs/vertex.md. */
const VECTOR = new Uint32Array([0x06e05a00, 0x0320c900, 0x20100133, 0x00100007]);
const EVENTFUL = new Uint32Array([0x06e05a00, 0x6320c900, 0x20100133, 0x03100007]);

const VERTEX = {
  positionMm: [12.5, 30.25, 0.3],
  widthMm: 0.44,
  heightMm: 0.2,
  feature: 'outerWall',
  layer: 7,
  tool: 1,
  flags: FLAGS.seam,
} as const;

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
      object: 0,
      toolChange: false,
      pause: false,
      filamentChange: false,
    });
    expect(decodeVertex(HEADER, EVENTFUL, 0)).toMatchObject({
      widthMm: vertex.widthMm,
      heightMm: vertex.heightMm,
      tool: 1,
      object: 3,
      toolChange: true,
      pause: false,
      filamentChange: true,
    });
  });

  test('and encoded to the same words', () => {
    const words = new Uint32Array(4);
    encodeVertex(HEADER, words, 0, VERTEX);
    expect([...words]).toEqual([...VECTOR]);
    const events = EVENTS.toolChange + EVENTS.filamentChange;
    encodeVertex(HEADER, words, 0, { ...VERTEX, object: 3, events });
    expect([...words]).toEqual([...EVENTFUL]);
  });

  test('no two fields share a bit', () => {
    const used = [0, 0, 0, 0];
    for (const { word, shift, bits } of Object.values(FIELDS)) {
      const mask = ((2 ** bits - 1) << shift) >>> 0;
      expect((used[word] ?? 0) & mask).toBe(0);
      used[word] = ((used[word] ?? 0) | mask) >>> 0;
    }
    for (const [word, bits] of [
      [1, EVENTS],
      [2, FLAGS],
    ] as const) {
      for (const bit of Object.values(bits)) {
        expect((used[word] ?? 0) & bit).toBe(0);
        used[word] = ((used[word] ?? 0) | bit) >>> 0;
      }
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
      object: 1e9,
    });
    const vertex = decodeVertex(HEADER, words, 0);
    expect(vertex.positionMm[0]).toBeCloseTo(-10 + (2 ** 20 - 1) / 1024, 6);
    expect(vertex.positionMm[1]).toBe(-20);
    expect(vertex.widthMm).toBeCloseTo(4.092, 6);
    expect(vertex.heightMm).toBeCloseTo(2.044, 6);
    expect(vertex).toMatchObject({
      layer: 2 ** 20 - 1,
      tool: 15,
      object: 255,
      feature: 'other',
      travel: false,
      pause: false,
    });
  });
});

test('features keep the numbers of the document', () => {
  expect(FEATURES).toHaveLength(17);
  expect(featureNumber('bridge')).toBe(8);
  expect(featureNumber('other')).toBe(16);
});
