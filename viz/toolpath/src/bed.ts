/**
 * The bed: plate, grid, axes at the origin and the edges of the space above, as three.js objects.
 *
 * Does not know: the path, the camera. Units: mm.
 */
import {
  BufferAttribute,
  BufferGeometry,
  FrontSide,
  GLSL3,
  Group,
  LineSegments,
  Mesh,
  type Object3D,
  RawShaderMaterial,
} from 'three';
import type { BoxMm } from './camera';
import { type HexColour, type Palette, rgb } from './palette';
import { FLAT_FRAGMENT, FLAT_VERTEX } from './shaders';
import type { Mm } from './units';

export interface Bed {
  readonly minMm: readonly [Mm, Mm];
  readonly maxMm: readonly [Mm, Mm];
  /** The ellipse within those limits, not the rectangle. */
  readonly isRound?: boolean;
  /** How high the machine reaches; left out, no edges are drawn. */
  readonly heightMm?: Mm;
}

const FINE_MM = 10;
const COARSE_EVERY = 5;
/** More lines than this are no help and no bed has them: the grid is then wider. */
const LINES_MAX = 400;
/** The plate lies so much lower, for the depth buffer's sake. */
/** Corners of a round bed. */
const ROUND_CORNERS = 96;
const PLATE_DROP_MM = 0.12;
const GRID_DROP_MM = 0.06;

type Triple = readonly [number, number, number];

/** From where to where a line goes that has this place on the axis. */
function across(bed: Bed, axis: 0 | 1, at: Mm): readonly [Mm, Mm] {
  const other = axis === 0 ? 1 : 0;
  const [min, max] = [bed.minMm[other], bed.maxMm[other]];
  if (!bed.isRound) return [min, max];
  const half = (bed.maxMm[axis] - bed.minMm[axis]) / 2;
  const away = (at - bed.minMm[axis]) / half - 1;
  const [middle, reach] = [(min + max) / 2, ((max - min) / 2) * Math.sqrt(Math.max(1 - away * away, 0))];
  return [middle - reach, middle + reach];
}

/** Corners of the grid's lines, two a line. Lines lie on multiples of the spacing in the machine's own coordinates. */
export function gridLines(bed: Bed): { readonly fine: number[]; readonly coarse: number[] } {
  const fine: number[] = [];
  const coarse: number[] = [];
  for (const axis of [0, 1] as const) {
    const [min, max] = [bed.minMm[axis], bed.maxMm[axis]];
    const spacing = FINE_MM * Math.max(Math.ceil((max - min) / FINE_MM / LINES_MAX), 1);
    for (let line = Math.ceil(min / spacing); line * spacing <= max; line++) {
      const at = line * spacing;
      const to = line % COARSE_EVERY === 0 ? coarse : fine;
      const [from, end] = across(bed, axis, at);
      if (axis === 0) to.push(at, from, -GRID_DROP_MM, at, end, -GRID_DROP_MM);
      else to.push(from, at, -GRID_DROP_MM, end, at, -GRID_DROP_MM);
    }
  }
  return { fine, coarse };
}

/** The space above the bed. */
export function bedBox(bed: Bed): BoxMm {
  return { min: [bed.minMm[0], bed.minMm[1], 0], max: [bed.maxMm[0], bed.maxMm[1], bed.heightMm ?? 0] };
}

/** True if it has an area and all its numbers are numbers. */
export function isBed(bed: Bed): boolean {
  const numbers = [...bed.minMm, ...bed.maxMm, bed.heightMm ?? 0];
  return numbers.every(Number.isFinite) && bed.minMm[0] < bed.maxMm[0] && bed.minMm[1] < bed.maxMm[1];
}

const rectangle = ([x0, y0]: readonly [Mm, Mm], [x1, y1]: readonly [Mm, Mm], z: Mm): Triple[] => [
  [x0, y0, z],
  [x1, y0, z],
  [x1, y1, z],
  [x0, y1, z],
];

/** The bed's edge, against the clock. */
function corners(bed: Bed, z: Mm): Triple[] {
  if (!bed.isRound) return rectangle(bed.minMm, bed.maxMm, z);
  const place = (axis: 0 | 1, share: number): Mm =>
    (bed.minMm[axis] + bed.maxMm[axis] + share * (bed.maxMm[axis] - bed.minMm[axis])) / 2;
  return Array.from({ length: ROUND_CORNERS }, (_, at): Triple => {
    const angle = (2 * Math.PI * at) / ROUND_CORNERS;
    return [place(0, Math.cos(angle)), place(1, Math.sin(angle)), z];
  });
}

/** Triangles that fill a shape without dents. */
function filled(corners: readonly Triple[]): number[] {
  const [first] = corners;
  if (!first) return [];
  return corners.slice(1).flatMap((corner, at) => {
    const next = corners[at + 2];
    return next ? [...first, ...corner, ...next] : [];
  });
}

const outline = (corners: readonly Triple[]): number[] =>
  corners.flatMap((corner, at) => [...corner, ...(corners[(at + 1) % corners.length] ?? corner)]);

type ColourName = 'bed' | 'gridFine' | 'gridCoarse' | 'bedEdge' | 'axisX' | 'axisY';

export class BedObjects {
  readonly group = new Group();
  readonly #materials: Partial<Record<ColourName, RawShaderMaterial>> = {};

  /** Draws this bed in place of the one before. */
  set(bed: Bed): void {
    this.clear();
    this.#add('bed', filled(corners(bed, -PLATE_DROP_MM)), true);
    const { fine, coarse } = gridLines(bed);
    this.#add('gridFine', fine);
    this.#add('gridCoarse', coarse);
    const base = corners(bed, -GRID_DROP_MM);
    const edges = outline(base);
    if (bed.heightMm && bed.heightMm > 0) {
      const top = corners(bed, bed.heightMm);
      const isPost = (at: number): boolean => !bed.isRound || at % (ROUND_CORNERS / 4) === 0;
      const posts = base.flatMap((corner, at) => (isPost(at) ? [...corner, ...(top[at] ?? corner)] : []));
      this.#add('gridCoarse', [...outline(top), ...posts]);
    }
    this.#add('bedEdge', edges);
    const length = Math.min(bed.maxMm[0] - bed.minMm[0], bed.maxMm[1] - bed.minMm[1]) / 12;
    this.#add('axisX', axis([1, 0], length), true);
    this.#add('axisY', axis([0, 1], length), true);
  }

  set palette(palette: Palette) {
    for (const [name, material] of Object.entries(this.#materials) as [ColourName, RawShaderMaterial][]) {
      colour(material, palette[name]);
    }
  }

  clear(): void {
    for (const object of [...this.group.children] as (Mesh | LineSegments)[]) {
      object.geometry.dispose();
      this.group.remove(object);
    }
    for (const material of Object.values(this.#materials)) material.dispose();
    for (const name of Object.keys(this.#materials) as ColourName[]) delete this.#materials[name];
  }

  #add(name: ColourName, corners: readonly number[], solid = false): void {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners), 3));
    this.#materials[name] ??= new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: FLAT_VERTEX,
      fragmentShader: FLAT_FRAGMENT,
      uniforms: { uColour: { value: [0, 0, 0] } },
      // Seen from below the plate is not there, so that the first layer can be looked at.
      side: FrontSide,
    });
    const material = this.#materials[name];
    const object: Object3D = solid ? new Mesh(geometry, material) : new LineSegments(geometry, material);
    object.frustumCulled = false;
    object.matrixAutoUpdate = false;
    this.group.add(object);
  }
}

/** A flat bar from the origin. */
function axis([dx, dy]: readonly [number, number], length: Mm): number[] {
  const half = length / 24;
  const from = [dx ? 0 : -half, dy ? 0 : -half] as const;
  return filled(rectangle(from, [dx ? length : half, dy ? length : half], 0));
}

export function colour(material: RawShaderMaterial, hex: HexColour): void {
  const uniform = material.uniforms['uColour'];
  if (uniform) uniform.value = rgb(hex);
}
