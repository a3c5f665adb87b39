/**
 * A picture that is kept: the whole view in full detail, at any size, as a PNG.
 *
 * Drawn in slices out of sight, between the frames of the view, and read back without waiting for the GPU. One at a time;
 * a few wait. Does not know: what is drawn. Units: pixels.
 */
import { LinearFilter, UnsignedByteType, WebGLRenderTarget } from 'three';
import type { CameraState } from './camera';
import { DetailBudget } from './detail';
import type { Drawing } from './drawing';
import type { FrameClock } from './frames';

export interface PictureSizePx {
  readonly width: number;
  readonly height: number;
}

const WAITING_MAX = 4;
const POLL_MS = 4;
const SIDE_MAX = 8192;
const AREA_MAX = 1 << 25;
/** Larger ones are sharp enough without several samples a pixel. */
const SMOOTH_AREA_MAX = 1 << 23;

/** The size as it can be made: whole pixels, the same shape, not larger than the GPU takes. */
export function possibleSize({ width, height }: PictureSizePx, sideMax: number): PictureSizePx {
  const valid = (side: number): number => (Number.isFinite(side) && side >= 1 ? side : 1);
  const [w, h] = [valid(width), valid(height)];
  const side = Math.min(sideMax, SIDE_MAX);
  const scale = Math.min(1, side / Math.max(w, h), Math.sqrt(AREA_MAX / (w * h)));
  return { width: Math.max(Math.floor(w * scale), 1), height: Math.max(Math.floor(h * scale), 1) };
}

/** Rows from the top down, as pictures have them; the GPU's go upwards. */
export function turned(pixels: Uint8Array, { width, height }: PictureSizePx): Uint8ClampedArray<ArrayBuffer> {
  const row = width * 4;
  const out = new Uint8ClampedArray(row * height);
  for (let y = 0; y < height; y++) out.set(pixels.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
  return out;
}

async function encode(pixels: Uint8Array, size: PictureSizePx): Promise<Blob | null> {
  const image = new ImageData(turned(pixels, size), size.width, size.height);
  if (typeof OffscreenCanvas !== 'undefined') {
    const canvas = new OffscreenCanvas(size.width, size.height);
    canvas.getContext('2d')?.putImageData(image, 0, 0);
    return canvas.convertToBlob({ type: 'image/png' });
  }
  const canvas = Object.assign(document.createElement('canvas'), size);
  canvas.getContext('2d')?.putImageData(image, 0, 0);
  return new Promise((resolve) => canvas.toBlob(resolve, 'image/png'));
}

export class PictureMaker {
  readonly #drawing: Drawing;
  readonly #clock: FrameClock;
  readonly #budget = new DetailBudget();
  #last: Promise<unknown> = Promise.resolve();
  #waiting = 0;
  /** Counts what ends all pictures that are under way. */
  #ended = 0;

  constructor(drawing: Drawing, clock: FrameClock) {
    this.#drawing = drawing;
    this.#clock = clock;
  }

  /** The view from this camera; null where it cannot be made. */
  make(camera: CameraState, size: PictureSizePx): Promise<Blob | null> {
    if (this.#waiting >= WAITING_MAX) return Promise.resolve(null);
    this.#waiting += 1;
    const made = this.#last.then(() => this.#make(camera, size)).catch(() => null);
    this.#last = made.then(() => {
      this.#waiting -= 1;
    });
    return made;
  }

  /** What is under way comes to nothing: the file or the context is gone. */
  end(): void {
    this.#ended += 1;
  }

  async #make(camera: CameraState, wanted: PictureSizePx): Promise<Blob | null> {
    const ended = this.#ended;
    const { stage } = this.#drawing;
    const size = possibleSize(wanted, stage.textureSideMax);
    const area = size.width * size.height;
    const target = new WebGLRenderTarget(size.width, size.height, {
      samples: area <= SMOOTH_AREA_MAX ? 4 : 0,
      type: UnsignedByteType,
      minFilter: LinearFilter,
      magFilter: LinearFilter,
      generateMipmaps: false,
    });
    try {
      // Markers as large against the part as in the view.
      const ratio = Math.max(size.height / stage.size.height, 0.1);
      const view = { width: size.width / ratio, height: size.height / ratio };
      const progress = this.#drawing.begin(target, camera, view, ratio);
      for (let complete = false; !complete; ) {
        const began = this.#clock.now();
        const drawn = this.#drawing.goOn(progress, this.#budget.segments);
        complete = drawn.complete;
        await this.#gpu();
        if (ended !== this.#ended || stage.isLost) return null;
        this.#budget.measured(drawn.segments, this.#clock.now() - began);
      }
      const pixels = new Uint8Array(area * 4);
      await stage.renderer.readRenderTargetPixelsAsync(target, 0, 0, size.width, size.height, pixels);
      return ended === this.#ended && !stage.isLost ? await encode(pixels, size) : null;
    } finally {
      target.dispose();
    }
  }

  /** Until the GPU has done what it was told; never in less than one turn, so that frames come in between. */
  async #gpu(): Promise<void> {
    const isDone = this.#drawing.fence();
    do await new Promise<void>((resolve) => this.#clock.setTimer(resolve, POLL_MS));
    while (!isDone());
  }
}
