// What is known of the segment that is looked at: from the file's geometry, from the planner, and from its line of text.
import { computed, effect, signal } from '@preact/signals';
import { type Channels, decodeChannels, decodeVertex, type Slice, type Vertex } from '@stepcast/toolpath';
import { lineText, textVersion, wantLine } from './file_text';
import { lineMarks } from './preview';
import { isShown, progress } from './print';
import { cursor, ranges } from './view';
import { verticesOf } from './view_answers';

export interface Segment {
  readonly vertex: number;
  /** Counted from 1; null where it is not known. */
  readonly line: number | null;
  readonly geometry: Vertex;
  readonly lengthMm: number;
  /** Null until the planner has come so far, and where there is no plan. */
  readonly planned: Channels | null;
}

/** The segment that ends at a vertex; `vertex` and the one before it are in the slice. */
export function segmentOf(slice: Slice, vertex: number, line: number | null): Segment | null {
  const at = vertex - slice.first;
  if (!slice.header || at < 0 || slice.vertices.length < (at + 1) * 4) return null;
  const geometry = decodeVertex(slice.header, slice.vertices, at);
  const before = at > 0 ? decodeVertex(slice.header, slice.vertices, at - 1).positionMm : geometry.positionMm;
  const [x, y, z] = geometry.positionMm;
  const lengthMm = geometry.break ? 0 : Math.hypot(x - before[0], y - before[1], z - before[2]);
  return { vertex, line, geometry, lengthMm, planned: decodeChannels(slice.channels, at) };
}

export async function lookUp(vertex: number, line: number | null = null): Promise<Segment | null> {
  const slice = await verticesOf(Math.max(0, vertex - 1), vertex + 1);
  return slice && segmentOf(slice, vertex, line ?? lineMarks().lineAt(vertex));
}

/** The segment at the cursor. */
export const segment = signal<Segment | null>(null);

/** What stands in the file where it comes from; null until that is there. */
export const command = computed(() => {
  textVersion.value;
  const line = segment.value?.line;
  return line ? (lineText(line) ?? null) : null;
});

/** The line that the text is to show: where the cursor is, else what is being printed. */
export const lineInView = computed<number | null>(() => {
  const at = cursor.value;
  // While moves are played the line may be some of them behind.
  if (at) return at.line ?? segment.value?.line ?? null;
  return isShown.value ? (progress.value?.line ?? null) : null;
});

/** Looks up what is at the cursor, the latest place alone when it moves fast. */
export function followCursor(): () => void {
  let isBusy = false;
  const look = async (): Promise<void> => {
    isBusy = true;
    for (let at = cursor.peek(), isOld = true; isOld; ) {
      const found = at && (await lookUp(at.vertex, at.line));
      segment.value = found;
      if (found?.line) wantLine(found.line);
      isOld = cursor.peek() !== at;
      at = cursor.peek();
    }
    isBusy = false;
  };
  return effect(() => {
    cursor.value;
    // What the planner knows may come later than the geometry.
    ranges.value.isWhole;
    if (!isBusy) void look();
  });
}
