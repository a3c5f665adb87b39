// What the 3D view's features and colour modes are called, and their units.
import type { ColourMode, FeatureName, HexColour } from '@stepcast/toolpath';

/** A ramp of colours as a background, from left to right. */
export const gradient = (ramp: readonly HexColour[]): string =>
  `linear-gradient(to right, ${ramp.join(', ')})`;

export const FEATURE_NAMES: Readonly<Record<FeatureName, string>> = {
  innerWall: 'Inner wall',
  outerWall: 'Outer wall',
  overhangWall: 'Overhang',
  infill: 'Infill',
  solidInfill: 'Solid infill',
  topSurface: 'Top surface',
  bottomSurface: 'Bottom surface',
  ironing: 'Ironing',
  bridge: 'Bridge',
  gapFill: 'Gap fill',
  skirt: 'Skirt, brim',
  support: 'Support',
  supportInterface: 'Support interface',
  primeTower: 'Prime tower',
  raft: 'Raft',
  custom: 'Custom G-code',
  other: 'Other',
};

interface Mode {
  readonly name: string;
  readonly unit: string;
  readonly decimals: number;
}

export const MODES: Readonly<Record<ColourMode, Mode>> = {
  feature: { name: 'Feature', unit: '', decimals: 0 },
  height: { name: 'Layer height', unit: 'mm', decimals: 2 },
  width: { name: 'Line width', unit: 'mm', decimals: 2 },
  feed: { name: 'Speed in the file', unit: 'mm/s', decimals: 0 },
  speed: { name: 'Actual speed', unit: 'mm/s', decimals: 0 },
  accel: { name: 'Acceleration', unit: 'mm/s²', decimals: 0 },
  flowAsked: { name: 'Flow in the file', unit: 'mm³/s', decimals: 1 },
  flow: { name: 'Actual flow', unit: 'mm³/s', decimals: 1 },
  temperature: { name: 'Nozzle temperature', unit: '°C', decimals: 0 },
  fan: { name: 'Fan', unit: '%', decimals: 0 },
  layerTime: { name: 'Layer time', unit: 's', decimals: 1 },
  tool: { name: 'Tool', unit: '', decimals: 0 },
  object: { name: 'Object', unit: '', decimals: 0 },
};
