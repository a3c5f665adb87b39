import { describe, expect, test } from 'vitest';
import { DEFAULT_CAMERA, eyeFrame, mmPerPx, PRESETS, rayThrough, type Vec3 } from '../src/camera';
import { VERTICES_PER_CHUNK, VertexStore } from '../src/chunks';
import { meetsCapsule, Picker } from '../src/pick';
import { SHOW_ALL } from '../src/shown';
import { encodeVertex, type FeatureName, FLAGS } from '../src/vertex';

const HEADER = { originMm: [-10, -10, 0], stepMm: 2 ** -10 } as const;
const SIZE = { width: 800, height: 600 };

interface Place {
  readonly at: Vec3;
  readonly feature?: FeatureName;
  readonly object?: number;
  readonly flags?: number;
}

function stored(places: readonly Place[]): VertexStore {
  const store = new VertexStore(HEADER);
  const words = new Uint32Array(places.length * 4);
  places.forEach(({ at, feature = 'outerWall', object = 0, flags = 0 }, index) => {
    encodeVertex(HEADER, words, index, {
      positionMm: at,
      widthMm: 0.4,
      heightMm: 0.2,
      feature,
      object,
      flags: flags | (index === 0 ? FLAGS.break : 0),
    });
  });
  store.append(words);
  return store;
}

/** A wall of layers in the plane y = 0 and one behind it in y = 5; ten segments a layer each. */
function twoWalls(layers: number): VertexStore {
  const places: Place[] = [];
  for (let layer = 0; layer < layers; layer++) {
    for (const y of [0, 5]) {
      for (let step = 0; step <= 10; step++) {
        places.push({
          at: [2 * step, y, 0.2 * (layer + 1)],
          flags: step === 0 ? FLAGS.travel : 0,
          object: y,
        });
      }
    }
  }
  return stored(places);
}

/** Where a place is in the view. */
function project(camera: typeof DEFAULT_CAMERA, place: Vec3): [number, number] {
  const { eyeMm, right, up, forward } = eyeFrame(camera);
  const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const from: Vec3 = [place[0] - eyeMm[0], place[1] - eyeMm[1], place[2] - eyeMm[2]];
  const shrink = camera.projection === 'perspective' ? dot(from, forward) / camera.distanceMm : 1;
  const scale = mmPerPx(camera, SIZE) * shrink;
  return [SIZE.width / 2 + dot(from, right) / scale, SIZE.height / 2 - dot(from, up) / scale];
}

/** A million vertices take a second, and several where the machine has more to do. */
const MILLION_MS = 60_000;

describe('picking', () => {
  const store = twoWalls(20);
  const picker = new Picker(store);
  const all = [{ first: 0, end: store.count }];
  const at = (layer: number, wall: number, step: number): number => (layer * 2 + wall) * 11 + step;

  test.each([
    ['perspective', DEFAULT_CAMERA],
    ['orthographic', { ...DEFAULT_CAMERA, projection: 'orthographic' as const }],
    ['from the front', { ...DEFAULT_CAMERA, ...PRESETS.front }],
  ])('%s: the segment that is seen at its place', (_, like) => {
    const camera = { ...like, targetMm: [10, 0, 2] as const, distanceMm: 40 };
    for (const [layer, step] of [
      [19, 3],
      [10, 7],
      [2, 10],
    ] as const) {
      const middle: Vec3 = [2 * step - 1, -0.2, 0.2 * (layer + 1) - 0.1];
      const ray = rayThrough(camera, SIZE, ...project(camera, middle));
      expect(picker.pick(ray, { ranges: all, shown: SHOW_ALL })).toBe(at(layer, 0, step));
    }
  });

  test('what is not shown is seen through', () => {
    const level = { ...DEFAULT_CAMERA, ...PRESETS.front, projection: 'orthographic' as const };
    const camera = { ...level, targetMm: [10, 0, 2] as const, distanceMm: 20 };
    const ray = rayThrough(camera, SIZE, ...project(camera, [7, 0, 1.9]));
    const front = picker.pick(ray, { ranges: all, shown: SHOW_ALL });
    expect([at(9, 0, 4), at(8, 0, 4), at(10, 0, 4)]).toContain(front);
    const behind = picker.pick(ray, { ranges: all, shown: { ...SHOW_ALL, hiddenObjects: [0] } });
    expect([at(9, 1, 4), at(8, 1, 4), at(10, 1, 4)]).toContain(behind);
    expect(
      picker.pick(ray, { ranges: all, shown: { ...SHOW_ALL, hiddenFeatures: ['outerWall'] } }),
    ).toBeNull();
    expect(picker.pick(ray, { ranges: [{ first: 0, end: at(3, 0, 0) }], shown: SHOW_ALL })).toBeNull();
  });

  test('beside the part there is nothing, but for travels where they are shown', () => {
    const camera = { ...DEFAULT_CAMERA, ...PRESETS.top, targetMm: [10, 2, 2] as const, distanceMm: 60 };
    const ray = rayThrough(camera, SIZE, ...project(camera, [10, 2.5, 4]));
    expect(picker.pick(ray, { ranges: all, shown: SHOW_ALL })).toBeNull();
    // From the front wall's end (20, 0) to the start (0, 5) of the one behind.
    expect(picker.pick(ray, { ranges: all, shown: { ...SHOW_ALL, travel: true } })).toBe(at(19, 1, 0));
  });

  test('vertices that come later are found too, over the bounds of chunks', { timeout: MILLION_MS }, () => {
    const count = VERTICES_PER_CHUNK + 100;
    const places = Array.from({ length: count }, (_, n) => ({
      // To and fro.
      at: [
        0.5 * (Math.floor(n / 500) % 2 ? 499 - (n % 500) : n % 500),
        Math.floor(n / 500) / 2,
        0.2,
      ] as const,
    }));
    const grown = stored(places.slice(0, 1000));
    const later = new Picker(grown);
    const camera = { ...DEFAULT_CAMERA, ...PRESETS.top, targetMm: [20, 65, 0] as const, distanceMm: 30 };
    const vertex = VERTICES_PER_CHUNK + 40;
    const [x, y] = places[vertex]?.at ?? [0, 0];
    const ray = rayThrough(camera, SIZE, ...project(camera, [x + 0.25, y, 0.2]));
    const pick = (): number | null =>
      later.pick(ray, { ranges: [{ first: 0, end: grown.count }], shown: SHOW_ALL });
    expect(pick()).toBeNull();
    const rest = stored(places);
    for (const { chunk, first, count: own } of rest.split({ first: 1000, end: count }))
      grown.append(chunk.data.slice((2 + first) * 4, (2 + first + own) * 4));
    expect(pick()).toBe(vertex);
  });

  test('a capsule is met at its wall, at its ends, from inside along it, and not beside it', () => {
    expect(meetsCapsule([1, 0, 0], [10, -5, 0], [0, 10, 0], 2)).toBeCloseTo(8, 9);
    expect(meetsCapsule([1, 0, 0], [10, 1, 0], [0, 10, 0], 2)).toBeCloseTo(10 - Math.sqrt(3), 9);
    expect(meetsCapsule([1, 0, 0], [10, 0, 0], [5, 0, 0], 2)).toBeCloseTo(8, 9);
    expect(meetsCapsule([1, 0, 0], [15, 0, 0], [-5, 0, 0], 2)).toBeCloseTo(8, 9);
    expect(meetsCapsule([1, 0, 0], [10, 0, 0], [0, 0, 0], 2)).toBeCloseTo(8, 9);
    expect(meetsCapsule([1, 0, 0], [10, 2.1, 0], [0, 10, 0], 2)).toBe(Infinity);
    expect(meetsCapsule([1, 0, 0], [-10, -5, 0], [0, 10, 0], 2)).toBe(Infinity);
  });
});
