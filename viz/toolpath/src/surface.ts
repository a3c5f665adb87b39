/**
 * The bed's mesh as it is handed over.
 *
 * Units: mm, in the machine's coordinates.
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
}

/** More points than any probe measures. */
const SIDE_MAX = 256;

/** True if it has an area and all its numbers are numbers. */
export function isMesh({ originMm, stepMm, columns, rows, heightsMm }: BedMesh): boolean {
  const isSide = (count: number): boolean => Number.isInteger(count) && count >= 2 && count <= SIDE_MAX;
  return (
    isSide(columns) &&
    isSide(rows) &&
    heightsMm.length === columns * rows &&
    [...originMm, ...stepMm, ...heightsMm].every(Number.isFinite) &&
    stepMm.every((step) => step > 0)
  );
}
