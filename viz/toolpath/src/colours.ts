/**
 * What the path may be coloured by, and the colours of it.
 *
 * Does: the modes' names and units, the ramp for what is measured and the colours for what is told apart, as the shader
 * and a legend take them. Does not know: drawing, vertices. Units: each mode's own; sRGB.
 * Sources: the ramp runs through the colours of viridis (S. van der Walt, N. Smith, E. Firing; public domain, CC0); the
 * colours that tell apart are those of M. Okabe and K. Ito, "Color Universal Design" (2008).
 */
import { type HexColour, type Rgb, rgb, type Theme } from './palette';

/** The index is the mode's number in the shader. */
export const COLOUR_MODES = [
  'feature',
  /** The bead's height and width, mm. */
  'height',
  'width',
  /** The speed that the file asks for, mm/s. */
  'feed',
  /** The speed on average along the segment as it is planned, mm/s. */
  'speed',
  /** The strongest acceleration along the segment, mm/s². */
  'accel',
  /** Filament over time at the speed that the file asks for, and as planned, mm³/s. */
  'flowAsked',
  'flow',
  /** The nozzle's target, °C. */
  'temperature',
  /** The part fan, percent. */
  'fan',
  /** How long the whole layer takes, s. */
  'layerTime',
  'tool',
  'object',
] as const;

export type ColourMode = (typeof COLOUR_MODES)[number];

/** The least and the greatest value, in the mode's unit. */
export type ValueRange = readonly [min: number, max: number];
export type ColourRanges = Partial<Record<ColourMode, ValueRange>>;

/** Modes whose values are told apart, not measured: they have no range. */
export const CATEGORICAL_MODES: readonly ColourMode[] = ['feature', 'tool', 'object'];

/** Modes whose values are the planner's: known only where its channels are. */
export const PLANNED_MODES: readonly ColourMode[] = [
  'feed',
  'speed',
  'accel',
  'flowAsked',
  'flow',
  'temperature',
  'fan',
];

/** Evenly spaced from the least to the greatest value. Brightness rises all the way, so that it can be read without hue. */
const VIRIDIS: readonly HexColour[] = [
  '#440154',
  '#482878',
  '#3e4989',
  '#31688e',
  '#26828e',
  '#1f9e89',
  '#35b779',
  '#6ece58',
  '#b5de2b',
  '#fde725',
];
/** On a dark background the darkest part of the ramp could not be seen. */
const DARK_START = 0.19;

const hex = (part: number): string =>
  Math.round(part * 255)
    .toString(16)
    .padStart(2, '0');

/** The colour of a ramp at 0 … 1, between its colours in a straight line. */
export function rampAt(ramp: readonly HexColour[], at: number): Rgb {
  const place = Math.min(Math.max(at, 0), 1) * (ramp.length - 1);
  const below = Math.min(Math.floor(place), ramp.length - 2);
  const [a, b] = [rgb(ramp[below] ?? '#000000'), rgb(ramp[below + 1] ?? '#000000')];
  const mixed = (channel: 0 | 1 | 2): number => a[channel] + (place - below) * (b[channel] - a[channel]);
  return [mixed(0), mixed(1), mixed(2)];
}

/** The colours of measured values, evenly spaced from the least to the greatest. */
export const RAMPS: Readonly<Record<Theme, readonly HexColour[]>> = {
  light: VIRIDIS,
  dark: VIRIDIS.map((_, at): HexColour => {
    const colour = rampAt(VIRIDIS, DARK_START + ((1 - DARK_START) * at) / (VIRIDIS.length - 1));
    return `#${colour.map(hex).join('')}`;
  }),
};
/** The ramp on a light background. */
export const RAMP = VIRIDIS;
/** How many colours a ramp has. */
export const RAMP_LENGTH = VIRIDIS.length;

/** For tools and objects, over and over. */
export const CATEGORIES: readonly HexColour[] = [
  '#e69f00',
  '#56b4e9',
  '#009e73',
  '#f0e442',
  '#0072b2',
  '#d55e00',
  '#cc79a7',
  '#a0a0a0',
];

/** The colour of a tool (from 0) or an object (from 1; 0 is none of them). */
export function categoryColour(mode: 'tool' | 'object', number: number): HexColour | null {
  const at = mode === 'object' ? number - 1 : number;
  return at < 0 ? null : (CATEGORIES[at % CATEGORIES.length] ?? null);
}

/** The number by which the shader knows the mode. */
export const modeNumber = (mode: ColourMode): number => COLOUR_MODES.indexOf(mode);

/** Three floats a colour. */
export const colourTable = (colours: readonly HexColour[]): Float32Array<ArrayBuffer> =>
  new Float32Array(colours.flatMap((colour) => [...rgb(colour)]));
