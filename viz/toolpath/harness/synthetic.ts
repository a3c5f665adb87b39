/**
 * A made-up part for looking at and measuring: a fluted vase beside a box with walls, infill, top and seams.
 *
 * Units: mm. The same arguments give the same vertices.
 */
import { type Made, type Point, square, Writer } from './writer';

function vase(cx: number, cy: number, radius: number, z: number, sides: number): [number, number][] {
  const points: [number, number][] = [];
  for (let side = 0; side < sides; side++) {
    const angle = (side / sides) * 2 * Math.PI;
    const flute = 1 + 0.07 * Math.sin(12 * angle + z * 0.05) + 0.18 * Math.sin(z * 0.06);
    points.push([cx + radius * flute * Math.cos(angle), cy + radius * flute * Math.sin(angle)]);
  }
  return points;
}

function zigzag(out: Writer, x0: number, y0: number, x1: number, y1: number, step: number): void {
  out.travel(x0, y0);
  let up = true;
  for (let x = x0; x <= x1; x += step) {
    out.to(x, up ? y0 : y1);
    out.to(x, up ? y1 : y0);
    up = !up;
  }
}

/** Three walls, the outer one last and slower. */
function walls(out: Writer, loop: (insetMm: number) => Point[]): void {
  for (let wall = 2; wall >= 0; wall--) {
    out.manner.feature = wall === 0 ? 'outerWall' : 'innerWall';
    out.manner.feedMmS = wall === 0 ? 40 : 80;
    out.loop(loop(wall * 0.42));
  }
}

function box(out: Writer, layer: number, layers: number): void {
  walls(out, (inset) => square(110 + inset, 50 + inset, 150 - inset, 100 - inset));
  const solid = layer < 3 || layer >= layers - 3;
  out.manner.feature = layer === layers - 1 ? 'topSurface' : solid ? 'solidInfill' : 'infill';
  out.manner.feedMmS = solid ? 100 : 150;
  zigzag(out, 111.4, 51.4, 148.6, 98.6, solid ? 0.42 : 2.4);
}

/** About so many segments. */
export function synthetic(segments: number): Made {
  const out = new Writer();
  const count = Math.round(Math.min(Math.max(Math.sqrt(segments) / 2.2, 40), 300));
  const sides = Math.max(Math.round((segments / count - 260) / 3), 24);
  const boxLayers = Math.min(count, 60);
  out.manner.feature = 'skirt';
  for (let layer = 0; layer < count; layer++) {
    out.layer(30 - 20 * (layer / count));
    if (layer === 0) out.loop(square(20, 20, 160, 130));
    out.manner.reached = 0.6 + 0.4 * Math.abs(Math.sin(layer / 7));
    out.manner.fan = Math.min(layer * 20, 100);
    out.manner.object = 1;
    walls(out, (inset) => vase(60, 75, 28 - inset, out.z, sides));
    out.manner.object = 2;
    if (layer < boxLayers) box(out, layer, boxLayers);
  }
  return out.made();
}
