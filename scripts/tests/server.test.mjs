// The server gives the folder's files with the security headers, and nothing from outside the folder.
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { request } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';

import { fileFor, fileServer, listen, mayTryNext } from '../lib/server.mjs';

const base = mkdtempSync(join(tmpdir(), 'stepcast-server-'));
const folder = join(base, 'page');
const server = fileServer(folder);
let address;

before(async () => {
  mkdirSync(join(folder, 'assets'), { recursive: true });
  writeFileSync(join(base, 'secret.txt'), 'not for you');
  writeFileSync(join(folder, 'index.html'), '<!doctype html><title>page</title>');
  writeFileSync(join(folder, 'assets', 'planner-1234.wasm'), 'wasm');
  address = await listen(server);
});
after(() => {
  server.close();
  rmSync(base, { recursive: true });
});

/** A request whose path is sent as it is: fetch() would tidy it up. */
function raw(path, method = 'GET') {
  return new Promise((resolve, reject) => {
    const { hostname, port } = new URL(address);
    request({ hostname, port, path, method }, (response) => {
      let body = '';
      response.on('data', (chunk) => {
        body += chunk;
      });
      response.on('end', () => resolve({ status: response.statusCode, body, headers: response.headers }));
    })
      .on('error', reject)
      .end();
  });
}

test('the page comes with its policy, and is asked for anew each time', async () => {
  const { status, body, headers } = await raw('/');
  assert.equal(status, 200);
  assert.match(body, /page/);
  assert.match(headers['content-security-policy'], /default-src 'none'/);
  assert.match(headers['content-security-policy'], /connect-src 'self'/);
  assert.equal(headers['cache-control'], 'no-cache');
});

test('WebAssembly has its type, so that it compiles while it loads', async () => {
  const { headers } = await raw('/assets/planner-1234.wasm');
  assert.equal(headers['content-type'], 'application/wasm');
  assert.match(headers['cache-control'], /immutable/);
});

for (const path of ['/../secret.txt', '/%2e%2e/secret.txt', '/assets/..%2f..%2fsecret.txt', '/..%5csecret.txt', '/%zz', '/%00', '/nothing']) {
  test(`${path} is not found`, async () => {
    const { status, body } = await raw(path);
    assert.equal(status, 404);
    assert.doesNotMatch(body, /not for you/);
  });
}

test('a folder beside with the same beginning is outside', () => {
  assert.equal(fileFor('/srv/page', '/..%2fpage-of-others/x'), undefined);
});

test('only reading is allowed', async () => {
  assert.equal((await raw('/', 'POST')).status, 405);
});

test('where the port is taken, the next one is used', async () => {
  const { port } = new URL(address);
  const second = fileServer(folder);
  const other = await listen(second, { port: Number(port) });
  second.close();
  assert.notEqual(new URL(other).port, port);
});

test('a port that the system keeps for itself is passed over, but not one that takes a privilege', () => {
  assert.ok(mayTryNext('EADDRINUSE', 80));
  assert.ok(mayTryNext('EACCES', 8372));
  assert.ok(!mayTryNext('EACCES', 80));
  assert.ok(!mayTryNext('EADDRNOTAVAIL', 8372));
});
