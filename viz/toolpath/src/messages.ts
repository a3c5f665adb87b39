/**
 * What the host and the worker of the view say to each other.
 *
 * Requests carry out a method of the view each; `source` hands over a port on which requests may arrive from elsewhere (a
 * worker that makes vertices, see source.ts), so that they do not pass through the main thread.
 */
import type { Bed } from './bed';
import type { CameraPreset, CameraState, Projection, Vec3 } from './camera';
import type { ColourMode, ColourRanges, ValueRange } from './colours';
import type { FrameReport } from './frames';
import type { Layer } from './layers';
import type { BedMesh } from './mesh';
import type { Theme } from './palette';
import type { Volume } from './path_uniforms';
import type { PictureSizePx } from './picture';
import type { Shown } from './shown';
import type { CssPx, VertexIndex } from './units';
import type { VertexHeader } from './vertex';
import type { ToolpathView, ViewSizePx } from './view';

/** What carries requests out: the 3D view, or the plane one in its place. */
export type View = Pick<ToolpathView, Exclude<keyof ToolpathView, 'camera' | 'vertexCount'>>;

export type ViewRequest =
  | { readonly type: 'setBed'; readonly bed: Bed | null }
  | { readonly type: 'begin'; readonly header: VertexHeader }
  | { readonly type: 'append'; readonly vertices: Uint32Array }
  | { readonly type: 'appendChannels'; readonly words: Uint32Array }
  | { readonly type: 'end' }
  | { readonly type: 'clear' }
  | { readonly type: 'setLayers'; readonly layers: readonly Layer[] }
  | { readonly type: 'show'; readonly shown: Partial<Shown> }
  | { readonly type: 'setColour'; readonly mode: ColourMode }
  | { readonly type: 'setColourRange'; readonly mode: ColourMode; readonly range: ValueRange | null }
  | { readonly type: 'setPrintedUpTo'; readonly vertex: VertexIndex | null }
  | { readonly type: 'setNozzle'; readonly at: Vec3 | null }
  | { readonly type: 'setHighlight'; readonly vertex: VertexIndex | null }
  | { readonly type: 'setHighlightedObject'; readonly object: number | null }
  | { readonly type: 'setVolume'; readonly box: Volume | null }
  | { readonly type: 'setMesh'; readonly mesh: BedMesh | null }
  | { readonly type: 'pick'; readonly x: CssPx; readonly y: CssPx; readonly id: number }
  | { readonly type: 'picture'; readonly id: number; readonly size: PictureSizePx }
  | { readonly type: 'setTheme'; readonly theme: Theme }
  | { readonly type: 'orbit'; readonly dx: CssPx; readonly dy: CssPx }
  | { readonly type: 'pan'; readonly dx: CssPx; readonly dy: CssPx }
  | { readonly type: 'zoom'; readonly factor: number; readonly at: readonly [CssPx, CssPx] }
  | { readonly type: 'fit'; readonly direction?: Pick<CameraState, 'azimuth' | 'elevation'> }
  | { readonly type: 'setCamera'; readonly preset: CameraPreset }
  | { readonly type: 'setProjection'; readonly projection: Projection }
  /** The camera goes with the nozzle. */
  | { readonly type: 'setFollow'; readonly follow: boolean }
  | { readonly type: 'slice'; readonly first: VertexIndex; readonly end: VertexIndex; readonly id: number }
  | { readonly type: 'settle'; readonly id: number }
  | { readonly type: 'resize'; readonly size: ViewSizePx };

/** A request from elsewhere, for the reading of one file; later readings have greater numbers. */
export interface SourcedRequest {
  readonly job: number;
  readonly request: ViewRequest;
}

/** What only the worker itself understands. */
export type WorkerRequest =
  | ViewRequest
  | { readonly type: 'start'; readonly canvas: OffscreenCanvas; readonly size: ViewSizePx }
  | { readonly type: 'source'; readonly port: MessagePort }
  | { readonly type: 'discard'; readonly before: number }
  | { readonly type: 'dispose' };

/** Some of the file's vertices, as they are; words as in docs/vertex.md. */
export interface Slice {
  readonly first: VertexIndex;
  /** Null where there is no file. */
  readonly header: VertexHeader | null;
  readonly vertices: Uint32Array;
  /** Of as many of them as are known. */
  readonly channels: Uint32Array;
}

export type ViewEvent =
  | { readonly type: 'ready' }
  /** No picture in 3D can be drawn; the reason is the browser's. `isFlat`: layers are drawn from above instead. */
  | { readonly type: 'failed'; readonly reason: string; readonly isFlat: boolean }
  | { readonly type: 'frame'; readonly report: FrameReport }
  /** What was found up to now, a few times a second while data come; `isWhole`: nothing is missing any more. */
  | { readonly type: 'ranges'; readonly ranges: ColourRanges; readonly isWhole: boolean }
  /** All vertices of the file are there. */
  | { readonly type: 'built'; readonly vertices: number }
  | { readonly type: 'picked'; readonly id: number; readonly vertex: VertexIndex | null }
  /** A PNG; null where none could be made. */
  | { readonly type: 'picture'; readonly id: number; readonly blob: Blob | null }
  | { readonly type: 'slice'; readonly id: number; readonly slice: Slice }
  /** All that was asked for before the question is shown, in full detail. */
  | { readonly type: 'settled'; readonly id: number }
  | { readonly type: 'contextLost' }
  | { readonly type: 'contextRestored' };

/** Carries a request out. */
export function carryOut(view: View, request: ViewRequest): void {
  switch (request.type) {
    case 'setBed':
      return view.setBed(request.bed);
    case 'begin':
      return view.begin(request.header);
    case 'append':
      return view.append(request.vertices);
    case 'appendChannels':
      return view.appendChannels(request.words);
    case 'end':
      return view.end();
    case 'clear':
      return view.clear();
    case 'setLayers':
      return view.setLayers(request.layers);
    case 'show':
      return view.show(request.shown);
    case 'setColour':
      return view.setColour(request.mode);
    case 'setColourRange':
      return view.setColourRange(request.mode, request.range);
    case 'setPrintedUpTo':
      return view.setPrintedUpTo(request.vertex);
    case 'setNozzle':
      return view.setNozzle(request.at);
    case 'setHighlight':
      return view.setHighlight(request.vertex);
    case 'setHighlightedObject':
      return view.setHighlightedObject(request.object);
    case 'setVolume':
      return view.setVolume(request.box);
    case 'setMesh':
      return view.setMesh(request.mesh);
    case 'pick':
      return view.pick(request.x, request.y, request.id);
    case 'picture':
      return view.picture(request.id, request.size);
    case 'setTheme':
      return view.setTheme(request.theme);
    case 'orbit':
      return view.orbit(request.dx, request.dy);
    case 'pan':
      return view.pan(request.dx, request.dy);
    case 'zoom':
      return view.zoom(request.factor, request.at);
    case 'fit':
      return view.fit(request.direction);
    case 'setCamera':
      return view.setCamera(request.preset);
    case 'setProjection':
      return view.setProjection(request.projection);
    case 'setFollow':
      return view.setFollow(request.follow);
    case 'slice':
      return view.slice(request.first, request.end, request.id);
    case 'settle':
      return view.settle(request.id);
    case 'resize':
      return view.resize(request.size);
  }
}
