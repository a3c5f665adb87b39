// The service worker: keeps the files of the page, so that it opens without a network, and a version in use as it is.
//
// A new version is fetched beside the old one and then waits. It takes over when no tab shows the page any more, or when
// the user asks for it: it never reloads anything, and an older tab finds its own files until two versions later.
// Knows nothing of printers. Runs by itself, so it imports nothing.

/** Written here by the build (build/offline.ts). */
declare const STEPCAST_VERSION: string;
declare const STEPCAST_FILES: readonly string[];

interface Ending extends Event {
  waitUntil(work: Promise<unknown>): void;
}
interface Fetching extends Ending {
  readonly request: Request;
  respondWith(answer: Promise<Response>): void;
}
interface Scope {
  readonly registration: { readonly scope: string };
  readonly clients: { claim(): Promise<void> };
  skipWaiting(): Promise<void>;
  addEventListener(type: 'install' | 'activate', act: (event: Ending) => void): void;
  addEventListener(type: 'fetch', act: (event: Fetching) => void): void;
  addEventListener(type: 'message', act: (event: MessageEvent<unknown>) => void): void;
}

const scope = self as unknown as Scope;
const PREFIX = 'stepcast-page-';
const CACHE = `${PREFIX}${STEPCAST_VERSION}`;
/** Files whose names hold a hash of their content never change. */
const HASHED = /^assets\//;
/** Built apart from the page, under names that stay: the newest there is. */
const INSTRUMENTS = /^instruments\//;
/** Addresses of the page itself. */
const PAGE = new Set(['', 'index.html']);

const addressOf = (file: string): string => new URL(file, scope.registration.scope).href;

/** A file's name in the page's folder; undefined for what lies elsewhere. */
function nameOf({ method, url }: Request): string | undefined {
  const { origin, pathname } = new URL(url);
  const root = new URL(scope.registration.scope);
  if (method !== 'GET' || origin !== root.origin || !pathname.startsWith(root.pathname)) return undefined;
  return pathname.slice(root.pathname.length);
}

async function keepAll(): Promise<void> {
  const cache = await caches.open(CACHE);
  for (const file of STEPCAST_FILES) {
    const address = addressOf(file);
    const isHashed = HASHED.test(file);
    const known = isHashed ? await caches.match(address) : undefined;
    const answer = known ?? (await fetch(address, { cache: isHashed ? 'default' : 'no-cache' }));
    if (!answer.ok) throw new Error(`${file}: ${answer.status}`);
    await cache.put(address, answer);
  }
}

/** Lets go of all versions but this one and the one before it, which a tab may still show. */
async function tidy(): Promise<void> {
  const others = (await caches.keys()).filter((name) => name.startsWith(PREFIX) && name !== CACHE);
  await Promise.all(others.slice(0, -1).map((name) => caches.delete(name)));
  await scope.clients.claim();
}

async function keep(request: Request, answer: Response): Promise<Response> {
  if (answer.status === 200) {
    // A full disk keeps nothing, and the page works all the same.
    const copy = answer.clone();
    await caches
      .open(CACHE)
      .then((cache) => cache.put(request, copy))
      .catch(() => undefined);
  }
  return answer;
}

async function newest(request: Request): Promise<Response> {
  try {
    return await keep(request, await fetch(request));
  } catch (error) {
    const known = await caches.match(request);
    if (known) return known;
    throw error;
  }
}

async function answerTo(request: Request, name: string): Promise<Response> {
  if (INSTRUMENTS.test(name)) return newest(request);
  const cache = await caches.open(CACHE);
  const known = PAGE.has(name)
    ? await cache.match(addressOf('./'))
    : ((await cache.match(request)) ?? (await caches.match(request)));
  if (known) return known;
  const answer = await fetch(request);
  return HASHED.test(name) ? keep(request, answer) : answer;
}

scope.addEventListener('install', (event) => event.waitUntil(keepAll()));
scope.addEventListener('activate', (event) => event.waitUntil(tidy()));
scope.addEventListener('fetch', (event) => {
  const name = nameOf(event.request);
  if (name !== undefined) event.respondWith(answerTo(event.request, name));
});
scope.addEventListener('message', ({ data }) => {
  if (data === 'take-over') void scope.skipWaiting();
});
