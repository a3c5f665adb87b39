// The page's end of the instruments: gives the canvas to the worker, and tells it of size and pointer.
// Knows nothing of printers; what is shown is handed in.
import type { Seconds } from '../units';
import type { FromInstruments, PointerAct, ToInstruments } from './protocol';

/** Sharper than this is not seen, and costs. */
const RATIO_MAX = 2;
/** How much a turn of the wheel by one pixel zooms, as a power of e. */
const WHEEL_ZOOM = 0.01;

interface HostOptions {
  readonly heaters: readonly string[];
  readonly decimalSign: string;
  readonly onEvent: (event: FromInstruments) => void;
}

/** Whether this browser can draw in a worker at all. */
export const canDraw = (): boolean => 'transferControlToOffscreen' in HTMLCanvasElement.prototype;

/** Graphs on a canvas that fills `place`. */
export class InstrumentsHost {
  readonly #worker: Worker;
  readonly #canvas = document.createElement('canvas');
  readonly #observer: ResizeObserver;

  constructor(place: HTMLElement, { heaters, decimalSign, onEvent }: HostOptions) {
    this.#worker = new Worker(new URL('./instruments_worker.ts', import.meta.url), {
      type: 'module',
      name: 'instruments',
    });
    this.#worker.onmessage = ({ data }: MessageEvent<FromInstruments>) => onEvent(data);
    this.#worker.onerror = (event) => onEvent({ kind: 'failed', why: event.message });
    place.append(this.#canvas);
    const canvas = this.#canvas.transferControlToOffscreen();
    const url = new URL('instruments/instruments.js', document.baseURI).href;
    this.#worker.postMessage({ kind: 'start', canvas, url, heaters, decimalSign } satisfies ToInstruments, [
      canvas,
    ]);
    this.#observer = new ResizeObserver(() => {
      const { clientWidth: width, clientHeight: height } = place;
      const ratio = Math.min(devicePixelRatio, RATIO_MAX);
      if (width > 0 && height > 0) this.#send({ kind: 'size', size: { width, height, ratio } });
    });
    this.#observer.observe(place);
    this.#listen();
  }

  setDark(on: boolean): void {
    this.#send({ kind: 'dark', on });
  }

  addTemperatures(readings: Float64Array<ArrayBuffer>): void {
    if (readings.length > 0) this.#send({ kind: 'temperatures', readings }, [readings.buffer]);
  }

  /** Copied: others look at the plan, too. */
  setPlannedSpeed(pairs: Float64Array<ArrayBuffer>): void {
    this.#send({ kind: 'speed', pairs });
  }

  showLast(span: Seconds): void {
    this.#send({ kind: 'span', span });
  }

  dispose(): void {
    this.#observer.disconnect();
    this.#worker.terminate();
    this.#canvas.remove();
  }

  #send(message: ToInstruments, transfer: Transferable[] = []): void {
    this.#worker.postMessage(message, transfer);
  }

  #act(act: PointerAct): void {
    this.#send({ kind: 'pointer', act });
  }

  #listen(): void {
    const canvas = this.#canvas;
    for (const [type, kind] of [
      ['pointermove', 'moved'],
      ['pointerdown', 'pressed'],
      ['pointerup', 'released'],
    ] as const) {
      canvas.addEventListener(type, (event) => {
        if (kind !== 'moved' && event.button !== 0) return;
        if (kind === 'pressed') canvas.setPointerCapture(event.pointerId);
        this.#act({ kind, x: event.offsetX, y: event.offsetY });
      });
    }
    // Where the browser takes over a finger, to scroll the page, nothing is held any more.
    for (const type of ['pointerleave', 'pointercancel'] as const) {
      canvas.addEventListener(type, () => this.#act({ kind: 'left' }));
    }
    // The plain wheel scrolls the page; a pinch on a touch pad comes as a wheel with Ctrl.
    canvas.addEventListener(
      'wheel',
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.#act({ kind: 'zoomed', factor: Math.exp(-event.deltaY * WHEEL_ZOOM) });
      },
      { passive: false },
    );
  }
}
