/**
 * Some vertices or their channels, taken out of the store for whoever asks for them.
 *
 * Does not know: what they are wanted for. Units: vertex indices; words as in docs/vertex.md.
 */
import { LEAD_TEXELS, type TexelStore } from './chunks';
import type { VertexRange } from './layers';
import { WORDS_PER_VERTEX } from './vertex';

/** Vertices that are handed out at once, at most. */
export const SLICE_MAX = 1 << 16;

/** What there is of the range, not more than {@link SLICE_MAX}. */
export function sliceOf(store: TexelStore, { first, end }: VertexRange): Uint32Array<ArrayBuffer> {
  const from = Math.max(0, Math.floor(first));
  const to = Math.min(Math.floor(end), store.count, from + SLICE_MAX);
  const words = new Uint32Array(Math.max(0, to - from) * WORDS_PER_VERTEX);
  let used = 0;
  for (const { chunk, first: at, count } of store.split({ first: from, end: Math.max(to, from) })) {
    const start = (LEAD_TEXELS + at) * WORDS_PER_VERTEX;
    const part = chunk.data.subarray(start, start + count * WORDS_PER_VERTEX);
    words.set(part, used);
    used += part.length;
  }
  return words;
}
