/**
 * The page for looking at the view by hand and from shoot.mjs: `?segments=N&theme=dark&main=1&vertices=URL`.
 *
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
import { HEADER, synthetic } from './synthetic';

interface Harness {
  readonly host: ToolpathHost;
  readonly frames: FrameReport[];
  readonly events: string[];
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
  if (event.type === 'frame') window.harness.frames.push(event.report);
};
const host = new ToolpathHost(canvas, { size: sizeNow(), onEvent, mainThread: query.has('main') });
window.harness = { host, frames: [], events: [], vertexCount: 0, layerCount: 0, ready: false };
attachControls(canvas, host);
addEventListener('resize', () => host.resize(sizeNow()));

async function load(): Promise<{
  header: VertexHeader;
  vertices: Uint32Array<ArrayBuffer>;
  layers: Layer[];
}> {
  const url = query.get('vertices');
  if (!url) return { header: HEADER, ...synthetic(Number(query.get('segments') ?? 60_000)) };
  const [words, about] = await Promise.all([fetch(url), fetch(`${url}.json`)]);
  const { header, layers } = (await about.json()) as { header: VertexHeader; layers: Layer[] };
  return { header, layers, vertices: new Uint32Array(await words.arrayBuffer()) };
}

host.setTheme(query.get('theme') === 'dark' ? 'dark' : 'light');
host.setBed({ minMm: [0, 0], maxMm: [220, 220], heightMm: 250 });
host.fit();
const { header, vertices, layers } = await load();
window.harness.vertexCount = vertices.length / 4;
window.harness.layerCount = layers.length;
host.begin(header);
const PIECE = 1 << 16;
for (let at = 0; at < vertices.length; at += PIECE) host.append(vertices.slice(at, at + PIECE));
host.setLayers(layers);
host.end();
host.fit();
window.harness.ready = true;
