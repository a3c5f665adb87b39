// What the colours in the 3D view mean, with the time that each kind of path takes.
import { FEATURES, type FeatureName, PALETTES } from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { summary } from '../state/preview';
import { formatDuration } from './numbers';

const NAMES: Record<FeatureName, string> = {
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

export function Legend(): JSX.Element | null {
  const features = summary.value?.features.filter(({ time, filament }) => time > 0 || filament > 0) ?? [];
  if (features.length === 0) return null;
  return (
    <details class="legend">
      <summary>Colours</summary>
      <ul>
        {[...features]
          .sort((a, b) => b.time - a.time)
          .map(({ feature, time }) => {
            const name = FEATURES[feature] ?? 'other';
            return (
              <li key={feature}>
                <span
                  class="swatch"
                  style={{ background: PALETTES.light.features[name] }}
                  aria-hidden="true"
                />
                <span>{NAMES[name]}</span>
                {time > 0 && <span class="legend-time">{formatDuration(time)}</span>}
              </li>
            );
          })}
      </ul>
    </details>
  );
}
