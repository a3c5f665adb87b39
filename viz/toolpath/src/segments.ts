/**
 * Lists of segments of the full path, for pictures in motion: four bytes a segment, the texel where it begins and the one where
 * it ends, both in the textures that the full picture is drawn from.
 *
 * Does: keeps the segments in the order of the file, a list for each chunk of vertices, and finds those of a range. Does not
 * know: which segments are listed, drawing. Units: indices of entries, counted over all chunks; vertex indices.
 */
import { LEAD_TEXELS, TEXELS_PER_ROW, VERTICES_PER_CHUNK } from './chunks';
import type { VertexRange } from './layers';
import type { VertexIndex } from './units';

/** Bits of a texel's number. */
export const TEXEL_BITS = 16;
export const TEXEL_MASK = (1 << TEXEL_BITS) - 1;

/** The segments of one chunk. */
export interface SegmentChunk {
  /** The chunk of vertices that they lie in. */
  readonly index: number;
  /** Entries of the chunks before. */
  readonly firstEntry: number;
  /** Whole rows: the end's texel below, the beginning's above. */
  data: Uint32Array<ArrayBuffer>;
  count: number;
}

/** A part of a chunk's list, counted from its first. */
export interface SegmentRange {
  readonly chunk: SegmentChunk;
  readonly first: number;
  readonly count: number;
}

export class SegmentList {
  readonly chunks: SegmentChunk[] = [];
  #count = 0;

  get count(): number {
    return this.#count;
  }

  /** Adds a segment of this chunk of vertices; none of a chunk before may follow. */
  push(index: number, fromTexel: number, toTexel: number): void {
    while (this.chunks.length <= index) {
      const data = new Uint32Array(TEXELS_PER_ROW);
      this.chunks.push({ index: this.chunks.length, firstEntry: this.#count, data, count: 0 });
    }
    const chunk = this.chunks[index];
    if (!chunk) return;
    if (chunk.count === chunk.data.length) {
      const grown = new Uint32Array(chunk.data.length * 2);
      grown.set(chunk.data);
      chunk.data = grown;
    }
    chunk.data[chunk.count++] = (fromTexel << TEXEL_BITS) | toTexel;
    this.#count += 1;
  }

  /** The first entry that ends at this vertex or behind it. */
  entryAt(vertex: VertexIndex): number {
    const chunk = this.chunks[Math.floor(Math.max(vertex, 0) / VERTICES_PER_CHUNK)];
    if (!chunk) return vertex <= 0 ? 0 : this.#count;
    const texel = LEAD_TEXELS + (vertex % VERTICES_PER_CHUNK);
    let [low, high] = [0, chunk.count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (((chunk.data[middle] ?? 0) & TEXEL_MASK) < texel) low = middle + 1;
      else high = middle;
    }
    return chunk.firstEntry + low;
  }

  /** Entries that end in a range of vertices. */
  within({ first, end }: VertexRange): VertexRange {
    return { first: this.entryAt(first), end: this.entryAt(end) };
  }

  /** Where a range of entries lies. */
  split({ first, end }: VertexRange): SegmentRange[] {
    const parts: SegmentRange[] = [];
    for (const chunk of this.chunks) {
      const from = Math.max(first - chunk.firstEntry, 0);
      const to = Math.min(end - chunk.firstEntry, chunk.count);
      if (to > from) parts.push({ chunk, first: from, count: to - from });
    }
    return parts;
  }
}
