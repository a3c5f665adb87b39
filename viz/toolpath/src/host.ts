/**
 * The main thread's end of the view: gives the canvas to a worker, or, where OffscreenCanvas is missing, draws here.
 *
 * Has the view's methods as messages. Does not know: the page, pointers (see controls.ts). Units: as in view.ts.
 */

import type { Bed } from './bed';
import type { CameraPreset, CameraState, Projection, Vec3 } from './camera';
import type { ColourMode, ValueRange } from './colours';
import type { Layer } from './layers';
import type { BedMesh } from './mesh';
import { carryOut, type View, type ViewEvent, type ViewRequest, type WorkerRequest } from './messages';
import type { Theme } from './palette';
import type { Volume } from './path_uniforms';
import type { PictureSizePx } from './picture';
import type { Shown } from './shown';
import { Source } from './source';
import type { CssPx, VertexIndex } from './units';
import type { VertexHeader } from './vertex';
import type { ViewSizePx } from './view';

export interface ToolpathHostOptions {
  readonly size: ViewSizePx;
  readonly onEvent?: (event: ViewEvent) => void;
  /** Told behind every request from here that changes the picture, but of the nozzle's and the print's, which always move. */
  readonly onChange?: () => void;
  /** True: draw on the main thread even where a worker could. */
  readonly mainThread?: boolean;
}

/** Requests kept until the view on the main thread is loaded; more mean that it never will be. */
const WAITING_MAX = 10_000;

/** Questions, and what follows a print by itself. */
const NO_CHANGES: ReadonlySet<ViewRequest['type']> = new Set([
  'pick',
  'picture',
  'slice',
  'settle',
  'setNozzle',
  'setPrintedUpTo',
]);

const canTransfer = (canvas: HTMLCanvasElement): boolean =>
  typeof OffscreenCanvas !== 'undefined' &&
  typeof Worker !== 'undefined' &&
  typeof canvas.transferControlToOffscreen === 'function';

export class ToolpathHost {
  readonly #onEvent: (event: ViewEvent) => void;
  readonly #onChange: () => void;
  readonly #worker: Worker | null;
  readonly #source = new Source((request) => this.send(request));
  #view: View | null = null;
  #waiting: ViewRequest[] = [];
  #disposed = false;

  /** Takes the canvas over for good. */
  constructor(canvas: HTMLCanvasElement, options: ToolpathHostOptions) {
    this.#onEvent = options.onEvent ?? (() => undefined);
    this.#onChange = options.onChange ?? (() => undefined);
    if (options.mainThread || !canTransfer(canvas)) {
      this.#worker = null;
      void this.#startHere(canvas, options.size);
      return;
    }
    this.#worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'toolpath' });
    this.#worker.onmessage = ({ data }: MessageEvent<ViewEvent>) => this.#onEvent(data);
    this.#worker.onerror = (event) => this.#onEvent({ type: 'failed', reason: event.message, isFlat: false });
    const offscreen = canvas.transferControlToOffscreen();
    this.#post({ type: 'start', canvas: offscreen, size: options.size }, [offscreen]);
  }

  setBed(bed: Bed | null): void {
    this.send({ type: 'setBed', bed });
  }
  begin(header: VertexHeader): void {
    this.send({ type: 'begin', header });
  }
  /** The array's memory goes to the worker and is gone here, unless it is a part of a larger one. */
  append(vertices: Uint32Array<ArrayBuffer>): void {
    const whole = vertices.byteLength === vertices.buffer.byteLength;
    this.send({ type: 'append', vertices }, whole ? [vertices.buffer] : []);
  }
  /** Planner channels of the next vertices that have none yet, four words each; memory as with {@link append}. */
  appendChannels(words: Uint32Array<ArrayBuffer>): void {
    const whole = words.byteLength === words.buffer.byteLength;
    this.send({ type: 'appendChannels', words }, whole ? [words.buffer] : []);
  }
  end(): void {
    this.send({ type: 'end' });
  }
  clear(): void {
    this.send({ type: 'clear' });
  }
  setLayers(layers: readonly Layer[]): void {
    this.send({ type: 'setLayers', layers });
  }
  show(shown: Partial<Shown>): void {
    this.send({ type: 'show', shown });
  }
  setColour(mode: ColourMode): void {
    this.send({ type: 'setColour', mode });
  }
  /** The user's own limits of a mode's colours; null: those found in the file. */
  setColourRange(mode: ColourMode, range: ValueRange | null): void {
    this.send({ type: 'setColourRange', mode, range });
  }
  setPrintedUpTo(vertex: VertexIndex | null): void {
    this.send({ type: 'setPrintedUpTo', vertex });
  }
  setNozzle(at: Vec3 | null): void {
    this.send({ type: 'setNozzle', at });
  }
  /** Marks the segment that ends at this vertex; null marks none. */
  setHighlight(vertex: VertexIndex | null): void {
    this.send({ type: 'setHighlight', vertex });
  }
  /** Lets one object stand out; null: none. */
  setHighlightedObject(object: number | null): void {
    this.send({ type: 'setHighlightedObject', object });
  }
  /** What lies outside gets a warning's tint; null: there are no limits. */
  setVolume(box: Volume | null): void {
    this.send({ type: 'setVolume', box });
  }
  setMesh(mesh: BedMesh | null): void {
    this.send({ type: 'setMesh', mesh });
  }
  /** Asks what is drawn at a point, from the view's left top; the answer is the event `picked` with this id. */
  pick(x: CssPx, y: CssPx, id: number): void {
    this.send({ type: 'pick', x, y, id });
  }
  /** Asks for a picture in full detail; the answer is the event `picture` with this id. */
  picture(id: number, size: PictureSizePx): void {
    this.send({ type: 'picture', id, size });
  }
  setTheme(theme: Theme): void {
    this.send({ type: 'setTheme', theme });
  }
  orbit(dx: CssPx, dy: CssPx): void {
    this.send({ type: 'orbit', dx, dy });
  }
  pan(dx: CssPx, dy: CssPx): void {
    this.send({ type: 'pan', dx, dy });
  }
  zoom(factor: number, at: readonly [CssPx, CssPx] = [0, 0]): void {
    this.send({ type: 'zoom', factor, at });
  }
  fit(direction?: Pick<CameraState, 'azimuth' | 'elevation'>): void {
    this.send(direction ? { type: 'fit', direction } : { type: 'fit' });
  }
  /** Looks at the whole part from there. */
  setCamera(preset: CameraPreset): void {
    this.send({ type: 'setCamera', preset });
  }
  setProjection(projection: Projection): void {
    this.send({ type: 'setProjection', projection });
  }
  /** The camera goes with the nozzle, as long as that is shown. */
  setFollow(follow: boolean): void {
    this.send({ type: 'setFollow', follow });
  }
  /** Asks for vertices `first … end − 1`; the answer is the event `slice` with this id. */
  slice(first: VertexIndex, end: VertexIndex, id: number): void {
    this.send({ type: 'slice', first, end, id });
  }
  /** Asks when all that was asked for up to now is shown in full detail; the answer is the event `settled` with this id. */
  settle(id: number): void {
    this.send({ type: 'settle', id });
  }
  resize(size: ViewSizePx): void {
    this.send({ type: 'resize', size });
  }

  /** Requests of the view come from this port too, each with its job (see source.ts). */
  source(port: MessagePort): void {
    if (this.#disposed) return port.close();
    if (this.#worker) this.#post({ type: 'source', port }, [port]);
    else this.#source.listen(port);
  }

  /** What comes from the port of jobs before this one is not wanted any more; what is there of them goes. */
  discard(before: number): void {
    if (this.#disposed) return;
    if (this.#worker) this.#post({ type: 'discard', before }, []);
    else this.#source.discard(before);
    this.#onChange();
  }

  send(request: ViewRequest, transfer: Transferable[] = []): void {
    if (this.#disposed) return;
    if (this.#worker) this.#post(request, transfer);
    else if (this.#view) carryOut(this.#view, request);
    else if (this.#waiting.length < WAITING_MAX) this.#waiting.push(request);
    // Behind it: who is told may ask when that is drawn.
    if (!NO_CHANGES.has(request.type)) this.#onChange();
  }

  dispose(): void {
    if (this.#disposed) return;
    if (this.#worker) this.#post({ type: 'dispose' }, []);
    this.#disposed = true;
    this.#source.close();
    this.#view?.dispose();
    this.#waiting = [];
  }

  #post(request: WorkerRequest, transfer: Transferable[]): void {
    this.#worker?.postMessage(request, transfer);
  }

  async #startHere(canvas: HTMLCanvasElement, size: ViewSizePx): Promise<void> {
    try {
      // Loaded only where it is needed: three.js is otherwise in the worker alone.
      const { openView } = await import('./open_view');
      if (this.#disposed) return;
      const { view, events } = openView(canvas, size, this.#onEvent);
      this.#view = view;
      for (const event of events) this.#onEvent(event);
      if (view) for (const request of this.#waiting) carryOut(view, request);
    } catch (error) {
      const reason = error instanceof Error ? error.message : String(error);
      this.#onEvent({ type: 'failed', reason, isFlat: false });
    }
    this.#waiting = [];
  }
}
