/**
 * The list of layers, and which vertices to draw of it.
 *
 * Does: layers to ranges of vertices, a vertex to its layer, and a thinner choice of layers when there is too much to
 * draw at once. Does not know: how anything is drawn. Units: vertex and layer indices, mm.
 */
import type { LayerIndex, Mm, VertexIndex } from './units';

export interface Layer {
  readonly firstVertex: VertexIndex;
  /** Height of the layer's top. */
  readonly zMm: Mm;
  /** How long it takes, s; left out where that is not known. */
  readonly timeS?: number;
}

/** Vertices `first … end − 1`. */
export interface VertexRange {
  readonly first: VertexIndex;
  readonly end: VertexIndex;
}

export const lengthOf = (ranges: readonly VertexRange[]): number =>
  ranges.reduce((sum, { first, end }) => sum + end - first, 0);

/** Of ranges put end to end, what lies `at … at + count − 1` from the beginning. */
export function cut(ranges: readonly VertexRange[], at: number, count: number): VertexRange[] {
  const parts: VertexRange[] = [];
  let before = 0;
  for (const { first, end } of ranges) {
    const from = Math.max(first, first + at - before);
    const to = Math.min(end, first + at + count - before);
    if (to > from) parts.push({ first: from, end: to });
    before += end - first;
  }
  return parts;
}

/** What to draw when there is too much. */
export interface ReducedDetail {
  readonly ranges: readonly VertexRange[];
  /** Every how many layers one is drawn: its beads stand for the ones below, so they are drawn that much higher. */
  readonly layerStep: number;
  /** Of the ranges' segments every how many one is drawn. */
  readonly stride: number;
}

/** Beads higher than this many layers no longer look like the part. */
const LAYER_STEP_MAX = 10;

export class LayerList {
  readonly #layers: readonly Layer[];

  /** Layers in the file's order; those out of order are left out. */
  constructor(layers: readonly Layer[] = []) {
    const ordered: Layer[] = [];
    for (const layer of layers) {
      const last = ordered.at(-1);
      if (!last || layer.firstVertex > last.firstVertex) ordered.push(layer);
      else if (layer.firstVertex === last.firstVertex) ordered[ordered.length - 1] = layer;
    }
    this.#layers = ordered;
  }

  /** The same layers in another numbering of the vertices. */
  mapped(to: (vertex: VertexIndex) => VertexIndex): LayerList {
    return new LayerList(this.#layers.map((layer) => ({ ...layer, firstVertex: to(layer.firstVertex) })));
  }

  get count(): number {
    return this.#layers.length;
  }

  /** The vertices of layers `from … to` (both included); what comes before the first layer belongs to it. */
  range(from: LayerIndex, to: LayerIndex, vertexCount: number): VertexRange {
    if (this.count === 0) return { first: 0, end: vertexCount };
    const first = from <= 0 ? 0 : (this.#layers[from]?.firstVertex ?? vertexCount);
    const end = to < 0 ? 0 : (this.#layers[to + 1]?.firstVertex ?? vertexCount);
    return {
      first: Math.min(first, vertexCount),
      end: Math.max(Math.min(end, vertexCount), Math.min(first, vertexCount)),
    };
  }

  /** The layer in which the vertex lies; 0 if there are none. */
  layerOf(vertex: VertexIndex): LayerIndex {
    let [low, high] = [0, this.count - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if ((this.#layers[middle]?.firstVertex ?? 0) <= vertex) low = middle;
      else high = middle - 1;
    }
    return Math.max(low, 0);
  }

  /** A choice from `range` of about `budget` segments: whole layers, counted down from the topmost, then a stride. */
  reduced(range: VertexRange, budget: number): ReducedDetail {
    const total = range.end - range.first;
    const wanted = Math.ceil(total / Math.max(budget, 1));
    if (wanted <= 1) return { ranges: [range], layerStep: 1, stride: 1 };
    const [bottom, top] = [this.layerOf(range.first), this.layerOf(Math.max(range.end - 1, 0))];

    const layerStep = Math.min(wanted, LAYER_STEP_MAX, Math.max(Math.floor((top - bottom + 1) / 2), 1));
    const ranges: VertexRange[] = [];
    for (let layer = top; layer >= bottom; layer -= layerStep) {
      const whole = this.range(layer, layer, range.end);
      ranges.push({ first: Math.max(whole.first, range.first), end: Math.min(whole.end, range.end) });
    }
    const kept = ranges.reduce((sum, { first, end }) => sum + end - first, 0);
    const stride = Math.max(Math.ceil(kept / Math.max(budget, 1) - 0.5), 1);
    return { ranges: ranges.reverse(), layerStep, stride };
  }
}
