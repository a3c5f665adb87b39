/**
 * A coarser path for pictures in motion: runs of short segments become one, within a tolerance.
 *
 * Does: takes vertices as they come, in any pieces, and hands out those that are kept, in the same layout, with their
 * indices in the file. A run ends where feature, layer, width or height change, at travels and at markers. The tolerance is kept with a
 * wedge of directions from the run's first vertex (Williams 1978, Sklansky and Gonzalez 1980), so each vertex is
 * looked at once. Does not know: drawing. Units: steps of the header; the tolerance in mm.
 */
import { ChannelSum } from './channels';
import { LEAD_TEXELS, TexelStore, VertexStore } from './chunks';
import { LayerList, type ReducedDetail, type VertexRange } from './layers';
import type { Mm, VertexIndex } from './units';
import { FLAGS, type VertexHeader, WORDS_PER_VERTEX } from './vertex';

/** How far a left-out vertex may lie beside the coarse path: less than a bead's width. */
export const TOLERANCE_MM: Mm = 0.15;
/** A run may climb so much (a vase's spiral) before a vertex is kept. */
const CLIMB_MAX_MM: Mm = 0.05;
/** A run has at most so many segments, so that the printed part is told apart finely enough. */
const RUN_MAX = 256;

const POSITION = 0xf_ffff;
const SIZE_AND_REST = ~POSITION >>> 0;
const NEW_RUN = FLAGS.travel | FLAGS.break | FLAGS.retract | FLAGS.unretract;

export class Coarsener {
  readonly #tolerance: number;
  readonly #climb: number;
  /** The file's index of each kept vertex. */
  #kept = new Uint32Array(1024);
  #count = 0;
  /** Vertices seen. */
  #seen = 0;
  readonly #last = new Uint32Array(WORDS_PER_VERTEX);
  #run = 0;
  #anchor: readonly [number, number, number] = [0, 0, 0];
  /** Directions from the anchor that pass all vertices left out: from `#low` to `#high` around `#middle`, in radians. */
  #middle = 0;
  #low = 0;
  #high = 0;
  #reach = 0;

  constructor(header: VertexHeader) {
    this.#tolerance = TOLERANCE_MM / header.stepMm;
    this.#climb = CLIMB_MAX_MM / header.stepMm;
  }

  get count(): number {
    return this.#count;
  }

  /** The coarse index of the first kept vertex at or behind a vertex of the file. */
  coarseOf(vertex: VertexIndex): number {
    let [low, high] = [0, this.#count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.#kept[middle] ?? 0) < vertex) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The file's index of a kept vertex; null for one that is not known yet. */
  fileIndex(kept: number): VertexIndex | null {
    return kept < this.#count ? (this.#kept[kept] ?? null) : null;
  }

  /** The kept ones of these vertices and of the one held back before; the last one is held back. */
  push(words: Uint32Array): Uint32Array {
    const total = Math.floor(words.length / WORDS_PER_VERTEX);
    const out = new Uint32Array((total + 1) * WORDS_PER_VERTEX);
    let filled = 0;
    for (let vertex = 0; vertex < total; vertex++) {
      const base = vertex * WORDS_PER_VERTEX;
      if (this.#seen > 0 && !this.#passes(words, base)) {
        out.set(this.#last, filled);
        filled += WORDS_PER_VERTEX;
        this.#keepLast();
        // The wedge of the new run begins with this vertex.
        this.#passes(words, base);
      }
      for (let word = 0; word < WORDS_PER_VERTEX; word++) this.#last[word] = words[base + word] ?? 0;
      this.#seen += 1;
    }
    return out.subarray(0, filled);
  }

  /** The vertex held back. */
  finish(): Uint32Array {
    if (this.#seen === 0 || (this.#count > 0 && this.#kept[this.#count - 1] === this.#seen - 1)) {
      return new Uint32Array(0);
    }
    this.#keepLast();
    return this.#last.slice();
  }

  /** Notes the vertex held back as kept; a new run begins there. */
  #keepLast(): void {
    if (this.#count === this.#kept.length) {
      const grown = new Uint32Array(this.#kept.length * 2);
      grown.set(this.#kept);
      this.#kept = grown;
    }
    this.#kept[this.#count++] = this.#seen - 1;
    const [x = 0, y = 0, z = 0] = this.#last;
    this.#anchor = [x & POSITION, y & POSITION, z & POSITION];
    this.#run = 0;
    this.#reach = 0;
  }

  /** True if the vertex held back may be left out, now that the one at `base` follows; narrows the wedge. */
  #passes(words: Uint32Array, base: number): boolean {
    const [lastX = 0, lastY = 0, lastZ = 0, lastRest = 0] = this.#last;
    const [x, y, z] = [words[base] ?? 0, words[base + 1] ?? 0, words[base + 2] ?? 0];
    const first = this.#run === 0 && this.#count > 0;
    if (!first) {
      const same =
        ((lastX ^ x) & SIZE_AND_REST) === 0 &&
        ((lastY ^ y) & SIZE_AND_REST) === 0 &&
        ((lastZ ^ z) & SIZE_AND_REST) === 0 &&
        lastRest === words[base + 3];
      if (!same || (z & NEW_RUN) !== 0 || this.#run >= RUN_MAX || this.#count === 0) return false;
    }
    const dx = (x & POSITION) - this.#anchor[0];
    const dy = (y & POSITION) - this.#anchor[1];
    const distance = Math.hypot(dx, dy);
    const climbed = Math.abs((z & POSITION) - this.#anchor[2]) > this.#climb;
    if (!first && (climbed || distance < this.#reach)) return false;
    return this.#narrow(dx, dy, distance, first);
  }

  #narrow(dx: number, dy: number, distance: number, first: boolean): boolean {
    const half = distance > this.#tolerance ? Math.asin(this.#tolerance / distance) : Math.PI;
    const angle = Math.atan2(dy, dx);
    if (first) {
      this.#middle = angle;
      this.#low = -half;
      this.#high = half;
    } else {
      const turn = wrapped(angle - this.#middle);
      if (turn < this.#low || turn > this.#high) return false;
      this.#low = Math.max(this.#low, turn - half);
      this.#high = Math.min(this.#high, turn + half);
    }
    this.#run += 1;
    this.#reach = distance;
    return true;
  }
}

/** The same angle between −π and π. */
function wrapped(angle: number): number {
  if (angle > Math.PI) return angle - 2 * Math.PI;
  return angle < -Math.PI ? angle + 2 * Math.PI : angle;
}

/** The coarse path of a file, beside the full one. */
export class Rough {
  readonly store: VertexStore;
  /** Of the kept vertices. */
  readonly channels = new TexelStore(0);
  readonly #coarsener: Coarsener;
  readonly #sum = new ChannelSum();
  readonly #taken = new Uint32Array(WORDS_PER_VERTEX);
  /** The file's vertex whose channels are taken next. */
  #nextChannels = 0;
  #layers = new LayerList();
  /** What `#layers` was made from. */
  #from: { readonly layers: LayerList; readonly count: number } | null = null;

  constructor(header: VertexHeader) {
    this.store = new VertexStore(header);
    this.#coarsener = new Coarsener(header);
  }

  append(words: Uint32Array): void {
    this.store.append(this.#coarsener.push(words));
  }

  end(): void {
    this.store.append(this.#coarsener.finish());
  }

  /** Takes the channels of all vertices of which it is known whether they are kept; each is looked at once. */
  takeChannels(channels: TexelStore): void {
    let kept = this.channels.count;
    const last = this.#coarsener.fileIndex(this.#coarsener.count - 1);
    if (last === null) return;
    const parts = channels.split({ first: this.#nextChannels, end: last + 1 });
    for (const { chunk, first, count } of parts) {
      const out: number[] = [];
      for (let at = first; at < first + count; at++) {
        this.#sum.add(chunk.data, (LEAD_TEXELS + at) * WORDS_PER_VERTEX);
        if (this.#coarsener.fileIndex(kept) !== chunk.firstVertex + at) continue;
        this.#sum.take(this.#taken, 0);
        out.push(...this.#taken);
        kept += 1;
      }
      this.channels.append(Uint32Array.from(out));
      this.#nextChannels = chunk.firstVertex + first + count;
    }
  }

  coarseOf(vertex: VertexIndex): number {
    return this.#coarsener.coarseOf(vertex);
  }

  /** What to draw of a range of the full path with about so many segments; the ranges are coarse. */
  reduced(range: VertexRange, layers: LayerList, budget: number): ReducedDetail {
    const count = this.store.count;
    if (this.#from?.layers !== layers || this.#from.count !== count) {
      this.#layers = layers.mapped((vertex) => this.coarseOf(vertex));
      this.#from = { layers, count };
    }
    const coarse = { first: this.coarseOf(range.first), end: Math.min(this.coarseOf(range.end), count) };
    return this.#layers.reduced(coarse, budget);
  }
}
