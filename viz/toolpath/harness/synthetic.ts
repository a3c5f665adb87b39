/**
 * A made-up part for looking at and measuring: a fluted vase beside a box with walls, infill, top and seams.
 *
 * Units: mm. The same arguments give the same vertices.
 */
import type { Layer } from '../src/layers';
import { encodeVertex, type FeatureName, FLAGS, type VertexHeader, WORDS_PER_VERTEX } from '../src/vertex';

export const HEADER: VertexHeader = { originMm: [-20, -20, -1], stepMm: 2 ** -10 };
const LAYER_MM = 0.2;
const WIDTH_MM = 0.45;

export interface Synthetic {
  readonly vertices: Uint32Array<ArrayBuffer>;
  readonly layers: Layer[];
}

class Writer {
  words = new Uint32Array(1 << 16);
  count = 0;
  z = LAYER_MM;
  layer = 0;
  #at: readonly [number, number] = [0, 0];

  to(x: number, y: number, feature: FeatureName, flags = 0, widthMm = WIDTH_MM): void {
    if ((this.count + 1) * WORDS_PER_VERTEX > this.words.length) {
      const grown = new Uint32Array(this.words.length * 2);
      grown.set(this.words);
      this.words = grown;
    }
    const start = this.count === 0 ? FLAGS.break : 0;
    encodeVertex(HEADER, this.words, this.count, {
      positionMm: [x, y, this.z],
      widthMm,
      heightMm: LAYER_MM,
      feature,
      layer: this.layer,
      flags: flags | start,
    });
    this.count += 1;
    this.#at = [x, y];
  }

  travel(x: number, y: number, feature: FeatureName): void {
    this.to(...this.#at, feature, FLAGS.retract | FLAGS.travel);
    this.to(x, y, feature, FLAGS.travel);
    this.to(x, y, feature, FLAGS.travel | FLAGS.unretract);
  }

  loop(points: readonly (readonly [number, number])[], feature: FeatureName): void {
    const first = points[0];
    if (!first) return;
    this.travel(...first, feature);
    for (const [x, y] of points.slice(1)) this.to(x, y, feature);
    this.to(...first, feature, feature === 'outerWall' ? FLAGS.seam : 0);
  }
}

function vase(cx: number, cy: number, radius: number, z: number, sides: number): [number, number][] {
  const points: [number, number][] = [];
  for (let side = 0; side < sides; side++) {
    const angle = (side / sides) * 2 * Math.PI;
    const flute = 1 + 0.07 * Math.sin(12 * angle + z * 0.05) + 0.18 * Math.sin(z * 0.06);
    points.push([cx + radius * flute * Math.cos(angle), cy + radius * flute * Math.sin(angle)]);
  }
  return points;
}

const square = (x0: number, y0: number, x1: number, y1: number): [number, number][] => [
  [x0, y0],
  [x1, y0],
  [x1, y1],
  [x0, y1],
];

function zigzag(
  out: Writer,
  x0: number,
  y0: number,
  x1: number,
  y1: number,
  step: number,
  feature: FeatureName,
): void {
  out.travel(x0, y0, feature);
  let up = true;
  for (let x = x0; x <= x1; x += step) {
    out.to(x, up ? y0 : y1, feature);
    out.to(x, up ? y1 : y0, feature);
    up = !up;
  }
}

/** Three walls, the outer one last. */
function walls(out: Writer, loop: (insetMm: number) => [number, number][]): void {
  for (let wall = 2; wall >= 0; wall--) out.loop(loop(wall * 0.42), wall === 0 ? 'outerWall' : 'innerWall');
}

function box(out: Writer, layer: number, layers: number): void {
  walls(out, (inset) => square(110 + inset, 50 + inset, 150 - inset, 100 - inset));
  const solid = layer < 3 || layer >= layers - 3;
  const feature = layer === layers - 1 ? 'topSurface' : solid ? 'solidInfill' : 'infill';
  zigzag(out, 111.4, 51.4, 148.6, 98.6, solid ? 0.42 : 2.4, feature);
}

/** About so many segments. */
export function synthetic(segments: number): Synthetic {
  const out = new Writer();
  const layers: Layer[] = [];
  const count = Math.round(Math.min(Math.max(Math.sqrt(segments) / 2.2, 40), 300));
  const sides = Math.max(Math.round((segments / count - 260) / 3), 24);
  const boxLayers = Math.min(count, 60);
  out.loop(square(20, 20, 160, 130), 'skirt');
  for (let layer = 0; layer < count; layer++) {
    layers.push({ firstVertex: layer === 0 ? 0 : out.count, zMm: out.z });
    out.layer = layer;
    walls(out, (inset) => vase(60, 75, 28 - inset, out.z, sides));
    if (layer < boxLayers) box(out, layer, boxLayers);
    out.z += LAYER_MM;
  }
  return { vertices: out.words.slice(0, out.count * WORDS_PER_VERTEX), layers };
}
