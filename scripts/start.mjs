#!/usr/bin/env node
// `npm start`: sets up what a fresh machine lacks, builds the planner and the page, and serves the page on this
// computer. The instruments (graphs) take minutes to build and the page works without them: they are built once the
// page is served, and appear in it when they are there.
//
//   npm start                    on http://127.0.0.1:8372/, or the next free port
//   npm start -- --port 9000     on another port
//   npm start -- --no-build      what was built last
//
// Plain Node, built-ins only: it has to run before anything is installed.
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import * as util from 'node:util';

import { inBackground } from './lib/background.mjs';
import { fileServer, listen } from './lib/server.mjs';
import { setUp, shown } from './lib/setup.mjs';
import { root } from './lib/target.mjs';

const PORT_DEFAULT = 8372;
const PAGE = join(root, 'web', 'dist');

function readArguments() {
  // An older Node has no parseArgs: it gets the advice of the set-up, not an error of the language.
  if (!util.parseArgs) return { port: PORT_DEFAULT, build: true };
  const { values } = util.parseArgs({
    options: { port: { type: 'string' }, 'no-build': { type: 'boolean', default: false } },
  });
  const port = Number(values.port ?? PORT_DEFAULT);
  if (!Number.isInteger(port) || port < 0 || port > 65_535) throw new Error(`not a port: ${values.port}`);
  return { port, build: !values['no-build'] };
}

function build() {
  return setUp() && shown('cargo', ['xtask', 'wasm']) && shown('npm', ['run', '--workspace=web', 'build']);
}

const secondsSince = (began) => ((performance.now() - began) / 1000).toFixed(1);

/** Builds the instruments beside the running server, which a failure does not end. Returns what ends the building. */
function buildInstruments() {
  const began = performance.now();
  const building = inBackground(['cargo', 'xtask', 'instruments'], { cwd: root });
  building.done.then(({ outcome, output }) => {
    if (outcome === 'done') console.log(`The instruments are built (${secondsSince(began)} s).`);
    if (outcome === 'failed') {
      console.error(`${output}\nThe instruments could not be built; the rest of the page works without them.`);
    }
  });
  return building.end;
}

async function main() {
  const { port, build: wanted } = readArguments();
  const began = performance.now();
  if (wanted && !build()) return false;
  if (!existsSync(join(PAGE, 'index.html'))) {
    console.error('The page has not been built yet: run npm start without --no-build.');
    return false;
  }
  const server = fileServer(PAGE);
  const address = await listen(server, { port });
  console.log(`\nStepcast is at ${address} (first page after ${secondsSince(began)} s). Ctrl+C ends it.`);
  const endBuilding = wanted ? buildInstruments() : () => {};
  for (const signal of ['SIGINT', 'SIGTERM', 'SIGHUP']) {
    process.once(signal, () => {
      endBuilding();
      server.close();
      server.closeAllConnections();
    });
  }
  return true;
}

main().then(
  (ok) => {
    if (!ok) process.exitCode = 1;
  },
  (error) => {
    console.error(error.message);
    process.exitCode = 2;
  },
);
