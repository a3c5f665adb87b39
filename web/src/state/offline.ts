// The page without a network, and its new versions: the service worker keeps the page's files. A new version waits until
// the user reloads, and that is offered only while no print runs, here or in another tab.
import { computed, effect, signal } from '@preact/signals';
import { note } from './log';
import { connection, isPrinting } from './machine';
import { notify } from './notices';
import { watched } from './watched';

/** A page that stays open looks for a new version this often, in ms; never during a print. */
const LOOK_EVERY_MS = 3_600_000;

/** The version that waits. */
const waiting = signal<ServiceWorker | null>(null);
/** Another tab has had a new version take over: this one still runs the old one. */
const isOutdated = signal(false);

const isBusy = computed(
  () => isPrinting.value || watched.value.some(({ view }) => view.snapshot.job !== 'none'),
);

/** Has the waiting version take over, and loads the page anew from it. */
function reload(): void {
  if (isBusy.peek()) return;
  const next = waiting.peek();
  if (!next) return location.reload();
  navigator.serviceWorker.addEventListener('controllerchange', () => location.reload(), { once: true });
  next.postMessage('take-over');
}

function follow(registration: ServiceWorkerRegistration): void {
  const look = (): void => {
    // The first one of all replaces nothing.
    waiting.value = navigator.serviceWorker.controller ? registration.waiting : null;
  };
  registration.addEventListener('updatefound', () => {
    registration.installing?.addEventListener('statechange', look);
  });
  look();
  let isFirst = !navigator.serviceWorker.controller;
  navigator.serviceWorker.addEventListener('controllerchange', () => {
    // The first one takes over what it was loaded from.
    if (!isFirst) isOutdated.value = true;
    isFirst = false;
    look();
  });
  setInterval(() => {
    if (!isBusy.peek()) registration.update().catch(() => undefined);
  }, LOOK_EVERY_MS);
}

async function register(): Promise<void> {
  try {
    const registration = await navigator.serviceWorker.register('./sw.js', { scope: './' });
    if (registration) follow(registration);
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    note('info', `The page is not kept for use without a network. (${reason})`);
  }
}

/** Keeps the page, once it has loaded: the first visit goes first. */
export function startOffline(): void {
  if (!import.meta.env.PROD || !('serviceWorker' in navigator)) return;
  effect(() => {
    if (!waiting.value && !isOutdated.value) return;
    const ends = connection.value === 'closed' ? '' : ' Reloading ends the connection.';
    notify({
      kind: 'version',
      text: isBusy.value
        ? 'A new version of this page is ready. It waits until no print runs.'
        : `A new version of this page is ready.${ends}`,
      action: { text: 'Reload', act: reload, why: isBusy.value ? 'A print is running.' : null },
    });
  });
  if (document.readyState === 'complete') void register();
  else window.addEventListener('load', () => void register(), { once: true });
}
