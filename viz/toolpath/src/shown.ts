/**
 * What is drawn of the file: layers, moves, features, markers.
 *
 * Does not know: vertices, drawing. Units: layer and vertex indices.
 */
import { CATEGORICAL_MODES, COLOUR_MODES, type ColourMode, type ValueRange } from './colours';
import type { LayerList, VertexRange } from './layers';
import type { LayerIndex, VertexIndex } from './units';
import type { FeatureName } from './vertex';

/** `show` changes the members that are given. */
export interface Shown {
  /** Both included. */
  readonly layerFrom: LayerIndex;
  readonly layerTo: LayerIndex;
  /**
   * Of the topmost layer that is shown, the first and the last vertex that are drawn; layers below it are drawn whole.
   * A `vertexTo` below that layer makes the one that it is in the topmost. null: no limit.
   */
  readonly vertexFrom: VertexIndex | null;
  readonly vertexTo: VertexIndex | null;
  readonly travel: boolean;
  /** Travels over what was just printed; not among those of `travel`. */
  readonly wipes: boolean;
  readonly retractions: boolean;
  readonly seams: boolean;
  readonly toolChanges: boolean;
  readonly pauses: boolean;
  readonly hiddenFeatures: readonly FeatureName[];
  /** Numbers of objects, 0 for what belongs to none. */
  readonly hiddenObjects: readonly number[];
}

export const SHOW_ALL: Shown = {
  layerFrom: 0,
  layerTo: Number.MAX_SAFE_INTEGER,
  vertexFrom: null,
  vertexTo: null,
  travel: false,
  wipes: false,
  retractions: false,
  seams: false,
  toolChanges: false,
  pauses: false,
  hiddenFeatures: [],
  hiddenObjects: [],
};

export const isColourMode = (mode: string): mode is ColourMode =>
  (COLOUR_MODES as readonly string[]).includes(mode);

/** The range as it can be used, or null. */
export function validRange(mode: ColourMode, range: ValueRange | null): ValueRange | null {
  if (!range || CATEGORICAL_MODES.includes(mode) || !range.every(Number.isFinite)) return null;
  return range[0] <= range[1] ? range : [range[1], range[0]];
}

/** The vertices that are drawn, in order. */
export function shownRanges(shown: Shown, layers: LayerList, vertexCount: number): VertexRange[] {
  const { layerFrom, layerTo, vertexFrom, vertexTo } = shown;
  const whole = layers.range(layerFrom, Math.min(layerTo, layers.count - 1), vertexCount);
  const end = Math.max(vertexTo === null ? whole.end : Math.min(whole.end, vertexTo + 1), whole.first);
  if (vertexFrom === null || end === whole.first) return [{ first: whole.first, end }];
  const top = layers.layerOf(end - 1);
  const topFirst = Math.max(layers.range(top, top, vertexCount).first, whole.first);
  const first = Math.min(Math.max(vertexFrom, topFirst), end);
  return [
    { first: whole.first, end: topFirst },
    { first, end },
  ];
}
