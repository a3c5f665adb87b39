/**
 * What is under the pointer: the first bead or line that a ray from the eye meets.
 *
 * Works on the vertices themselves, so nothing is drawn and nothing is read back from the GPU. Boxes (boxes.ts) keep it to
 * the few thousand segments that are near the ray. Beads are taken as capsules as wide and high as they are; nothing is
 * thinner than a few pixels. Units: mm; pixels are CSS pixels.
 */
import { BoxTree, DEFAULT_HEIGHT_MM, DEFAULT_WIDTH_MM, PER_BLOCK, PER_GROUP } from './boxes';
import type { Ray } from './camera';
import { LEAD_TEXELS, type VertexStore } from './chunks';
import type { VertexRange } from './layers';
import { featureMask } from './palette';
import type { Shown } from './shown';
import type { VertexIndex } from './units';
import { FIELDS, FLAGS, SIZE_STEP_MM, WORDS_PER_VERTEX } from './vertex';

/** Half the width of what is thinner. */
const BEAD_PX = 1;
const LINE_PX = 3;
const POSITION = 0xf_ffff;

/** What of the file can be met. */
export interface Pickable {
  readonly ranges: readonly VertexRange[];
  readonly shown: Shown;
}

/** Where a ray enters a box that is wider by so many pixels all around; Infinity where it misses it. */
export function entersBox(ray: Ray, data: Float32Array, box: number, px: number): number {
  const at = box * 6;
  const [fromX, fromY, fromZ] = ray.fromMm;
  const [lowX, lowY, lowZ] = [
    (data[at] ?? 0) - fromX,
    (data[at + 1] ?? 0) - fromY,
    (data[at + 2] ?? 0) - fromZ,
  ];
  const highX = (data[at + 3] ?? 0) - fromX;
  const highY = (data[at + 4] ?? 0) - fromY;
  const highZ = (data[at + 5] ?? 0) - fromZ;
  const farX = Math.max(-lowX, highX);
  const farY = Math.max(-lowY, highY);
  const farZ = Math.max(-lowZ, highZ);
  // What a pixel covers at the box's far side.
  const pad = px * ray.pixelAngle * Math.sqrt(farX * farX + farY * farY + farZ * farZ);
  // A way of exactly 0 would make a number of nothing where the box begins there.
  const [wayX, wayY, wayZ] = [ray.way[0] || 1e-30, ray.way[1] || 1e-30, ray.way[2] || 1e-30];
  const [x0, x1] = [(lowX - pad) / wayX, (highX + pad) / wayX];
  const [y0, y1] = [(lowY - pad) / wayY, (highY + pad) / wayY];
  const [z0, z1] = [(lowZ - pad) / wayZ, (highZ + pad) / wayZ];
  const near = Math.max(Math.min(x0, x1), Math.min(y0, y1), Math.min(z0, z1), 0);
  const far = Math.min(Math.max(x0, x1), Math.max(y0, y1), Math.max(z0, z1));
  return near <= far ? near : Infinity;
}

/**
 * Where the ray from the origin along `way` meets the capsule from `a` with the axis `axis` and this radius; Infinity where
 * it does not. First the cylinder's wall, then the nearer ball.
 */
export function meetsCapsule(
  way: readonly [number, number, number],
  a: readonly [number, number, number],
  axis: readonly [number, number, number],
  radius: number,
): number {
  const dot = (p: readonly number[], q: readonly number[]): number =>
    (p[0] ?? 0) * (q[0] ?? 0) + (p[1] ?? 0) * (q[1] ?? 0) + (p[2] ?? 0) * (q[2] ?? 0);
  const [axisAxis, axisWay, axisA, wayWay, wayA, aA] = [
    dot(axis, axis),
    dot(axis, way),
    dot(axis, a),
    dot(way, way),
    dot(way, a),
    dot(a, a),
  ];
  // |p − a|² − ((p − a)·axis)²/axis² = radius² for p = t·way.
  const square = axisAxis * wayWay - axisWay * axisWay;
  const linear = axisAxis * wayA - axisWay * axisA;
  const rest = axisAxis * aA - axisA * axisA - radius * radius * axisAxis;
  let end = axisAxis > 0 && axisWay > 0 ? 0 : 1;
  if (square > 1e-12 * axisAxis * wayWay) {
    const inside = linear * linear - square * rest;
    if (inside < 0) return Infinity;
    const t = (linear - Math.sqrt(inside)) / square;
    const along = t * axisWay - axisA;
    if (along >= 0 && along <= axisAxis) return t >= 0 ? t : Infinity;
    end = along < 0 ? 0 : 1;
  }
  // The ball at that end.
  const wayB = wayA + end * axisWay;
  const bB = aA + end * (2 * axisA + axisAxis);
  const inside = wayB * wayB - wayWay * (bB - radius * radius);
  if (inside < 0) return Infinity;
  const t = (wayB - Math.sqrt(inside)) / wayWay;
  return t >= 0 ? t : Infinity;
}

export class Picker {
  readonly #store: VertexStore;
  readonly #tree: BoxTree;

  constructor(store: VertexStore) {
    this.#store = store;
    this.#tree = new BoxTree(store);
  }

  /** Takes vertices that have come since. */
  update(): void {
    this.#tree.update();
  }

  /** The vertex at whose segment the ray ends; null where it meets none. */
  pick(ray: Ray, pickable: Pickable): VertexIndex | null {
    this.#tree.update();
    const { shown } = pickable;
    const px = shown.travel || shown.wipes ? LINE_PX : BEAD_PX;
    const search = new Search(this.#store, ray, pickable);
    for (const [block, at] of this.#entered(ray, px)) {
      if (at > search.nearest) break;
      search.look({ first: block * PER_BLOCK, end: Math.min((block + 1) * PER_BLOCK, this.#tree.count) });
    }
    return search.vertex;
  }

  /** The blocks that the ray enters, and where, nearest first. */
  #entered(ray: Ray, px: number): (readonly [block: number, at: number])[] {
    const { groups, blocks, groupCount, count } = this.#tree;
    const entered: (readonly [number, number])[] = [];
    for (let group = 0; group < groupCount; group++) {
      if (entersBox(ray, groups.data, group, px) === Infinity) continue;
      const last = Math.min((group + 1) * PER_GROUP, Math.ceil(count / PER_BLOCK));
      for (let block = group * PER_GROUP; block < last; block++) {
        const at = entersBox(ray, blocks.data, block, px);
        if (at < Infinity) entered.push([block, at]);
      }
    }
    return entered.sort((one, other) => one[1] - other[1]);
  }
}

/** One search for the nearest segment. */
class Search {
  nearest = Infinity;
  vertex: VertexIndex | null = null;
  readonly #store: VertexStore;
  readonly #ray: Ray;
  readonly #ranges: readonly VertexRange[];
  readonly #features: number;
  readonly #hidden: ReadonlySet<number>;
  readonly #travels: boolean;
  readonly #wipes: boolean;

  constructor(store: VertexStore, ray: Ray, { ranges, shown }: Pickable) {
    this.#store = store;
    this.#ray = ray;
    this.#ranges = ranges;
    this.#features = featureMask(shown.hiddenFeatures);
    this.#hidden = new Set(shown.hiddenObjects);
    this.#travels = shown.travel;
    this.#wipes = shown.wipes;
  }

  /** Looks at these vertices, as far as they are shown. */
  look(block: VertexRange): void {
    for (const range of this.#ranges) {
      const part = { first: Math.max(range.first, block.first), end: Math.min(range.end, block.end) };
      if (part.end <= part.first) continue;
      for (const { chunk, first, count } of this.#store.split(part)) {
        for (let own = first; own < first + count; own++) {
          const at = this.#meets(chunk.data, (LEAD_TEXELS + own) * WORDS_PER_VERTEX);
          if (at >= this.nearest) continue;
          this.nearest = at;
          this.vertex = chunk.firstVertex + own;
        }
      }
    }
  }

  #isShown(kind: number, rest: number): boolean {
    if (kind & FLAGS.break) return false;
    if (kind & FLAGS.travel) return (kind & FLAGS.wipe) !== 0 ? this.#wipes : this.#travels;
    const feature = (kind >>> FIELDS.feature.shift) & 31;
    return ((this.#features >>> feature) & 1) === 1 && !this.#hidden.has(rest >>> FIELDS.object.shift);
  }

  #meets(data: Uint32Array, base: number): number {
    const [x, y, z] = [data[base] ?? 0, data[base + 1] ?? 0, data[base + 2] ?? 0];
    if (!this.#isShown(z, data[base + 3] ?? 0)) return Infinity;
    const before = base - WORDS_PER_VERTEX;
    const [u, v, w] = [data[before] ?? 0, data[before + 1] ?? 0, data[before + 2] ?? 0];
    const { originMm, stepMm } = this.#store.header;
    const { fromMm, way, pixelAngle } = this.#ray;
    const [fromX, fromY, fromZ] = [
      originMm[0] + (u & POSITION) * stepMm - fromMm[0],
      originMm[1] + (v & POSITION) * stepMm - fromMm[1],
      originMm[2] + (w & POSITION) * stepMm - fromMm[2],
    ];
    const axisX = ((x & POSITION) - (u & POSITION)) * stepMm;
    const axisY = ((y & POSITION) - (v & POSITION)) * stepMm;
    const axisZ = ((z & POSITION) - (w & POSITION)) * stepMm;
    const px = pixelAngle * Math.hypot(fromX, fromY, fromZ);
    if (z & FLAGS.travel) {
      return meetsCapsule(way, [fromX, fromY, fromZ], [axisX, axisY, axisZ], LINE_PX * px);
    }
    const width = ((x >>> FIELDS.width.shift) & 0x3ff) * SIZE_STEP_MM || DEFAULT_WIDTH_MM;
    const height = ((y >>> FIELDS.height.shift) & 0x1ff) * SIZE_STEP_MM || DEFAULT_HEIGHT_MM;
    // In a space that is stretched upwards the bead is as high as it is wide.
    const stretch = width / height;
    const middle = (fromZ - height / 2) * stretch;
    return meetsCapsule(
      [way[0], way[1], way[2] * stretch],
      [fromX, fromY, middle],
      [axisX, axisY, axisZ * stretch],
      Math.max(width / 2, BEAD_PX * px),
    );
  }
}
