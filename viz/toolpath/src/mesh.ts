/**
 * A bed's mesh: whether it can be drawn, its heights, and how many times as high it is drawn.
 *
 * Does not know: drawing (surface.ts), how it was measured. Units: mm, in the machine's coordinates.
 */
import type { Mm } from './units';

export interface BedMesh {
  /** The place of the first column and row. */
  readonly originMm: readonly [Mm, Mm];
  /** From column to column and from row to row. */
  readonly stepMm: readonly [Mm, Mm];
  readonly columns: number;
  readonly rows: number;
  /** Row by row. */
  readonly heightsMm: readonly Mm[];
  /** How many times as high it is drawn; left out: so that it spans a twelfth of its width, at most a hundred times. */
  readonly exaggeration?: number;
}

/** More points than any probe measures. */
const SIDE_MAX = 256;
const EXAGGERATION_MAX = 100;
/** The height of the whole surface as drawn, of its shorter side. */
const DRAWN_PART = 1 / 12;

/** True if it has an area and all its numbers are numbers. */
export function isMesh({ originMm, stepMm, columns, rows, heightsMm, exaggeration = 1 }: BedMesh): boolean {
  const isSide = (count: number): boolean => Number.isInteger(count) && count >= 2 && count <= SIDE_MAX;
  return (
    isSide(columns) &&
    isSide(rows) &&
    heightsMm.length === columns * rows &&
    [...originMm, ...stepMm, ...heightsMm, exaggeration].every(Number.isFinite) &&
    stepMm.every((step) => step > 0)
  );
}

/** The least and the greatest height. */
export function heightRange(mesh: BedMesh): readonly [Mm, Mm] {
  let [min, max] = [Infinity, -Infinity];
  for (const height of mesh.heightsMm) {
    min = Math.min(min, height);
    max = Math.max(max, height);
  }
  return [min, max];
}

/** How many times as high the mesh is drawn as it is. */
export function exaggerationOf(mesh: BedMesh): number {
  if (mesh.exaggeration !== undefined) return mesh.exaggeration;
  const [min, max] = heightRange(mesh);
  const side = Math.min((mesh.columns - 1) * mesh.stepMm[0], (mesh.rows - 1) * mesh.stepMm[1]);
  return Math.min(Math.max((side * DRAWN_PART) / Math.max(max - min, 1e-6), 1), EXAGGERATION_MAX);
}
