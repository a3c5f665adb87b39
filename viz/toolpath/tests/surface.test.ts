import { describe, expect, test } from 'vitest';
import { exaggerationOf, isMesh } from '../src/mesh';
import { meshCorners } from '../src/surface';

const MESH = {
  originMm: [10, 20],
  stepMm: [5, 10],
  columns: 3,
  rows: 2,
  heightsMm: [-0.1, 0, 0.1, 0.2, 0, -0.1],
} as const;

describe('the mesh of the bed', () => {
  test('each point is at its place, above the plate, as high as the scale says', () => {
    const { places, triangles, lines } = meshCorners(MESH);
    expect([places[15], places[16]]).toEqual([20, 30]);
    expect(Math.min(...[2, 5, 8, 11, 14, 17].map((at) => places[at] ?? Number.NaN))).toBe(0);
    const times = exaggerationOf(MESH);
    expect(times).toBeCloseTo(10 / 12 / 0.3, 6);
    expect((places[11] ?? 0) - (places[2] ?? 0)).toBeCloseTo(0.3 * times, 6);
    expect(triangles).toHaveLength(2 * 2 * 3);
    expect(lines).toHaveLength(2 * (2 * 2 + 3));
    expect(Math.max(...triangles)).toBe(5);
  });

  test('an even bed is no mountain', () => {
    expect(exaggerationOf({ ...MESH, heightsMm: [0, 0, 0, 0, 0, 0] })).toBe(100);
    expect(exaggerationOf({ ...MESH, exaggeration: 7 })).toBe(7);
  });

  test('what makes no sense is none', () => {
    expect(isMesh(MESH)).toBe(true);
    expect(isMesh({ ...MESH, columns: 1, rows: 6 })).toBe(false);
    expect(isMesh({ ...MESH, heightsMm: [0] })).toBe(false);
    expect(isMesh({ ...MESH, heightsMm: [0, 0, 0, 0, 0, Number.NaN] })).toBe(false);
    expect(isMesh({ ...MESH, stepMm: [0, 1] })).toBe(false);
    expect(isMesh({ ...MESH, columns: 1e9, rows: 2 })).toBe(false);
  });
});
