/**
 * A coarser path for pictures in motion: runs of short segments become one, within a tolerance. Outer walls are listed apart from
 * the rest, so that they can be drawn first.
 *
 * Does: takes vertices as they come, in any pieces, and lists segments from vertex to vertex of the full path. A run ends where
 * feature, layer, width or height change, at what is not laid, and where a chunk of vertices ends. The tolerance is kept with a
 * wedge of directions from the run's first vertex (Williams 1978, Sklansky and Gonzalez 1980), so each vertex is looked at
 * once. Does not know: drawing. Units: steps of the header; the tolerance in mm.
 */
import { LEAD_TEXELS, VERTICES_PER_CHUNK } from './chunks';
import { LayerList, type ReducedDetail, type VertexRange } from './layers';
import { SegmentList } from './segments';
import type { Mm } from './units';
import { FIELDS, FLAGS, featureNumber, type VertexHeader, WORDS_PER_VERTEX } from './vertex';

/** How far a left-out vertex may lie beside the coarse path: less than a bead's width. */
export const TOLERANCE_MM: Mm = 0.15;
/** A run may climb so much (a vase's spiral) before it ends. */
const CLIMB_MAX_MM: Mm = 0.05;
/** A run has at most so many segments, so that the printed part is told apart finely enough. */
const RUN_MAX = 256;

/** From straight on to aside, in radians. */
const HALF_TURN = Math.PI / 2;
const POSITION = 0xf_ffff;
const SIZE = ~POSITION;
const FEATURE = ((1 << FIELDS.feature.bits) - 1) << FIELDS.feature.shift;
const NOT_LAID = FLAGS.travel | FLAGS.break;
const OUTER_WALLS = (1 << featureNumber('outerWall')) | (1 << featureNumber('overhangWall'));

export class Coarsener {
  readonly #take: (isOuter: boolean, chunk: number, fromTexel: number, toTexel: number) => void;
  readonly #tolerance: number;
  readonly #climb: number;
  /** Vertices seen. */
  #seen = 0;
  /** The last of them. */
  readonly #last = new Uint32Array(WORDS_PER_VERTEX);
  /** Segments of the run that is open; 0: none is. */
  #run = 0;
  /** The vertex where it begins. */
  #first = 0;
  #anchorX = 0;
  #anchorY = 0;
  #anchorZ = 0;
  /** Directions from there that pass all vertices left out: from `#low` to `#high` around `#aheadX`, `#aheadY`, in radians. */
  #aheadX = 0;
  #aheadY = 0;
  #low = 0;
  #high = 0;
  #reach = 0;

  constructor(
    header: VertexHeader,
    take: (isOuter: boolean, chunk: number, fromTexel: number, toTexel: number) => void,
  ) {
    this.#take = take;
    this.#tolerance = TOLERANCE_MM / header.stepMm;
    this.#climb = CLIMB_MAX_MM / header.stepMm;
  }

  push(words: Uint32Array): void {
    const last = this.#last;
    const end = words.length - (words.length % WORDS_PER_VERTEX);
    for (let base = 0; base < end; base += WORDS_PER_VERTEX) {
      const x = words[base] ?? 0;
      const y = words[base + 1] ?? 0;
      const z = words[base + 2] ?? 0;
      const rest = words[base + 3] ?? 0;
      const opensChunk = this.#seen % VERTICES_PER_CHUNK === 0;
      if (this.#run > 0 && (opensChunk || !this.#goesOn(x, y, z, rest))) this.#close();
      // Without a vertex before it there is no segment.
      if (this.#run === 0 && (z & NOT_LAID) === 0 && this.#seen > 0) this.#open(x, y);
      last[0] = x;
      last[1] = y;
      last[2] = z;
      last[3] = rest;
      this.#seen += 1;
    }
  }

  /** No more vertices come. */
  finish(): void {
    if (this.#run > 0) this.#close();
  }

  /** A run begins at the last vertex; its first segment ends at x, y. */
  #open(x: number, y: number): void {
    this.#first = this.#seen - 1;
    this.#anchorX = (this.#last[0] ?? 0) & POSITION;
    this.#anchorY = (this.#last[1] ?? 0) & POSITION;
    this.#anchorZ = (this.#last[2] ?? 0) & POSITION;
    const dx = (x & POSITION) - this.#anchorX;
    const dy = (y & POSITION) - this.#anchorY;
    const distance = Math.sqrt(dx * dx + dy * dy);
    const half = this.#halfAngle(distance);
    this.#aheadX = dx;
    this.#aheadY = dy;
    this.#low = -half;
    this.#high = half;
    this.#reach = distance;
    this.#run = 1;
  }

  /** The run ends at the last vertex. */
  #close(): void {
    const to = this.#seen - 1;
    const chunk = Math.floor(to / VERTICES_PER_CHUNK);
    const before = LEAD_TEXELS - chunk * VERTICES_PER_CHUNK;
    const isOuter = ((OUTER_WALLS >>> (((this.#last[2] ?? 0) & FEATURE) >>> FIELDS.feature.shift)) & 1) === 1;
    this.#take(isOuter, chunk, this.#first + before, to + before);
    this.#run = 0;
  }

  /** True if the last vertex may be left out, now that this one follows; narrows the wedge. */
  #goesOn(x: number, y: number, z: number, rest: number): boolean {
    const last = this.#last;
    if ((z & NOT_LAID) !== 0 || this.#run >= RUN_MAX) return false;
    if ((((last[0] ?? 0) ^ x) & SIZE) !== 0 || (((last[1] ?? 0) ^ y) & SIZE) !== 0) return false;
    if ((((last[2] ?? 0) ^ z) & FEATURE) !== 0 || last[3] !== rest) return false;
    const dx = (x & POSITION) - this.#anchorX;
    const dy = (y & POSITION) - this.#anchorY;
    const distance = Math.sqrt(dx * dx + dy * dy);
    // Back on the same way, or too steep.
    if (distance < this.#reach || Math.abs((z & POSITION) - this.#anchorZ) > this.#climb) return false;
    const along = this.#aheadX * dx + this.#aheadY * dy;
    const aside = this.#aheadX * dy - this.#aheadY * dx;
    // Corners need no angle.
    if (along < 0 && this.#low > -HALF_TURN && this.#high < HALF_TURN) return false;
    const turn = angleOf(along, aside);
    if (turn < this.#low || turn > this.#high) return false;
    const half = this.#halfAngle(distance);
    this.#low = Math.max(this.#low, turn - half);
    this.#high = Math.min(this.#high, turn + half);
    this.#run += 1;
    this.#reach = distance;
    return true;
  }

  /** How far a direction may turn before a place at this distance is passed beside. */
  #halfAngle(distance: number): number {
    if (distance <= this.#tolerance) return Math.PI;
    const sine = this.#tolerance / distance;
    // Less than the arc sine by less than 1 %: a little nearer than the tolerance, and there are millions.
    return sine < 0.5 ? sine * (1 + (sine * sine) / 6) : Math.asin(sine);
  }
}

/** The direction of x, y in radians: small ones, and nearly all are, by their series, within 10⁻⁵. */
function angleOf(x: number, y: number): number {
  const slope = y / x;
  if (!(x > 0 && slope < 0.25 && slope > -0.25)) return Math.atan2(y, x);
  const square = slope * slope;
  return slope * (1 - square * (1 / 3 - square / 5));
}

/** Of the segments' budget, what outer walls may take at most where there is more to draw. */
const OUTER_SHARE = 0.65;

/** The coarse path of a file, beside the full one. */
export class Rough {
  /** The outer walls. */
  readonly outer = new RoughList();
  /** All the rest. */
  readonly inner = new RoughList();
  readonly #coarsener: Coarsener;

  constructor(header: VertexHeader) {
    this.#coarsener = new Coarsener(header, (isOuter, chunk, from, to) => {
      (isOuter ? this.outer : this.inner).segments.push(chunk, from, to);
    });
  }

  append(words: Uint32Array): void {
    this.#coarsener.push(words);
  }

  end(): void {
    this.#coarsener.finish();
  }

  /** How many segments of the lists to draw of a budget: outer walls come first. */
  shares(ranges: readonly VertexRange[], budget: number): readonly [outer: number, inner: number] {
    const outer = this.outer.total(ranges);
    const inner = this.inner.total(ranges);
    const forOuter = Math.min(outer, Math.max(budget * OUTER_SHARE, budget - inner));
    return [forOuter, Math.min(inner, budget - forOuter)];
  }
}

/** Segments of one kind. */
export class RoughList {
  readonly segments = new SegmentList();
  #layers = new LayerList();
  /** What `#layers` was made from. */
  #from: { readonly layers: LayerList; readonly count: number } | null = null;

  /** Segments that end in these ranges of vertices. */
  total(ranges: readonly VertexRange[]): number {
    return ranges.reduce((sum, range) => {
      const { first, end } = this.segments.within(range);
      return sum + end - first;
    }, 0);
  }

  /** What to draw of a range of vertices with about so many segments; the ranges are of entries. */
  reduced(range: VertexRange, layers: LayerList, budget: number): ReducedDetail {
    const { count } = this.segments;
    if (this.#from?.layers !== layers || this.#from.count !== count) {
      this.#layers = layers.mapped((vertex) => this.segments.entryAt(vertex));
      this.#from = { layers, count };
    }
    return this.#layers.reduced(this.segments.within(range), budget);
  }
}
