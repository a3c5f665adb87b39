// What the page and the instruments' worker say to each other. Shapes only.
// Times in s, temperatures in °C, speeds in mm/s, positions in CSS pixels from the canvas's upper left corner.
import type { Seconds } from '../units';

export interface CanvasSize {
  /** CSS pixels. */
  readonly width: number;
  readonly height: number;
  /** Pixels of the canvas in a CSS pixel. */
  readonly ratio: number;
}

export type PointerAct =
  | { readonly kind: 'moved' | 'pressed' | 'released'; readonly x: number; readonly y: number }
  | { readonly kind: 'left' }
  /** Above 1 shows a shorter time about the pointer. */
  | { readonly kind: 'zoomed'; readonly factor: number };

export type ToInstruments =
  | {
      readonly kind: 'start';
      readonly canvas: OffscreenCanvas;
      /** Where the module's script is. */
      readonly url: string;
      readonly heaters: readonly string[];
      readonly decimalSign: string;
    }
  | { readonly kind: 'size'; readonly size: CanvasSize }
  | { readonly kind: 'dark'; readonly on: boolean }
  /** Four numbers a reading: the heater's place among the names, s, measured °C, target °C (0 is off). */
  | { readonly kind: 'temperatures'; readonly readings: Float64Array<ArrayBuffer> }
  | { readonly kind: 'speed'; readonly pairs: Float64Array<ArrayBuffer> }
  | { readonly kind: 'span'; readonly span: Seconds }
  | { readonly kind: 'pointer'; readonly act: PointerAct };

export type FromInstruments =
  /** The first picture is there. */
  | { readonly kind: 'ready' }
  /** There is no such module (yet). */
  | { readonly kind: 'missing' }
  | { readonly kind: 'failed'; readonly why: string };
