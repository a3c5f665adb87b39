// Machine profiles: printer.cfg texts by name, kept in this browser's IndexedDB. One is shipped and is always there.
import { computed, signal } from '@preact/signals';
import { type DBSchema, type IDBPDatabase, openDB } from 'idb';
import shippedConfig from '../../../samples/printer.cfg?raw';
import { change, settings } from './settings';

export interface Profile {
  readonly id: string;
  readonly name: string;
  /** The text of its printer.cfg. */
  readonly config: string;
}

/** Longer texts are no printer.cfg. */
export const CONFIG_CHARACTERS_MAX = 256 * 1024;
export const PROFILES_MAX = 50;
export const SHIPPED: Profile = { id: 'virtual', name: 'Sample machine', config: shippedConfig };

interface Schema extends DBSchema {
  profiles: { key: string; value: Profile };
}

let database: Promise<IDBPDatabase<Schema>> | undefined;

function open(): Promise<IDBPDatabase<Schema>> {
  database ??= openDB<Schema>('stepcast', 1, {
    upgrade(db) {
      db.createObjectStore('profiles', { keyPath: 'id' });
    },
  });
  return database;
}

export const profiles = signal<readonly Profile[]>([SHIPPED]);
/** Set where the browser keeps nothing (private windows): profiles hold until the page is closed. */
export const profilesAreKept = signal(true);

export const activeProfile = computed<Profile>(
  () => profiles.value.find((profile) => profile.id === settings.value.profile) ?? SHIPPED,
);

const byName = (a: Profile, b: Profile): number => a.name.localeCompare(b.name);

/** Reads what was kept. */
export async function loadProfiles(): Promise<void> {
  try {
    const kept = await (await open()).getAll('profiles');
    // The shipped one may have been changed by the user; it can be put back.
    const others = kept.filter((profile) => profile.id !== SHIPPED.id).sort(byName);
    profiles.value = [kept.find((profile) => profile.id === SHIPPED.id) ?? SHIPPED, ...others];
  } catch {
    profilesAreKept.value = false;
  }
}

async function keep(work: (db: IDBPDatabase<Schema>) => Promise<unknown>): Promise<void> {
  try {
    await work(await open());
  } catch {
    profilesAreKept.value = false;
  }
}

/** What came of the last file that was taken in, where that is worth a word. */
export const importNotice = signal<string | null>(null);

/** Takes a printer.cfg in as a profile of its own; puts it to use, if asked. */
export async function importProfile(file: File, use = true): Promise<void> {
  importNotice.value = null;
  if (file.size > CONFIG_CHARACTERS_MAX) {
    importNotice.value = `${file.name} is too large for a printer.cfg.`;
    return;
  }
  if (profiles.value.length >= PROFILES_MAX) {
    importNotice.value = `There are ${PROFILES_MAX} profiles already: delete one first.`;
    return;
  }
  try {
    const config = await file.text();
    const name = file.name.replace(/\.(cfg|conf|txt)$/i, '').slice(0, 60) || 'Machine';
    await saveProfile({ id: newProfileId(), name, config }, use);
    importNotice.value = use
      ? `${file.name} is now the profile “${name}”.`
      : `${file.name} is kept as “${name}”.`;
  } catch {
    importNotice.value = `${file.name} could not be read.`;
  }
}

/** Keeps a profile, new or changed, and puts it to use. */
export async function saveProfile(profile: Profile, use = true): Promise<void> {
  const known = profiles.value.some(({ id }) => id === profile.id);
  profiles.value = known
    ? profiles.value.map((other) => (other.id === profile.id ? profile : other))
    : [...profiles.value, profile].slice(0, PROFILES_MAX);
  if (use) change({ profile: profile.id });
  await keep((db) => db.put('profiles', profile));
}

/** Forgets a profile; the shipped one goes back to how it was. */
export async function removeProfile(id: string): Promise<void> {
  profiles.value = profiles.value.flatMap((profile) => {
    if (profile.id !== id) return [profile];
    return id === SHIPPED.id ? [SHIPPED] : [];
  });
  if (settings.value.profile === id) change({ profile: SHIPPED.id });
  await keep((db) => db.delete('profiles', id));
}

export const newProfileId = (): string => crypto.randomUUID();
