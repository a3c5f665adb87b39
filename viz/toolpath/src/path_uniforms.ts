/**
 * What the shaders of the path have in common: uniforms that all its chunks share, so that a change costs nothing.
 *
 * Does not know: vertices, drawing. Units: mm, pixels of the drawing buffer.
 */
import type { IUniform } from 'three';
import type { BoxMm } from './camera';
import { CATEGORIES, type ColourMode, colourTable, modeNumber, RAMPS, type ValueRange } from './colours';
import { featureTable, type Palette, rgb } from './palette';
import type { VertexHeader } from './vertex';

/** A vertex that no file reaches: everything is printed. */
export const ALL_PRINTED = 0xffff_ffff;
/** What the machine reaches: a box, or the upright cylinder (over an ellipse) in it. */
export interface Volume extends BoxMm {
  readonly isRound?: boolean;
}

/** Farther than any machine reaches. */
const ENDLESS_MM = 1e9;
const MARKER_PX = 6;

export type Uniforms = Record<string, IUniform>;

const COLOURS = {
  uRemaining: 'remaining',
  uTravel: 'travel',
  uWipe: 'wipe',
  uRetract: 'retract',
  uUnretract: 'unretract',
  uSeam: 'seam',
  uToolChange: 'toolChange',
  uPause: 'pause',
  uWarning: 'warning',
  uNeutral: 'neutral',
} as const;

export class PathUniforms {
  readonly all: Uniforms = {
    uOrigin: { value: [0, 0, 0] },
    uStep: { value: 2 ** -10 },
    uPrinted: { value: ALL_PRINTED },
    uFeatures: { value: ALL_PRINTED },
    uHiddenObjects: { value: new Uint32Array(8) },
    uObject: { value: 0 },
    uStride: { value: 1 },
    uHeightScale: { value: 1 },
    uBedZ: { value: 0 },
    uPixelAngle: { value: 0 },
    uDefaultSize: { value: [0.45, 0.2] },
    uPalette: { value: new Float32Array(0) },
    uRamp: { value: colourTable(RAMPS.light) },
    uCategories: { value: colourTable(CATEGORIES) },
    uMode: { value: 0 },
    uRange: { value: [0, 0] },
    uLayerTimes: { value: null },
    uLayerCount: { value: 0 },
    uLines: { value: 0 },
    uMarkers: { value: 0 },
    uToolChanges: { value: false },
    uMarkerPx: { value: MARKER_PX },
    uVolumeMin: { value: [0, 0, 0] },
    uVolumeMax: { value: [0, 0, 0] },
    uVolumeRadii: { value: [0, 0] },
    ...Object.fromEntries(Object.keys(COLOURS).map((name) => [name, { value: [0, 0, 0] }])),
  };

  constructor() {
    this.volume = null;
  }

  set(name: string, value: unknown): void {
    const uniform = this.all[name];
    if (uniform) uniform.value = value;
  }

  set header(header: VertexHeader) {
    this.set('uOrigin', [...header.originMm]);
    this.set('uStep', header.stepMm);
  }

  set palette(palette: Palette) {
    this.set('uRamp', colourTable(RAMPS[palette.theme]));
    this.set('uPalette', featureTable(palette));
    for (const [name, colour] of Object.entries(COLOURS)) this.set(name, rgb(palette[colour]));
  }

  /** Bit `n`: beads of feature `n` are shown. */
  set features(mask: number) {
    this.set('uFeatures', mask);
  }

  /** Numbers of objects that are not drawn. */
  set hiddenObjects(hidden: readonly number[]) {
    const bits = new Uint32Array(8);
    for (const object of hidden) {
      const word = object >>> 5;
      if (object >= 0 && word < bits.length) bits[word] = (bits[word] ?? 0) | (1 << (object & 31));
    }
    this.set('uHiddenObjects', bits);
  }

  /** The object that stands out; null: none. */
  set object(object: number | null) {
    this.set('uObject', object ?? 0);
  }

  /** What beads are coloured by, between these values; without them, where they are needed, nothing is known. */
  setColour(mode: ColourMode, range: ValueRange | null): void {
    this.set('uMode', modeNumber(mode));
    const [min, max] = range ?? [0, 0];
    // One value alone is in the middle.
    const [from, span] = max - min > 1e-9 ? [min, max - min] : [min - 0.5, 1];
    this.set('uRange', range ? [from, 1 / span] : [0, 0]);
  }

  /** The flags whose vertices are marked, and whether changes of the tool are. */
  setMarkers(flags: number, toolChanges: boolean): void {
    this.set('uMarkers', flags >>> 0);
    this.set('uToolChanges', toolChanges);
  }

  setLines(travels: boolean, wipes: boolean): void {
    this.set('uLines', (travels ? 1 : 0) | (wipes ? 2 : 0));
  }

  /** The first vertex that is not printed, or {@link ALL_PRINTED}. */
  set printed(vertex: number) {
    this.set('uPrinted', vertex);
  }

  set heightScale(scale: number) {
    this.set('uHeightScale', scale);
  }

  set volume(box: Volume | null) {
    const limit = (value: number): number => Math.min(Math.max(value, -ENDLESS_MM), ENDLESS_MM);
    this.set('uVolumeMin', (box?.min ?? [-ENDLESS_MM, -ENDLESS_MM, -ENDLESS_MM]).map(limit));
    this.set('uVolumeMax', (box?.max ?? [ENDLESS_MM, ENDLESS_MM, ENDLESS_MM]).map(limit));
    // By more than positions are rounded.
    const radius = (axis: 0 | 1): number => (box?.isRound ? (box.max[axis] - box.min[axis]) / 2 + 0.01 : 0);
    this.set('uVolumeRadii', [radius(0), radius(1)]);
  }

  /** Pixels of the drawing buffer: what one covers a millimetre away, and how many make a CSS pixel. */
  setPixels(angle: number, ratio: number): void {
    this.set('uPixelAngle', angle);
    this.set('uMarkerPx', MARKER_PX * ratio);
  }
}
