// A list of any length behind a scroll bar: which rows are seen, and where the bar stands. Browsers draw no element of
// more than some ten million pixels, so a long list's bar stands for its rows in proportion. Units: rows, CSS pixels.

/** The tallest that the scrolled content gets. */
const CONTENT_MAX_PX = 4_000_000;

export interface Rows {
  readonly count: number;
  readonly rowPx: number;
  readonly viewPx: number;
}

export const contentPx = ({ count, rowPx }: Rows): number => Math.min(count * rowPx, CONTENT_MAX_PX);

/** Whether the bar stands for the rows in proportion only. */
export const isScaled = ({ count, rowPx }: Rows): boolean => count * rowPx > CONTENT_MAX_PX;

/** The row, and part of one, at the top when the list is scrolled to its end. */
export const topMax = ({ count, rowPx, viewPx }: Rows): number => Math.max(0, count - viewPx / rowPx);

const scrollMax = (rows: Rows): number => Math.max(0, contentPx(rows) - rows.viewPx);

export function clampTop(rows: Rows, top: number): number {
  return Math.min(Math.max(top, 0), topMax(rows));
}

/** The row at the top for a bar that stands there. */
export function topAt(rows: Rows, scrollPx: number): number {
  if (!isScaled(rows)) return clampTop(rows, scrollPx / rows.rowPx);
  return clampTop(rows, (scrollPx / Math.max(scrollMax(rows), 1)) * topMax(rows));
}

/** Where the bar stands for this row at the top. */
export function scrollAt(rows: Rows, top: number): number {
  if (!isScaled(rows)) return clampTop(rows, top) * rows.rowPx;
  return (clampTop(rows, top) / Math.max(topMax(rows), 1)) * scrollMax(rows);
}

/** The rows that are seen, from `first` up to `end`, which is not. */
export function seen(rows: Rows, top: number): { readonly first: number; readonly end: number } {
  const first = Math.floor(clampTop(rows, top));
  return { first, end: Math.min(rows.count, Math.ceil(top + rows.viewPx / rows.rowPx) + 1) };
}

/** The row at the top so that this one is seen: as it is where it is seen already, else in the middle. */
export function topToSee(rows: Rows, top: number, row: number): number {
  const inView = rows.viewPx / rows.rowPx;
  if (row >= top && row + 1 <= top + inView) return top;
  return clampTop(rows, row - Math.floor(inView / 2));
}
