// What the 3D view shows of the file: layers, moves, colours, what is chosen. Numbers of vertices and layers count from 0.
// Knows neither the view nor the page.
import { computed, signal } from '@preact/signals';
import type { ColourMode, ColourRanges, FeatureName, ValueRange } from '@stepcast/toolpath';
import type { Summary } from '../preview/protocol';
import { lineMarks, outline } from './preview';
import { layerOf } from './print';

export const layerFrom = signal(0);
/** The topmost layer; null: to the end of the file. */
export const layerTo = signal<number | null>(null);
/** The first and last vertex of the topmost layer that are shown; null: all of it. */
export const moveFrom = signal<number | null>(null);
export const moveTo = signal<number | null>(null);

export const hiddenFeatures = signal<ReadonlySet<FeatureName>>(new Set());
export const hiddenObjects = signal<ReadonlySet<number>>(new Set());
/** The object that stands out. */
export const chosenObject = signal<number | null>(null);

/** What was found in the file, and whether nothing is missing any more. */
export const ranges = signal<{ readonly found: ColourRanges; readonly isWhole: boolean }>({
  found: {},
  isWhole: false,
});
/** The user's own limits. */
export const ownRanges = signal<ColourRanges>({});

/** The segment that is looked at: by the vertex where it ends, and by its line of the file, where that is known. */
export interface Cursor {
  readonly vertex: number;
  readonly line: number | null;
  /** What put it there: the text is not scrolled for what was chosen in it. */
  readonly by: 'picture' | 'text' | 'moves';
}
export const cursor = signal<Cursor | null>(null);

export const layerCount = computed(() => outline.value?.layers.length ?? 0);
export const topLayer = computed(() =>
  Math.max(0, Math.min(layerTo.value ?? layerCount.value - 1, layerCount.value - 1)),
);

export interface Moves {
  readonly first: number;
  readonly last: number;
}

/** The vertices of a layer; those before the first layer belong to it. */
export function movesOf(plan: Pick<Summary, 'layers' | 'vertices'>, layer: number): Moves {
  const first = layer <= 0 ? 0 : (plan.layers[layer]?.first ?? 0);
  const end = plan.layers[layer + 1]?.first ?? plan.vertices;
  return { first, last: Math.max(first, end - 1) };
}

/** Of the topmost layer that is shown; null where there is none. */
export const topMoves = computed<Moves | null>(() =>
  outline.value && outline.value.vertices > 0 ? movesOf(outline.value, topLayer.value) : null,
);

/** Shows these layers, whole. */
export function showLayers(from: number, to: number): void {
  const last = layerCount.peek() - 1;
  layerFrom.value = Math.max(0, Math.min(from, to));
  layerTo.value = to >= last ? null : Math.max(0, to);
  moveFrom.value = null;
  moveTo.value = null;
}

/** Shows these moves of the topmost layer, and marks the last of them. */
export function showMoves(from: number, to: number): void {
  const moves = topMoves.peek();
  if (!moves) return;
  moveFrom.value = from <= moves.first ? null : from;
  moveTo.value = to >= moves.last ? null : to;
  cursor.value = { vertex: to, line: null, by: 'moves' };
}

/** Shows everything up to this vertex, as if the print had got there. */
export function showUpTo(vertex: number): void {
  const plan = outline.peek();
  if (!plan) return;
  const layer = Math.max(0, layerOf(plan.layers, vertex) - 1);
  const { last } = movesOf(plan, layer);
  layerFrom.value = Math.min(layerFrom.peek(), layer);
  layerTo.value = layer >= plan.layers.length - 1 ? null : layer;
  moveFrom.value = null;
  moveTo.value = vertex >= last ? null : vertex;
}

/** A line of the file was chosen: its last segment is marked, and shown as the last that is made. */
export function chooseLine(line: number): void {
  const vertex = lineMarks().vertexAt(line);
  showUpTo(vertex);
  cursor.value = { vertex, line, by: 'text' };
}

function toggled<T>(set: ReadonlySet<T>, one: T): ReadonlySet<T> {
  const next = new Set(set);
  if (!next.delete(one)) next.add(one);
  return next;
}

export function toggleFeature(name: FeatureName): void {
  hiddenFeatures.value = toggled(hiddenFeatures.peek(), name);
}

export function toggleObject(id: number): void {
  hiddenObjects.value = toggled(hiddenObjects.peek(), id);
}

export function setOwnRange(mode: ColourMode, range: ValueRange | null): void {
  const { [mode]: _, ...others } = ownRanges.peek();
  ownRanges.value = range ? { ...others, [mode]: range } : others;
}

/** Another file: nothing of what was shown of the one before holds. */
export function resetView(): void {
  layerFrom.value = 0;
  layerTo.value = null;
  moveFrom.value = null;
  moveTo.value = null;
  hiddenFeatures.value = new Set();
  hiddenObjects.value = new Set();
  chosenObject.value = null;
  ranges.value = { found: {}, isWhole: false };
  ownRanges.value = {};
  cursor.value = null;
}
