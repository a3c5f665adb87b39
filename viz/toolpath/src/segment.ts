/**
 * One segment of the path: from the vertex before to its own.
 *
 * Units: mm.
 */
import type { Vec3 } from './camera';
import { LEAD_TEXELS, type VertexStore } from './chunks';
import type { Mm, VertexIndex } from './units';
import { FLAGS, field, hasFlag, positionMm, SIZE_STEP_MM } from './vertex';

export interface Segment {
  readonly from: Vec3;
  readonly to: Vec3;
  /** 0 for a travel, and where it is not known. */
  readonly widthMm: Mm;
  readonly heightMm: Mm;
}

/** The segment that ends at a vertex; null where none does. */
export function segmentAt(store: VertexStore, vertex: VertexIndex): Segment | null {
  const chunk = store.chunkOf(vertex);
  if (!chunk || vertex < 0 || vertex >= store.count || !Number.isInteger(vertex)) return null;
  const texel = LEAD_TEXELS + vertex - chunk.firstVertex;
  if (hasFlag(chunk.data, texel, FLAGS.break)) return null;
  return {
    from: positionMm(store.header, chunk.data, texel - 1),
    to: positionMm(store.header, chunk.data, texel),
    widthMm: field(chunk.data, texel, 'width') * SIZE_STEP_MM,
    heightMm: field(chunk.data, texel, 'height') * SIZE_STEP_MM,
  };
}
