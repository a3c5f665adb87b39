/**
 * Starts the view that this browser can draw: in 3D, or layers from above where WebGL2 is missing.
 *
 * Does not know: the page, workers.
 */
import { FlatView } from './flat';
import type { View, ViewEvent } from './messages';
import { ToolpathView, type ViewSizePx } from './view';

export interface Started {
  /** Null where nothing can be drawn. */
  readonly view: View | null;
  /** What is to be told of it. */
  readonly events: readonly ViewEvent[];
}

const reasonOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));

export function openView(
  canvas: HTMLCanvasElement | OffscreenCanvas,
  size: ViewSizePx,
  tell: (event: ViewEvent) => void,
): Started {
  try {
    return { view: new ToolpathView(canvas, size, tell), events: [{ type: 'ready' }] };
  } catch (error) {
    const reason = reasonOf(error);
    try {
      return { view: new FlatView(canvas, size, tell), events: [{ type: 'failed', reason, isFlat: true }] };
    } catch {
      return { view: null, events: [{ type: 'failed', reason, isFlat: false }] };
    }
  }
}
