// The 3D view: the canvas, which layers are shown, travel moves; and the place where files are dropped.

import { effect, signal } from '@preact/signals';
import { attachControls, ToolpathHost } from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { isPrinting, isReady, snapshot } from '../state/machine';
import { file, reading, setSink, summary } from '../state/preview';
import { isShown, printedVertex } from '../state/print';
import { change, settings } from '../state/settings';
import { lineOfLayer } from '../state/start';
import { askWhereToBegin } from '../state/start_request';
import { isDark } from '../state/theme';
import { Icon } from './icons';
import { Legend } from './legend';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { obstacle } from './obstacle';
import { openSample, pickFile } from './open_file';
import { Button } from './parts';

/** The top layer that is shown; null: all of them. */
const topLayer = signal<number | null>(null);
const viewFailure = signal<string | null>(null);
/** The view that is there, for the buttons over it. */
let view: ToolpathHost | null = null;

/** Where one looks from: turn around the vertical, height over the bed, both in radians. */
const DIRECTIONS = [
  { name: 'All', label: 'Show all of it', direction: { azimuth: -0.49, elevation: 0.56 } },
  { name: 'Top', label: 'View from the top', direction: { azimuth: 0, elevation: 1.55 } },
  { name: 'Front', label: 'View from the front', direction: { azimuth: 0, elevation: 0.05 } },
] as const;

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

/** Lets the view follow the page's state; returns what ends that. */
function follow(host: ToolpathHost): () => void {
  setSink({
    source: (port) => host.source(port),
    discard: (before) => {
      topLayer.value = null;
      host.discard(before);
    },
    finish: ({ layers, time }) =>
      host.setLayers(
        layers.map(({ first, z, time: timeS }) => ({
          firstVertex: first,
          zMm: z,
          ...(time === null ? {} : { timeS }),
        })),
      ),
  });
  const ends = [
    effect(() => host.setTheme(isDark.value ? 'dark' : 'light')),
    effect(() => {
      const axes = machineSummary.value?.axes;
      const [x, y] = axes ?? [];
      if (!x || !y) return;
      host.setBed({ minMm: [x.min, y.min], maxMm: [x.max, y.max] });
      if (!file.peek()) host.fit();
    }),
    effect(() => {
      host.show({
        travel: settings.value.showTravel,
        layerFrom: 0,
        layerTo: topLayer.value ?? Number.MAX_SAFE_INTEGER,
      });
    }),
    followPrint(host),
    followNozzle(host),
  ];
  return () => {
    for (const end of ends) end();
  };
}

function Canvas(): JSX.Element {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const parent = place.current;
    if (!parent) return;
    // A canvas is given away once, so each view has one of its own.
    const canvas = document.createElement('canvas');
    parent.append(canvas);
    const host = new ToolpathHost(canvas, {
      size: sizeOf(parent),
      onEvent: (event) => {
        if (event.type === 'failed') viewFailure.value = event.reason;
      },
    });
    view = host;
    const release = attachControls(parent, host);
    const observer = new ResizeObserver(() => host.resize(sizeOf(parent)));
    observer.observe(parent);
    const unfollow = follow(host);
    return () => {
      unfollow();
      observer.disconnect();
      release();
      host.dispose();
      view = null;
      canvas.remove();
    };
  }, []);
  const label =
    'Toolpath in 3D. Arrow keys turn it, with Shift they move it; plus and minus zoom, Home shows all.';
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: the view is turned by keyboard
    <div ref={place} class="canvas-place" role="application" aria-label={label} tabIndex={0} />
  );
}

function LayerSlider(): JSX.Element | null {
  const layers = summary.value?.layers ?? [];
  if (layers.length < 2) return null;
  const top = Math.min(topLayer.value ?? layers.length - 1, layers.length - 1);
  const text = `Layer ${top + 1} of ${layers.length}, ${formatNumber(layers[top]?.z ?? 0, 2)} mm`;
  return (
    <label class="layer-slider">
      <span class="layer-text">{text}</span>
      <input
        type="range"
        min={0}
        max={layers.length - 1}
        step={1}
        value={top}
        aria-label="Top layer shown"
        aria-valuetext={text}
        onInput={(event) => {
          const layer = event.currentTarget.valueAsNumber;
          topLayer.value = layer >= layers.length - 1 ? null : layer;
        }}
      />
    </label>
  );
}

/** Not while something is printed, and not for all of the file. */
function FromLayer(): JSX.Element | null {
  const plan = summary.value;
  const top = topLayer.value;
  if (!plan || top === null || top < 1 || isPrinting.value) return null;
  return (
    <Button
      why={obstacle.value}
      onClick={() => askWhereToBegin(lineOfLayer(plan, Math.min(top, plan.layers.length - 1) + 1))}
    >
      Print from this layer…
    </Button>
  );
}

function Directions(): JSX.Element {
  return (
    <fieldset class="directions">
      <legend class="unseen">View</legend>
      {DIRECTIONS.map(({ name, label, direction }) => (
        <button key={name} type="button" class="direction" title={label} onClick={() => view?.fit(direction)}>
          {name}
        </button>
      ))}
    </fieldset>
  );
}

function NoView({ reason }: { readonly reason: string }): JSX.Element {
  return (
    <div class="view-failure" role="status">
      <p class="trouble-what">There is no 3D view here.</p>
      <p>
        It needs WebGL 2. Most often graphics acceleration is switched off in the browser’s settings, or the
        graphics driver is blocked. Everything else works without it, printing too.
      </p>
      <p class="hint">{reason}</p>
    </div>
  );
}

function Empty(): JSX.Element {
  return (
    <div class="empty">
      <span class="empty-icon">
        <Icon name="file" />
      </span>
      <p class="empty-title">Drop a G-code file here</p>
      <div class="row wrap centre">
        <Button kind="primary" onClick={pickFile}>
          Choose a file
        </Button>
        <Button onClick={() => void openSample()}>Open the sample</Button>
      </div>
      <p class="hint">It stays on this computer.</p>
    </div>
  );
}

export function Viewer(): JSX.Element {
  const progress = reading.value;
  return (
    <section class="viewer" aria-label="Preview">
      <Canvas />
      {!file.value && <Empty />}
      {viewFailure.value ? <NoView reason={viewFailure.value} /> : <Directions />}
      {progress !== null && (
        <progress class="reading" aria-label="Reading the file" max={1} value={progress} />
      )}
      {summary.value && !viewFailure.value && (
        <div class="viewer-bar">
          <LayerSlider />
          <FromLayer />
          <label class="check">
            <input
              type="checkbox"
              checked={settings.value.showTravel}
              onChange={(event) => change({ showTravel: event.currentTarget.checked })}
            />
            Travel moves
          </label>
        </div>
      )}
      {!viewFailure.value && <Legend />}
    </section>
  );
}
