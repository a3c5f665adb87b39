/**
 * Colours: one set for each theme, as the shader takes them.
 *
 * Hues follow what slicers show, so that a maker knows them: outer walls orange, inner walls yellow, infill red, support
 * green, bridges blue. Does not know: drawing. Units: sRGB, 0 … 1, not linear.
 */
import { FEATURE_COUNT_MAX, FEATURES, type FeatureName } from './vertex';

export type Theme = 'light' | 'dark';
/** `#rrggbb`. */
export type HexColour = `#${string}`;
export type Rgb = readonly [number, number, number];

export interface Palette {
  readonly theme: Theme;
  readonly background: HexColour;
  readonly bed: HexColour;
  readonly gridFine: HexColour;
  readonly gridCoarse: HexColour;
  readonly bedEdge: HexColour;
  readonly axisX: HexColour;
  readonly axisY: HexColour;
  readonly travel: HexColour;
  readonly wipe: HexColour;
  readonly retract: HexColour;
  readonly unretract: HexColour;
  readonly seam: HexColour;
  readonly toolChange: HexColour;
  readonly pause: HexColour;
  readonly nozzle: HexColour;
  /** What is still to be printed is drawn near this colour. */
  readonly remaining: HexColour;
  /** Where a colour's value is not known. */
  readonly neutral: HexColour;
  /** What leaves the machine's volume. */
  readonly warning: HexColour;
  /** The segment that is pointed at. */
  readonly highlight: HexColour;
  readonly features: Readonly<Record<FeatureName, HexColour>>;
}

const FEATURE_COLOURS: Readonly<Record<FeatureName, HexColour>> = {
  innerWall: '#f2cf57',
  outerWall: '#f08a45',
  overhangWall: '#4a5fd6',
  infill: '#b8483f',
  solidInfill: '#9a66c4',
  topSurface: '#e5554f',
  bottomSurface: '#7f8fa6',
  ironing: '#f4a58a',
  bridge: '#4f86bd',
  gapFill: '#d8d4cc',
  skirt: '#1f8f7a',
  support: '#57b552',
  supportInterface: '#2f7f3a',
  primeTower: '#a9cfa0',
  raft: '#8a8f6a',
  custom: '#53bd8c',
  other: '#9aa3ad',
};

export const PALETTES: Readonly<Record<Theme, Palette>> = {
  light: {
    theme: 'light',
    background: '#eef1f4',
    bed: '#dfe4e9',
    gridFine: '#ced5dc',
    gridCoarse: '#b3bdc7',
    bedEdge: '#8d99a5',
    axisX: '#c8463f',
    axisY: '#3f9a4a',
    travel: '#2f7fb5',
    wipe: '#b57a2f',
    retract: '#b0206f',
    unretract: '#1f7a4d',
    seam: '#1c2430',
    toolChange: '#0072b2',
    pause: '#c0392b',
    nozzle: '#1c2430',
    remaining: '#cdd3d9',
    neutral: '#b4bcc4',
    warning: '#e6007e',
    highlight: '#0b57d0',
    features: FEATURE_COLOURS,
  },
  dark: {
    theme: 'dark',
    background: '#15191e',
    bed: '#1d232a',
    gridFine: '#29313a',
    gridCoarse: '#3a4550',
    bedEdge: '#5a6775',
    axisX: '#e0645c',
    axisY: '#62b86a',
    travel: '#5aa7da',
    wipe: '#d9a45a',
    retract: '#e667ab',
    unretract: '#5fd097',
    seam: '#f2f5f8',
    toolChange: '#56b4e9',
    pause: '#ff7a6b',
    nozzle: '#f2f5f8',
    remaining: '#39434d',
    neutral: '#5d6873',
    warning: '#ff2f9e',
    highlight: '#8ab4ff',
    features: FEATURE_COLOURS,
  },
};

/** `#rrggbb` to three numbers; black for what is not a colour. */
export function rgb(colour: HexColour): Rgb {
  const value = /^#[0-9a-f]{6}$/i.test(colour) ? Number.parseInt(colour.slice(1), 16) : 0;
  return [(value >>> 16) / 255, ((value >>> 8) & 255) / 255, (value & 255) / 255];
}

/** Three floats for each number that a feature can have. */
export function featureTable(palette: Palette): Float32Array<ArrayBuffer> {
  const table = new Float32Array(FEATURE_COUNT_MAX * 3);
  for (let feature = 0; feature < FEATURE_COUNT_MAX; feature++) {
    table.set(rgb(palette.features[FEATURES[feature] ?? 'other']), feature * 3);
  }
  return table;
}

/** The bits of the features that are shown; numbers without a name go with `other`. */
export function featureMask(hidden: readonly FeatureName[]): number {
  let mask = 0;
  for (let feature = 0; feature < FEATURE_COUNT_MAX; feature++) {
    if (!hidden.includes(FEATURES[feature] ?? 'other')) mask |= 1 << feature;
  }
  return mask >>> 0;
}
