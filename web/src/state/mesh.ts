// Which of the machine file's bed meshes the 3D view shows, if any: the one that is in force, else the one that the user
// chose, else the one that Klipper calls default. Knows neither the view nor how a mesh is measured.
import { computed, signal } from '@preact/signals';
import type { BedMesh } from '@stepcast/toolpath';
import type { MachineMesh, MachineSummary } from '../preview/protocol';
import { isReady, snapshot } from './machine';
import { settings } from './settings';

/** What the profile in use describes; null until it is read, and where it describes no machine. */
export const machineSummary = signal<MachineSummary | null>(null);

/** By its name; what is in force goes before it. */
export const wantedMesh = signal<string | null>(null);

export const meshes = computed<readonly MachineMesh[]>(() => machineSummary.value?.meshes ?? []);

/** The name of the mesh that the printer makes up for; null where it makes up for none, and while nothing is connected. */
export const meshInForce = computed(() => (isReady.value ? (snapshot.value?.mesh ?? null) : null));

/** The one to look at: of those that the machine file has. */
export function meshOf(
  all: readonly MachineMesh[],
  inForce: string | null,
  wanted: string | null,
): MachineMesh | null {
  // What is in force may be of another machine file: then nothing is known of it.
  if (inForce !== null) return all.find(({ name }) => name === inForce) ?? null;
  return (
    all.find(({ name }) => name === wanted) ?? all.find(({ name }) => name === 'default') ?? all[0] ?? null
  );
}

/** The one to look at, whether or not it is shown. */
export const meshInView = computed(() => meshOf(meshes.value, meshInForce.value, wantedMesh.value));
/** The one that is shown. */
export const meshShown = computed(() => (settings.value.showMesh ? meshInView.value : null));

/** As the 3D view takes it. */
export const surfaceOf = ({ origin, step, rows }: MachineMesh): BedMesh => ({
  originMm: origin,
  stepMm: step,
  columns: rows[0]?.length ?? 0,
  rows: rows.length,
  heightsMm: rows.flat(),
});
