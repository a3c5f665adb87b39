// The user's settings, kept in this browser. What is stored is not trusted: a value that does not fit is the default.
import { effect, signal } from '@preact/signals';
import { COLOUR_MODES, type ColourMode } from '@stepcast/toolpath';

export type Theme = 'system' | 'light' | 'dark';

/** Nozzle and bed for a material, in °C. */
export interface Preset {
  readonly name: string;
  readonly nozzle: number;
  readonly bed: number;
}

export interface Settings {
  readonly theme: Theme;
  /** The profile in use. */
  readonly profile: string;
  readonly connectTo: 'serial' | 'virtual';
  /** For boards on a UART; USB ignores it. */
  readonly baud: number;
  /** Seconds of the virtual printer in a real one, at most. */
  readonly speed: number;
  readonly presets: readonly Preset[];
  readonly jogStep: number;
  /** mm of filament. */
  readonly extrudeLength: number;
  /** mm of filament a second. */
  readonly extrudeSpeed: number;
  /** A colour mode of the 3D view. */
  readonly colourBy: ColourMode;
  readonly showTravel: boolean;
  readonly showWipes: boolean;
  readonly showRetractions: boolean;
  readonly showSeams: boolean;
  readonly showToolChanges: boolean;
  readonly showPauses: boolean;
  /** The bed's shape over the plate. */
  readonly showMesh: boolean;
  readonly isOrthographic: boolean;
  /** The camera goes with the nozzle while something is printed. */
  readonly followNozzle: boolean;
  /** The file's text beside the 3D view. */
  readonly showText: boolean;
  readonly showInstruments: boolean;
  /** Notifications about prints while the page is hidden. */
  readonly notifications: boolean;
  /** The advice to pin the tab was read. */
  readonly knowsPinning: boolean;
}

const KEY = 'stepcast-settings';
export const PRESETS_MAX = 8;
export const SPEED_MAX = 200;
/** What the fields take; the machine's own limits hold besides. */
export const EXTRUDE_MAX_MM = 100;
export const EXTRUDE_SPEED_MAX_MM_S = 50;
export const JOG_STEPS = [0.1, 1, 10, 50] as const;

export const DEFAULTS: Settings = {
  theme: 'system',
  profile: 'virtual',
  connectTo: 'serial',
  baud: 250_000,
  speed: 1,
  presets: [
    { name: 'PLA', nozzle: 205, bed: 60 },
    { name: 'PETG', nozzle: 235, bed: 80 },
    { name: 'ABS', nozzle: 245, bed: 100 },
  ],
  jogStep: 10,
  extrudeLength: 5,
  extrudeSpeed: 3,
  colourBy: 'feature',
  showTravel: false,
  showWipes: false,
  showRetractions: false,
  showSeams: false,
  showToolChanges: false,
  showPauses: false,
  showMesh: false,
  isOrthographic: false,
  followNozzle: false,
  showText: false,
  showInstruments: false,
  notifications: false,
  knowsPinning: false,
};

const between = (value: unknown, min: number, max: number, otherwise: number): number =>
  typeof value === 'number' && value >= min && value <= max ? value : otherwise;

const oneOf = <T>(value: unknown, choices: readonly T[], otherwise: T): T =>
  choices.find((choice) => choice === value) ?? otherwise;

function readPresets(value: unknown): readonly Preset[] {
  if (!Array.isArray(value)) return DEFAULTS.presets;
  return value.slice(0, PRESETS_MAX).flatMap((entry: unknown) => {
    const preset = entry as Partial<Preset> | null;
    if (typeof preset?.name !== 'string') return [];
    return [
      {
        name: preset.name.slice(0, 24),
        nozzle: between(preset.nozzle, 0, 500, 0),
        bed: between(preset.bed, 0, 200, 0),
      },
    ];
  });
}

/** Settings from what was stored, whatever that is. */
export function readSettings(text: string | null): Settings {
  let stored: Partial<Record<keyof Settings, unknown>> = {};
  try {
    const parsed: unknown = JSON.parse(text ?? '{}');
    if (parsed !== null && typeof parsed === 'object') stored = parsed;
  } catch {
    // Something else wrote there: the defaults will do.
  }
  return {
    theme: oneOf(stored.theme, ['system', 'light', 'dark'], DEFAULTS.theme),
    profile: typeof stored.profile === 'string' ? stored.profile : DEFAULTS.profile,
    connectTo: oneOf(stored.connectTo, ['serial', 'virtual'], DEFAULTS.connectTo),
    baud: between(stored.baud, 2400, 4_000_000, DEFAULTS.baud),
    speed: between(stored.speed, 1, SPEED_MAX, DEFAULTS.speed),
    presets: readPresets(stored.presets),
    jogStep: oneOf(stored.jogStep, JOG_STEPS, DEFAULTS.jogStep),
    extrudeLength: between(stored.extrudeLength, 0.1, EXTRUDE_MAX_MM, DEFAULTS.extrudeLength),
    extrudeSpeed: between(stored.extrudeSpeed, 0.1, EXTRUDE_SPEED_MAX_MM_S, DEFAULTS.extrudeSpeed),
    colourBy: oneOf(stored.colourBy, COLOUR_MODES, DEFAULTS.colourBy),
    showTravel: stored.showTravel === true,
    showWipes: stored.showWipes === true,
    showRetractions: stored.showRetractions === true,
    showSeams: stored.showSeams === true,
    showToolChanges: stored.showToolChanges === true,
    showPauses: stored.showPauses === true,
    showMesh: stored.showMesh === true,
    isOrthographic: stored.isOrthographic === true,
    followNozzle: stored.followNozzle === true,
    showText: stored.showText === true,
    showInstruments: stored.showInstruments === true,
    notifications: stored.notifications === true,
    knowsPinning: stored.knowsPinning === true,
  };
}

/** Storage may be forbidden; the page works all the same. */
function storage(): Storage | undefined {
  try {
    return globalThis.localStorage;
  } catch {
    return undefined;
  }
}

export const settings = signal<Settings>(readSettings(storage()?.getItem(KEY) ?? null));

export function change(changes: Partial<Settings>): void {
  settings.value = { ...settings.value, ...changes };
}

/** Keeps the settings and puts the theme on the page. */
export function applySettings(): void {
  effect(() => {
    const { theme } = settings.value;
    if (theme === 'system') document.documentElement.removeAttribute('data-theme');
    else document.documentElement.dataset['theme'] = theme;
    try {
      storage()?.setItem(KEY, JSON.stringify(settings.value));
    } catch {
      // Full or forbidden: they hold until the page is closed.
    }
  });
}
