// Machines that other tabs of this browser drive: shown while this tab drives none, with an emergency stop and nothing
// else. Whoever may move a machine is the tab that has its port; two that steer it would surprise each other.
// Knows no ports. Times in ms where not said otherwise.
import { computed, signal } from '@preact/signals';
import {
  CHANNEL,
  type FromDriver,
  type FromViewer,
  liveLock,
  type MachineView,
} from '../machine/broadcast_protocol';
import { driverGone, stopNotSent } from '../machine/troubles';
import { note } from './log';
import { connection, connectionId, report } from './machine';

/** News come four times a second; after so long without any they are old. */
const STALE_MS = 2000;
/** A stop that is not answered by then is taken for lost. */
const STOP_ANSWER_MS = 1000;
/** The lock can be free before the good-bye of its tab is heard, which is waited for so long. */
const BYE_MS = 200;
/** More machines than one computer has ports for. */
const MACHINES_MAX = 8;

export interface Watched {
  readonly view: MachineView;
  /** What is known is old, and may not hold any more. */
  readonly isStale: boolean;
}

const all = signal<readonly Watched[]>([]);

/** What is shown: a tab that drives a machine of its own is no viewer. */
export const watched = computed<readonly Watched[]>(() =>
  connection.value === 'closed' ? all.value.filter(({ view }) => view.id !== connectionId.value) : [],
);
export const isViewing = computed(() => watched.value.length > 0);

const staleTimers = new Map<string, ReturnType<typeof setTimeout>>();
/** Ends waiting for the machine's lock. */
const watches = new Map<string, AbortController>();
const stops = new Map<string, () => void>();
let channel: BroadcastChannel | undefined;

const tell = (message: FromViewer): void => channel?.postMessage(message);

function put(view: MachineView, isStale: boolean): void {
  const others = all.value.filter((other) => other.view.id !== view.id);
  all.value = [...others, { view, isStale }].sort((a, b) => (a.view.id < b.view.id ? -1 : 1));
}

function seen(view: MachineView): void {
  if (!watches.has(view.id)) {
    if (watches.size >= MACHINES_MAX) return;
    watchFor(view.id);
  }
  clearTimeout(staleTimers.get(view.id));
  staleTimers.set(
    view.id,
    setTimeout(() => put(view, true), STALE_MS),
  );
  put(view, false);
}

/** The lock comes to this tab when the other one lets go of it after its good-bye, or is gone without one. */
function watchFor(id: string): void {
  const stop = new AbortController();
  watches.set(id, stop);
  navigator.locks
    .request(liveLock(id), { mode: 'shared', signal: stop.signal }, () => {
      setTimeout(() => {
        if (!stop.signal.aborted) lost(id);
      }, BYE_MS);
    })
    .catch(() => {
      // It said good-bye before.
    });
}

function forget(id: string): Watched | undefined {
  const known = all.value.find(({ view }) => view.id === id);
  clearTimeout(staleTimers.get(id));
  staleTimers.delete(id);
  watches.get(id)?.abort();
  watches.delete(id);
  all.value = all.value.filter(({ view }) => view.id !== id);
  return known;
}

/** The tab that drove it is gone without a word. */
function lost(id: string): void {
  const known = forget(id);
  if (!known || id === connectionId.value || connection.value !== 'closed') return;
  const { name, port, snapshot } = known.view;
  report(driverGone(name, port.kind, snapshot.job !== 'none'));
}

function left(id: string, isTold: boolean): void {
  const known = forget(id);
  if (known && id !== connectionId.value && !isTold)
    note('info', `${known.view.name}: disconnected in its tab.`);
}

function take(message: FromDriver): void {
  switch (message.kind) {
    case 'view':
      seen(message.view);
      break;
    case 'bye': {
      const isShown = watched.value.some(({ view }) => view.id === message.id);
      left(message.id, message.trouble !== null && isShown);
      if (message.trouble && isShown) report(message.trouble);
      break;
    }
    case 'stopped':
      stops.get(message.request)?.();
      stops.delete(message.request);
      if (message.trouble) report(message.trouble);
      break;
  }
}

/** Listens to the other tabs, and asks them how things are. */
export function startWatching(): void {
  channel = new BroadcastChannel(CHANNEL);
  channel.onmessage = ({ data }: MessageEvent<FromDriver>) => take(data);
  tell({ kind: 'hello' });
}

/** Stops a machine of another tab: past that tab's page, straight to what drives the machine. */
export function stopWatched({ id, name }: MachineView): void {
  note('error', `Emergency stop pressed for ${name}, which another tab drives.`);
  const request = crypto.randomUUID();
  const late = setTimeout(() => {
    stops.delete(request);
    report(stopNotSent('no-answer'));
  }, STOP_ANSWER_MS);
  stops.set(request, () => clearTimeout(late));
  tell({ kind: 'stop', id, request });
}

/** In doubt, everything stops. */
export function stopAllWatched(): void {
  for (const { view } of watched.value) stopWatched(view);
}
