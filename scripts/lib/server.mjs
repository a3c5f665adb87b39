// Serves the files of a folder over HTTP with the page's security headers. Plain Node.
// Knows nothing of how the folder is built. Listens on this computer only, unless told otherwise.
import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize, sep } from 'node:path';
import { pipeline } from 'node:stream/promises';

import { SECURITY_HEADERS } from './policy.mjs';

const TYPES = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.json': 'application/json; charset=utf-8',
  '.svg': 'image/svg+xml',
  '.png': 'image/png',
  '.ico': 'image/x-icon',
  '.wasm': 'application/wasm',
  '.webmanifest': 'application/manifest+json',
  '.cfg': 'text/plain; charset=utf-8',
  '.gcode': 'text/plain; charset=utf-8',
};
/** Files whose names hold a hash of their content never change. */
const HASHED = /^\/?assets\//;
/** How many ports after the wished one are tried. */
const PORTS_TRIED_MAX = 20;

/** The file below `folder` that a request asks for, or undefined where it points outside. */
export function fileFor(folder, url) {
  let path;
  try {
    path = decodeURIComponent(new URL(url, 'http://localhost').pathname);
  } catch {
    return undefined;
  }
  if (path.includes('\0')) return undefined;
  const file = normalize(join(folder, path.endsWith('/') ? `${path}index.html` : path));
  return file.startsWith(normalize(folder) + sep) ? file : undefined;
}

async function answer(folder, request, response) {
  const refuse = (status, text) => {
    response.writeHead(status, { ...SECURITY_HEADERS, 'Content-Type': 'text/plain; charset=utf-8' });
    response.end(request.method === 'HEAD' ? undefined : `${text}\n`);
  };
  if (request.method !== 'GET' && request.method !== 'HEAD') return refuse(405, 'Only GET and HEAD.');
  const file = fileFor(folder, request.url);
  const found = file && (await stat(file).catch(() => undefined));
  if (!found?.isFile()) return refuse(404, 'Not found.');
  const path = file.slice(folder.length + 1).replaceAll(sep, '/');
  response.writeHead(200, {
    ...SECURITY_HEADERS,
    'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream',
    'Content-Length': found.size,
    'Cache-Control': HASHED.test(path) ? 'public, max-age=31536000, immutable' : 'no-cache',
  });
  if (request.method === 'HEAD') return response.end();
  return pipeline(createReadStream(file), response);
}

/** A server of the folder's files, not yet listening. */
export function fileServer(folder) {
  return createServer((request, response) => {
    // A visitor who goes away in the middle is nobody's fault.
    answer(folder, request, response).catch(() => response.destroy());
  });
}

/** Up to here ports belong to the system: without its leave none of them may be taken. */
const PORT_SYSTEM_MAX = 1023;

/** Whether another port may be free where this one is not. On Windows, ports that it keeps for itself are "forbidden". */
export function mayTryNext(code, port) {
  return code === 'EADDRINUSE' || (code === 'EACCES' && port > PORT_SYSTEM_MAX);
}

/** Listens on `host`; where a port is taken, on the next free one. Port 0 is any. Returns the address. */
export async function listen(server, { port = 0, host = '127.0.0.1' } = {}) {
  for (let offset = 0; ; offset += 1) {
    const failure = await new Promise((resolve) => {
      server.once('error', resolve);
      server.listen(port === 0 ? 0 : port + offset, host, () => {
        server.off('error', resolve);
        resolve(undefined);
      });
    });
    if (!failure) return `http://${host}:${server.address().port}/`;
    if (!mayTryNext(failure.code, port + offset) || offset + 1 >= PORTS_TRIED_MAX) throw failure;
  }
}
