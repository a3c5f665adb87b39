/**
 * The main thread's end of the view: gives the canvas to a worker, or, where OffscreenCanvas is missing, draws here.
 *
 * Has the view's methods as messages. Does not know: the page, pointers (see controls.ts). Units: as in view.ts.
 */

import type { Bed } from './bed';
import type { CameraState, Vec3 } from './camera';
import type { Layer } from './layers';
import { carryOut, type ViewEvent, type ViewRequest, type WorkerRequest } from './messages';
import type { Theme } from './palette';
import type { CssPx, VertexIndex } from './units';
import type { VertexHeader } from './vertex';
import type { Shown, ToolpathView, ViewSizePx } from './view';

export interface ToolpathHostOptions {
  readonly size: ViewSizePx;
  readonly onEvent?: (event: ViewEvent) => void;
  /** True: draw on the main thread even where a worker could. */
  readonly mainThread?: boolean;
}

/** Requests kept until the view on the main thread is loaded; more mean that it never will be. */
const WAITING_MAX = 10_000;

const canTransfer = (canvas: HTMLCanvasElement): boolean =>
  typeof OffscreenCanvas !== 'undefined' &&
  typeof Worker !== 'undefined' &&
  typeof canvas.transferControlToOffscreen === 'function';

export class ToolpathHost {
  readonly #onEvent: (event: ViewEvent) => void;
  readonly #worker: Worker | null;
  #view: ToolpathView | null = null;
  #waiting: ViewRequest[] = [];
  #disposed = false;

  /** Takes the canvas over for good. */
  constructor(canvas: HTMLCanvasElement, options: ToolpathHostOptions) {
    this.#onEvent = options.onEvent ?? (() => undefined);
    if (options.mainThread || !canTransfer(canvas)) {
      this.#worker = null;
      void this.#startHere(canvas, options.size);
      return;
    }
    this.#worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'toolpath' });
    this.#worker.onmessage = ({ data }: MessageEvent<ViewEvent>) => this.#onEvent(data);
    this.#worker.onerror = (event) => this.#onEvent({ type: 'failed', reason: event.message });
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
  setPrintedUpTo(vertex: VertexIndex | null): void {
    this.send({ type: 'setPrintedUpTo', vertex });
  }
  setNozzle(at: Vec3 | null): void {
    this.send({ type: 'setNozzle', at });
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
  resize(size: ViewSizePx): void {
    this.send({ type: 'resize', size });
  }

  send(request: ViewRequest, transfer: Transferable[] = []): void {
    if (this.#disposed) return;
    if (this.#worker) this.#post(request, transfer);
    else if (this.#view) carryOut(this.#view, request);
    else if (this.#waiting.length < WAITING_MAX) this.#waiting.push(request);
  }

  dispose(): void {
    if (this.#disposed) return;
    if (this.#worker) this.#post({ type: 'dispose' }, []);
    this.#disposed = true;
    this.#view?.dispose();
    this.#waiting = [];
  }

  #post(request: WorkerRequest, transfer: Transferable[]): void {
    this.#worker?.postMessage(request, transfer);
  }

  async #startHere(canvas: HTMLCanvasElement, size: ViewSizePx): Promise<void> {
    try {
      // Loaded only where it is needed: three.js is otherwise in the worker alone.
      const { ToolpathView } = await import('./view');
      if (this.#disposed) return;
      this.#view = new ToolpathView(canvas, size, {
        onFrame: (report) => this.#onEvent({ type: 'frame', report }),
        onContextLost: () => this.#onEvent({ type: 'contextLost' }),
        onContextRestored: () => this.#onEvent({ type: 'contextRestored' }),
      });
      this.#onEvent({ type: 'ready' });
      for (const request of this.#waiting) carryOut(this.#view, request);
    } catch (error) {
      this.#onEvent({ type: 'failed', reason: error instanceof Error ? error.message : String(error) });
    }
    this.#waiting = [];
  }
}
