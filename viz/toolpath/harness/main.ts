/**
 * The page for looking at the view by hand and from the scripts here: `?segments=N&theme=dark&main=1&vertices=URL&case=NAME`.
 *
 * `case` is one of cases.ts, or none for an empty page on which `harness.show` loads them one after the other.
 * `vertices` is a file of raw vertices (docs/vertex.md) with its header as `URL.json`.
 */
import {
  attachControls,
  type FrameReport,
  type Layer,
  ToolpathHost,
  type VertexHeader,
  type ViewEvent,
} from '../src/index';
import { SHOW_ALL } from '../src/shown';
import { CASES } from './cases';
import { synthetic } from './synthetic';
import { HEADER, type Made } from './writer';

interface Harness {
  readonly host: ToolpathHost;
  readonly frames: FrameReport[];
  readonly events: string[];
  /** The newest of each type. */
  readonly latest: Map<string, ViewEvent>;
  /** Loads one of the small cases in place of what is there. */
  show(name: string, theme: 'light' | 'dark'): void;
  readonly cases: string[];
  vertexCount: number;
  layerCount: number;
  ready: boolean;
}

declare global {
  interface Window {
    harness: Harness;
  }
}

const query = new URLSearchParams(location.search);
const canvas = document.querySelector<HTMLCanvasElement>('#view');
if (!canvas) throw new Error('no canvas');

const sizeNow = () => ({ width: innerWidth, height: innerHeight, ratio: devicePixelRatio });
const onEvent = (event: ViewEvent): void => {
  window.harness.events.push(event.type === 'failed' ? `failed: ${event.reason}` : event.type);
  window.harness.latest.set(event.type, event);
  if (event.type === 'frame') window.harness.frames.push(event.report);
};
const host = new ToolpathHost(canvas, { size: sizeNow(), onEvent, mainThread: query.has('main') });
const PIECE = 1 << 16;

function put({ vertices, channels, layers }: Made, header: VertexHeader): void {
  window.harness.vertexCount = vertices.length / 4;
  window.harness.layerCount = layers.length;
  host.begin(header);
  for (let at = 0; at < vertices.length; at += PIECE) host.append(vertices.slice(at, at + PIECE));
  host.setLayers(layers);
  host.end();
  for (let at = 0; at < channels.length; at += PIECE) host.appendChannels(channels.slice(at, at + PIECE));
}

/** As the view is at first. */
function reset(theme: 'light' | 'dark'): void {
  host.clear();
  host.setTheme(theme);
  host.setBed(null);
  host.setMesh(null);
  host.setVolume(null);
  host.setColour('feature');
  host.setColourRange('speed', null);
  host.setProjection('perspective');
  host.show(SHOW_ALL);
}

window.harness = {
  host,
  frames: [],
  events: [],
  latest: new Map(),
  cases: Object.keys(CASES),
  vertexCount: 0,
  layerCount: 0,
  ready: false,
  show(name, theme) {
    const chosen = CASES[name];
    if (!chosen) throw new Error(`no case ${name}`);
    reset(theme);
    put(chosen.make(), HEADER);
    chosen.look(host);
  },
};
attachControls(canvas, host);
addEventListener('resize', () => host.resize(sizeNow()));

async function load(): Promise<{ readonly header: VertexHeader; readonly made: Made }> {
  const url = query.get('vertices');
  if (!url) return { header: HEADER, made: synthetic(Number(query.get('segments') ?? 60_000)) };
  const [words, about] = await Promise.all([fetch(url), fetch(`${url}.json`)]);
  const { header, layers } = (await about.json()) as { header: VertexHeader; layers: Layer[] };
  const vertices = new Uint32Array(await words.arrayBuffer());
  return { header, made: { vertices, channels: new Uint32Array(0), layers } };
}

const theme = query.get('theme') === 'dark' ? 'dark' : 'light';
const chosen = query.get('case');
if (chosen !== null) {
  if (chosen) window.harness.show(chosen, theme);
} else {
  host.setTheme(theme);
  host.setBed({ minMm: [0, 0], maxMm: [220, 220], heightMm: 250 });
  host.fit();
  const { header, made } = await load();
  put(made, header);
  host.fit();
}
window.harness.ready = true;
