// What the 3D view is coloured by, and what the colours mean: shares of the features, or a scale with its limits.
import { signal } from '@preact/signals';
import {
  CATEGORICAL_MODES,
  COLOUR_MODES,
  type ColourMode,
  categoryColour,
  FEATURES,
  type HexColour,
  PALETTES,
  type Palette,
  PLANNED_MODES,
  RAMPS,
} from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { outline, summary } from '../../state/preview';
import { change, type Settings, settings } from '../../state/settings';
import { isDark } from '../../state/theme';
import {
  chosenObject,
  hiddenFeatures,
  hiddenObjects,
  ownRanges,
  ranges,
  setOwnRange,
  toggleFeature,
  toggleObject,
} from '../../state/view';
import { formatDuration, formatNumber } from '../numbers';
import { Button, NumberField } from '../parts';
import { MeshPart } from './mesh';
import { FEATURE_NAMES, gradient, MODES } from './words';

/** The view's own colours, as it has them in this theme. */
const palette = (): Palette => PALETTES[isDark.value ? 'dark' : 'light'];

const Swatch = ({ colour }: { readonly colour: HexColour | null }): JSX.Element => (
  <span class="swatch" style={{ background: colour ?? 'transparent' }} aria-hidden="true" />
);

/** A share in percent; the small ones are not nothing. */
const percent = (share: number): string =>
  share > 0 && share < 0.01 ? '< 1 %' : `${formatNumber(share * 100)} %`;

/** In m; little is not nothing. */
const metres = (filament: number): string =>
  filament > 0 && filament < 10 ? '< 0.01 m' : `${formatNumber(filament / 1000, 2)} m`;

function Features(): JSX.Element {
  const plan = outline.value;
  const features = plan?.features.filter(({ time, filament }) => time > 0 || filament > 0) ?? [];
  const all = features.reduce((sum, { time }) => sum + time, 0);
  return (
    <table class="legend-features">
      <caption class="unseen">Features, with the time and the filament that each takes</caption>
      <thead>
        <tr>
          <th scope="col">Feature</th>
          <th scope="col">Time</th>
          <th scope="col" class="share">
            Share
          </th>
          <th scope="col" class="filament">
            Filament
          </th>
        </tr>
      </thead>
      <tbody>
        {[...features]
          .sort((a, b) => b.time - a.time || b.filament - a.filament)
          .map(({ feature, time, filament }) => {
            const name = FEATURES[feature] ?? 'other';
            return (
              <tr key={feature}>
                <th scope="row">
                  <label class="check">
                    <input
                      type="checkbox"
                      checked={!hiddenFeatures.value.has(name)}
                      onChange={() => toggleFeature(name)}
                    />
                    <Swatch colour={palette().features[name]} />
                    {FEATURE_NAMES[name]}
                  </label>
                </th>
                <td>{time > 0 ? formatDuration(time) : '–'}</td>
                <td class="share">{all > 0 ? percent(time / all) : '–'}</td>
                <td class="filament">{metres(filament)}</td>
              </tr>
            );
          })}
      </tbody>
    </table>
  );
}

/** The objects that the file names: each can be hidden, and one made to stand out. */
export function Objects(): JSX.Element | null {
  const objects = outline.value?.objects ?? [];
  if (objects.length === 0) return null;
  return (
    <ul class="objects" aria-label="Objects">
      {objects.map(({ name }, at) => {
        const id = at + 1;
        const isChosen = chosenObject.value === id;
        return (
          <li key={id}>
            <input
              type="checkbox"
              aria-label={`Show ${name}`}
              checked={!hiddenObjects.value.has(id)}
              onChange={() => toggleObject(id)}
            />
            <Swatch colour={categoryColour('object', id)} />
            <button
              type="button"
              class="object"
              aria-pressed={isChosen}
              onClick={() => {
                chosenObject.value = isChosen ? null : id;
              }}
            >
              {name}
            </button>
          </li>
        );
      })}
    </ul>
  );
}

/** What colours of values are missing for, where they are. */
function missing(mode: ColourMode): string | null {
  const { found, isWhole } = ranges.value;
  if (PLANNED_MODES.includes(mode) || mode === 'layerTime') {
    // The planner is still at work.
    if (!summary.value || (!isWhole && PLANNED_MODES.includes(mode) && summary.value.time !== null))
      return 'Computing …';
    if (summary.value.time === null) return 'Needs a machine that is in order.';
  }
  return found[mode] ? null : 'The file does not say.';
}

function Scale({ mode }: { readonly mode: ColourMode }): JSX.Element {
  const { unit, decimals, name } = MODES[mode];
  const found = ranges.value.found[mode];
  const own = ownRanges.value[mode];
  const [min, max] = own ?? found ?? [0, 0];
  const why = missing(mode);
  const limits = { unit: '', decimals, hideLabel: true } as const;
  return (
    <div class="scale">
      <div
        class="scale-bar"
        style={{ background: gradient(RAMPS[isDark.value ? 'dark' : 'light']) }}
        aria-hidden="true"
      />
      {(found || own) && (
        <div class="scale-ends">
          <NumberField
            {...limits}
            label={`Least, ${name}`}
            value={min}
            min={0}
            max={max}
            onSet={(value) => setOwnRange(mode, [value, max])}
          />
          <span class="dim">{unit}</span>
          <NumberField
            {...limits}
            label={`Greatest, ${name}`}
            value={max}
            min={min}
            max={1e6}
            onSet={(value) => setOwnRange(mode, [min, value])}
          />
        </div>
      )}
      {own && (
        <Button kind="quiet" onClick={() => setOwnRange(mode, null)}>
          Limits of the file
        </Button>
      )}
      <p class="hint" role="status">
        {why}
      </p>
    </div>
  );
}

/** Those that the file prints with. */
function Tools(): JSX.Element {
  const tools = outline.value?.tools ?? [];
  if (tools.length === 0) return <p class="hint">The file prints nothing.</p>;
  return (
    <ul class="objects" aria-label="Tools">
      {tools.map(({ tool, filament }) => (
        <li key={tool}>
          <Swatch colour={categoryColour('tool', tool)} />
          <span class="grow">T{tool}</span>
          <span class="dim">{metres(filament)}</span>
        </li>
      ))}
    </ul>
  );
}

type Marker = 'showTravel' | 'showWipes' | 'showRetractions' | 'showSeams' | 'showToolChanges' | 'showPauses';

type MarkerColour = 'travel' | 'wipe' | 'retract' | 'seam' | 'toolChange' | 'pause';

const MARKERS: readonly { readonly key: Marker; readonly name: string; readonly colour: MarkerColour }[] = [
  { key: 'showTravel', name: 'Travel moves', colour: 'travel' },
  { key: 'showWipes', name: 'Wipes', colour: 'wipe' },
  { key: 'showRetractions', name: 'Retractions', colour: 'retract' },
  { key: 'showSeams', name: 'Seams', colour: 'seam' },
  { key: 'showToolChanges', name: 'Tool changes', colour: 'toolChange' },
  { key: 'showPauses', name: 'Pauses', colour: 'pause' },
];

function Markers(): JSX.Element {
  return (
    <fieldset class="markers">
      <legend>Also show</legend>
      {MARKERS.map(({ key, name, colour }) => (
        <label key={key} class="check">
          <input
            type="checkbox"
            checked={settings.value[key]}
            onChange={(event) => change({ [key]: event.currentTarget.checked } as Partial<Settings>)}
          />
          <Swatch colour={palette()[colour]} />
          {name}
        </label>
      ))}
    </fieldset>
  );
}

function Meaning({ mode }: { readonly mode: ColourMode }): JSX.Element | null {
  if (mode === 'feature') return <Features />;
  if (mode === 'tool') return <Tools />;
  if (mode === 'object') {
    return outline.value?.objects.length ? null : <p class="hint">The file names no objects.</p>;
  }
  return <Scale mode={mode} />;
}

/** Where there is little room, the part goes before its legend. */
const ROOMY = '(min-width: 961px)';
/** The same beside the file's text. */
const ROOMY_WITH_TEXT = '(min-width: 1500px)';
const isOpen = signal(matchMedia(settings.peek().showText ? ROOMY_WITH_TEXT : ROOMY).matches);

/** The text comes beside the view, and takes of its room. */
export function makeRoom(): void {
  if (!matchMedia(ROOMY_WITH_TEXT).matches) isOpen.value = false;
}

export function Legend({ isFlat }: { readonly isFlat: boolean }): JSX.Element | null {
  const plan = outline.value;
  if (!plan) return null;
  const modes = isFlat ? CATEGORICAL_MODES : COLOUR_MODES;
  const mode = modes.includes(settings.value.colourBy) ? settings.value.colourBy : 'feature';
  return (
    <details
      class="legend"
      open={isOpen.value}
      onToggle={(event) => {
        isOpen.value = event.currentTarget.open;
      }}
    >
      <summary>Colours</summary>
      <div class="legend-body">
        <label class="field">
          Colour by
          <select
            value={mode}
            onChange={(event) => change({ colourBy: event.currentTarget.value as ColourMode })}
          >
            {modes.map((one) => (
              <option key={one} value={one}>
                {MODES[one].name}
              </option>
            ))}
          </select>
        </label>
        <Meaning mode={mode} />
        {plan.objects.length > 0 && (
          <section class="legend-part" aria-label="Objects of the file">
            <h3>Objects</h3>
            <Objects />
          </section>
        )}
        <Markers />
        {!isFlat && <MeshPart />}
      </div>
    </details>
  );
}
