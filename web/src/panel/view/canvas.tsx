// The 3D view on the page: gives it the page's state, and takes from it what the pointer meets.
import { effect, signal } from '@preact/signals';
import { attachControls, ToolpathHost, type ViewEvent } from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import type { MachineMesh } from '../../preview/protocol';
import { followText } from '../../state/file_text';
import { followCursor, lookUp, type Segment } from '../../state/inspect';
import { isPrinting, isReady, snapshot } from '../../state/machine';
import { machineSummary, meshShown, surfaceOf } from '../../state/mesh';
import { stop, toggle } from '../../state/playback';
import { file, outline, setSink } from '../../state/preview';
import { isShown, printedVertex } from '../../state/print';
import { settings } from '../../state/settings';
import { isDark } from '../../state/theme';
import {
  chosenObject,
  cursor,
  hiddenFeatures,
  hiddenObjects,
  layerFrom,
  layerTo,
  moveFrom,
  moveTo,
  ownRanges,
  ranges,
  resetView,
  showLayers,
  topLayer,
} from '../../state/view';
import { answerWith, settled, takeAnswer, vertexAt } from '../../state/view_answers';

/** Why there is no 3D view; null where there is one. */
export const viewFailure = signal<string | null>(null);
/** Layers are drawn from above, for want of 3D. */
export const isFlat = signal(false);
/** What is seen is not yet the full picture. */
const isDrawing = signal(false);
let hasChanged = false;

/** Something else is to be seen: the view is busy until that is drawn, and what was asked for meanwhile. */
async function awaitPicture(): Promise<void> {
  hasChanged = true;
  if (isDrawing.peek()) return;
  isDrawing.value = true;
  while (hasChanged) {
    hasChanged = false;
    await settled();
  }
  isDrawing.value = false;
}

/** How far the full picture is, 0 … 1, where it takes long; null otherwise. */
export const drawnShare = signal<number | null>(null);
/** The view that is there, for the buttons over it. */
export const view = signal<ToolpathHost | null>(null);
/** What the pointer rests on, and where in the view. */
export const hovered = signal<{
  readonly segment: Segment;
  readonly x: number;
  readonly y: number;
} | null>(null);

function sizeOf(canvas: HTMLElement): { width: number; height: number; ratio: number } {
  const { clientWidth, clientHeight } = canvas;
  return {
    width: Math.max(1, clientWidth),
    height: Math.max(1, clientHeight),
    ratio: Math.min(devicePixelRatio, 2),
  };
}

/** How often the view is told what has been printed: the picture is drawn anew for it. */
const PRINTED_MS = 1000;

/** Tells the printed part from the rest while printing; returns what ends that. */
function followPrint(host: ToolpathHost): () => void {
  const tell = (): void => host.setPrintedUpTo(printedVertex());
  let timer: ReturnType<typeof setInterval> | undefined;
  const end = effect(() => {
    clearInterval(timer);
    timer = isPrinting.value && isShown.value ? setInterval(tell, PRINTED_MS) : undefined;
    tell();
  });
  return () => {
    clearInterval(timer);
    end();
  };
}

/** Where the nozzle is, while that is known. */
function nozzle(): readonly [number, number, number] | null {
  const now = snapshot.value;
  if (!isReady.value || !now?.position || !now.homed.every(Boolean)) return null;
  const [x, y, z] = now.position;
  return [x, y, z];
}

/** Shows the nozzle as often as the machine tells of itself; returns what ends that. */
function followNozzle(host: ToolpathHost): () => void {
  let last = '';
  return effect(() => {
    const at = nozzle();
    // A place that shows no difference is not drawn again.
    const text = at ? at.map((value) => value.toFixed(2)).join() : '';
    if (text !== last) host.setNozzle(at);
    last = text;
  });
}

/** The bed's shape, where there is one and it is to be seen. */
function followMesh(host: ToolpathHost): () => void {
  let told: MachineMesh | null = null;
  return effect(() => {
    const mesh = meshShown.value;
    if (mesh !== told) host.setMesh(mesh && surfaceOf(mesh));
    told = mesh;
  });
}

/** The bed, and what of the machine's room the print may use. */
function followMachine(host: ToolpathHost): () => void {
  return effect(() => {
    const [x, y, z] = machineSummary.value?.axes ?? [];
    if (!x || !y) return;
    const radius = machineSummary.value?.bedRadius ?? null;
    host.setBed(
      radius === null
        ? { minMm: [x.min, y.min], maxMm: [x.max, y.max] }
        : { minMm: [-radius, -radius], maxMm: [radius, radius], isRound: true },
    );
    host.setVolume({
      min: [x.min, y.min, z?.min ?? 0],
      max: [x.max, y.max, z?.max ?? Infinity],
      ...(radius === null ? {} : { isRound: true }),
    });
    if (!file.peek()) host.fit();
  });
}

function followShown(host: ToolpathHost): () => void {
  const ends = [
    effect(() => {
      const { showTravel, showWipes, showRetractions, showSeams, showToolChanges, showPauses } =
        settings.value;
      host.show({
        travel: showTravel,
        wipes: showWipes,
        retractions: showRetractions,
        seams: showSeams,
        toolChanges: showToolChanges,
        pauses: showPauses,
      });
    }),
    effect(() =>
      host.show({
        layerFrom: layerFrom.value,
        layerTo: layerTo.value ?? Number.MAX_SAFE_INTEGER,
        vertexFrom: moveFrom.value,
        vertexTo: moveTo.value,
      }),
    ),
    effect(() =>
      host.show({ hiddenFeatures: [...hiddenFeatures.value], hiddenObjects: [...hiddenObjects.value] }),
    ),
  ];
  return () => {
    for (const end of ends) end();
  };
}

function followColours(host: ToolpathHost): () => void {
  let told: readonly string[] = [];
  const ends = [
    effect(() => host.setColour(settings.value.colourBy)),
    effect(() => {
      const own = ownRanges.value;
      const modes = Object.keys(own) as (keyof typeof own)[];
      for (const mode of told) if (!(mode in own)) host.setColourRange(mode as keyof typeof own, null);
      for (const mode of modes) host.setColourRange(mode, own[mode] ?? null);
      told = modes;
    }),
    effect(() => host.setHighlight(cursor.value?.vertex ?? null)),
    effect(() => host.setHighlightedObject(chosenObject.value)),
    effect(() => host.setTheme(isDark.value ? 'dark' : 'light')),
    effect(() => host.setProjection(settings.value.isOrthographic ? 'orthographic' : 'perspective')),
    effect(() => host.setFollow(settings.value.followNozzle)),
  ];
  return () => {
    for (const end of ends) end();
  };
}

/** Lets the view follow the page's state; returns what ends that. */
function follow(host: ToolpathHost): () => void {
  setSink({
    source: (port) => host.source(port),
    discard: (before) => {
      stop();
      resetView();
      hovered.value = null;
      host.discard(before);
    },
  });
  followText();
  const ends = [
    followMachine(host),
    followMesh(host),
    followShown(host),
    followColours(host),
    followPrint(host),
    followNozzle(host),
    followCursor(),
    // What comes past the page is behind it once the outline or the summary is there.
    effect(() => {
      if (outline.value) void awaitPicture();
    }),
  ];
  return () => {
    for (const end of ends) end();
  };
}

function take(event: ViewEvent): void {
  takeAnswer(event);
  if (event.type === 'failed') {
    viewFailure.value = event.reason;
    isFlat.value = event.isFlat;
  }
  // All is drawn anew once there is a context again.
  if (event.type === 'contextLost') void awaitPicture();
  if (event.type === 'frame') drawnShare.value = event.report.kind === 'part' ? event.report.share : null;
  if (event.type === 'ranges') ranges.value = { found: event.ranges, isWhole: event.isWhole };
}

/** A pointer that moved less between press and release has clicked. */
const CLICK_PX = 4;
/** So long does a pointer rest on a segment before its facts are shown, in ms. */
const REST_MS = 150;

/** Clicks choose a segment, a pointer that rests shows what it is on; returns what ends that. */
function attachPicking(element: HTMLElement): () => void {
  const stopped = new AbortController();
  const { signal: gone } = stopped;
  let pressed: { readonly x: number; readonly y: number } | null = null;
  let timer: ReturnType<typeof setTimeout> | undefined;
  let asked = 0;
  const placeOf = (event: PointerEvent): { x: number; y: number } => {
    const { left, top } = element.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  };
  const leave = (): void => {
    clearTimeout(timer);
    asked += 1;
    hovered.value = null;
  };
  const rest = async (at: { x: number; y: number }): Promise<void> => {
    const question = asked;
    const vertex = await vertexAt(at.x, at.y);
    const found = vertex === null ? null : await lookUp(vertex);
    if (question === asked) hovered.value = found && { segment: found, ...at };
  };
  const choose = async (at: { x: number; y: number }): Promise<void> => {
    const vertex = await vertexAt(at.x, at.y);
    cursor.value = vertex === null ? null : { vertex, line: null, by: 'picture' };
  };
  element.addEventListener(
    'pointerdown',
    (event) => {
      leave();
      pressed = event.isPrimary && event.button === 0 && !event.shiftKey ? placeOf(event) : null;
    },
    { signal: gone },
  );
  element.addEventListener(
    'pointermove',
    (event) => {
      leave();
      if (event.pointerType !== 'touch' && event.buttons === 0 && outline.peek())
        timer = setTimeout(() => void rest(placeOf(event)), REST_MS);
    },
    { signal: gone },
  );
  element.addEventListener('pointerleave', leave, { signal: gone });
  element.addEventListener(
    'pointerup',
    (event) => {
      const at = placeOf(event);
      const isClick = pressed && Math.hypot(at.x - pressed.x, at.y - pressed.y) <= CLICK_PX;
      pressed = null;
      if (isClick && outline.peek()) {
        stop();
        void choose(at);
      }
    },
    { signal: gone },
  );
  return () => {
    stopped.abort();
    leave();
  };
}

/** Keys of the view besides those that move it: layers up and down, play, and putting the choice away. */
function onKey(event: KeyboardEvent): void {
  if (event.ctrlKey || event.altKey || event.metaKey || !outline.peek()) return;
  if (event.key === 'PageUp') showLayers(layerFrom.peek(), topLayer.peek() + 1);
  else if (event.key === 'PageDown') {
    const top = Math.max(topLayer.peek() - 1, 0);
    showLayers(Math.min(layerFrom.peek(), top), top);
  } else if (event.key === ' ') toggle();
  else if (event.key === 'Escape' && cursor.peek()) cursor.value = null;
  else return;
  event.preventDefault();
}

export function Canvas(): JSX.Element {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const parent = place.current;
    if (!parent) return;
    // A canvas is given away once, so each view has one of its own.
    const canvas = document.createElement('canvas');
    parent.append(canvas);
    const host = new ToolpathHost(canvas, {
      size: sizeOf(parent),
      onEvent: take,
      onChange: () => void awaitPicture(),
    });
    view.value = host;
    answerWith(host);
    const releases = [attachControls(parent, host), attachPicking(parent), follow(host)];
    const observer = new ResizeObserver(() => host.resize(sizeOf(parent)));
    observer.observe(parent);
    return () => {
      observer.disconnect();
      for (const release of releases) release();
      answerWith(null);
      view.value = null;
      host.dispose();
      canvas.remove();
    };
  }, []);
  const label =
    'Toolpath in 3D. Arrow keys turn it, with Shift they move it; plus and minus zoom, Home shows all. Page up and page down show more or fewer layers, space plays the moves.';
  return (
    <div
      ref={place}
      class="canvas-place"
      role="application"
      aria-label={label}
      aria-busy={isDrawing.value && (viewFailure.value === null || isFlat.value)}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: the view is turned by keyboard
      tabIndex={0}
      onKeyDown={onKey}
    />
  );
}
