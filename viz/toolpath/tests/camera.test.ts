import { describe, expect, test } from 'vitest';
import {
  clipPlanes,
  DEFAULT_CAMERA,
  eyeFrame,
  fit as fitted,
  mmPerPx,
  ORTHOGRAPHIC_EYE_MM,
  orbit,
  PRESETS,
  pan,
  type Vec3,
  zoom,
} from '../src/camera';

const SIZE = { width: 800, height: 600 };
const BOX = { min: [10, 20, 0], max: [110, 90, 40] } as const;
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** Where a place is on the screen, in pixels from the middle, y downwards. */
function project(camera: typeof DEFAULT_CAMERA, place: Vec3): [number, number] {
  const { eyeMm, right, up, forward } = eyeFrame(camera);
  const from: Vec3 = [place[0] - eyeMm[0], place[1] - eyeMm[1], place[2] - eyeMm[2]];
  const scale = SIZE.height / 2 / Math.tan((16 * Math.PI) / 180) / dot(from, forward);
  return [dot(from, right) * scale, -dot(from, up) * scale];
}

describe('the camera', () => {
  test('its axes are at right angles and of length one', () => {
    const { right, up, forward } = eyeFrame(orbit(DEFAULT_CAMERA, 123, -45));
    for (const axis of [right, up, forward]) expect(dot(axis, axis)).toBeCloseTo(1, 12);
    expect(dot(right, up)).toBeCloseTo(0, 12);
    expect(dot(right, forward)).toBeCloseTo(0, 12);
    expect(dot(up, forward)).toBeCloseTo(0, 12);
  });

  test('azimuth 0 looks from the front to the back', () => {
    const { forward, right } = eyeFrame({ ...DEFAULT_CAMERA, azimuth: 0, elevation: 0 });
    expect(forward).toEqual([-0, 1, -0]);
    expect(right).toEqual([1, 0, 0]);
  });

  test('it never tips over', () => {
    expect(Math.abs(orbit(DEFAULT_CAMERA, 0, 1e6).elevation)).toBeLessThan(Math.PI / 2);
    expect(Math.abs(orbit(DEFAULT_CAMERA, 0, -1e6).elevation)).toBeLessThan(Math.PI / 2);
  });

  test('panning moves what is looked at with the pointer', () => {
    const [x, y] = project(pan(DEFAULT_CAMERA, 30, -12, SIZE), DEFAULT_CAMERA.targetMm);
    expect(x).toBeCloseTo(30, 6);
    expect(y).toBeCloseTo(-12, 6);
  });

  test('zooming keeps what is under the pointer', () => {
    const under = pan(DEFAULT_CAMERA, -100, 60, SIZE).targetMm;
    expect(project(DEFAULT_CAMERA, under)[0]).toBeCloseTo(100, 6);
    const [x, y] = project(zoom(DEFAULT_CAMERA, 0.5, SIZE, [100, -60]), under);
    expect(x).toBeCloseTo(100, 6);
    expect(y).toBeCloseTo(-60, 6);
  });

  test('senseless zooms do nothing and the distance is bounded', () => {
    for (const factor of [0, -1, Number.NaN, Number.POSITIVE_INFINITY]) {
      expect(zoom(DEFAULT_CAMERA, factor, SIZE)).toBe(DEFAULT_CAMERA);
    }
    expect(zoom(DEFAULT_CAMERA, 1e-9, SIZE).distanceMm).toBeGreaterThanOrEqual(1);
    expect(zoom(DEFAULT_CAMERA, 1e9, SIZE).distanceMm).toBeLessThanOrEqual(20_000);
  });

  test('a fitted box is wholly in view and nearly fills it', () => {
    for (const [azimuth, elevation] of [
      [0, 0],
      [0.7, 0.5],
      [-2, 1.4],
      [3, -0.3],
    ] as const) {
      const camera = fitted({ ...DEFAULT_CAMERA, azimuth, elevation }, BOX, SIZE);
      let fullest = 0;
      for (const x of [BOX.min[0], BOX.max[0]])
        for (const y of [BOX.min[1], BOX.max[1]])
          for (const z of [BOX.min[2], BOX.max[2]]) {
            const at = project(camera, [x, y, z]);
            fullest = Math.max(fullest, Math.abs(at[0]) / 400, Math.abs(at[1]) / 300);
          }
      expect(fullest).toBeLessThanOrEqual(1);
      expect(fullest).toBeGreaterThan(0.85);
    }
  });

  test('the clip planes hold the box', () => {
    const camera = fitted(DEFAULT_CAMERA, BOX, SIZE);
    const { nearMm, farMm } = clipPlanes(camera, BOX);
    expect(nearMm).toBeGreaterThan(0);
    expect(farMm).toBeGreaterThan(nearMm);
    const { eyeMm, forward } = eyeFrame(camera);
    const depth = dot([60 - eyeMm[0], 55 - eyeMm[1], 20 - eyeMm[2]], forward);
    expect(depth).toBeGreaterThan(nearMm);
    expect(depth).toBeLessThan(farMm);
  });
});

describe('presets and projections', () => {
  test.each([
    ['front', [0, 1, 0]],
    ['back', [0, -1, 0]],
    ['left', [1, 0, 0]],
    ['right', [-1, 0, 0]],
    ['top', [0, 0, -1]],
  ] as const)('%s looks along %j', (preset, way) => {
    const { forward } = eyeFrame({ ...DEFAULT_CAMERA, ...PRESETS[preset] });
    for (const axis of [0, 1, 2] as const) expect(Math.abs(forward[axis] - way[axis])).toBeLessThan(0.01);
  });

  test.each(['perspective', 'orthographic'] as const)('%s: the box fits, and not loosely', (projection) => {
    const camera = fitted({ ...DEFAULT_CAMERA, ...PRESETS.front, projection }, BOX, SIZE);
    const covered = 100 / (mmPerPx(camera, SIZE) * SIZE.width);
    expect(covered).toBeLessThan(1);
    expect(covered).toBeGreaterThan(projection === 'perspective' ? 0.7 : 0.9);
  });

  test('without perspective the box lies between the planes, however near the target is', () => {
    const camera = { ...fitted({ ...DEFAULT_CAMERA, projection: 'orthographic' }, BOX, SIZE), distanceMm: 2 };
    const { nearMm, farMm } = clipPlanes(camera, BOX);
    expect(nearMm).toBeLessThan(ORTHOGRAPHIC_EYE_MM - 40);
    expect(farMm).toBeGreaterThan(ORTHOGRAPHIC_EYE_MM + 40);
  });
});
