import { expect, test } from 'vitest';
import { nozzleTriangles } from '../src/nozzle';

const { corners, shades } = nozzleTriangles();
const point = (at: number): [number, number, number] => [
  corners[at * 3] ?? Number.NaN,
  corners[at * 3 + 1] ?? Number.NaN,
  corners[at * 3 + 2] ?? Number.NaN,
];

test('the tip is lowest, and stands at the origin', () => {
  const heights = corners.filter((_, at) => at % 3 === 2);
  expect(Math.min(...heights)).toBe(0);
  expect(Math.max(...heights)).toBe(1);
  const low = shades.map((_, at) => point(at)).filter(([, , z]) => z === 0);
  for (const [x, y] of low) expect(Math.hypot(x, y)).toBeLessThan(0.1);
});

test('every triangle faces outwards, and has a brightness', () => {
  expect(shades).toHaveLength(corners.length / 3);
  expect(shades.every((shade) => shade > 0.4 && shade <= 1)).toBe(true);
  for (let at = 0; at < shades.length; at += 3) {
    const [a, b, c] = [point(at), point(at + 1), point(at + 2)];
    const [u, v] = [b, c].map((end) => end.map((value, axis) => value - (a[axis] ?? 0)));
    if (!u || !v) throw new Error('no triangle');
    const cross = [0, 1, 2].map(
      (axis) =>
        (u[(axis + 1) % 3] ?? 0) * (v[(axis + 2) % 3] ?? 0) -
        (u[(axis + 2) % 3] ?? 0) * (v[(axis + 1) % 3] ?? 0),
    );
    const middle = [0, 1, 2].map((axis) => ((a[axis] ?? 0) + (b[axis] ?? 0) + (c[axis] ?? 0)) / 3);
    // The nozzle is convex around a point on its axis.
    const outwards = cross.reduce(
      (sum, value, axis) => sum + value * ((middle[axis] ?? 0) - (axis === 2 ? 0.6 : 0)),
      0,
    );
    expect(outwards).toBeGreaterThan(0);
  }
});
