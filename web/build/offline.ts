// Tells the service worker which files the page consists of, and by what name this version goes: a hash of them all.
// What is loaded only on demand is not among them; the service worker keeps it once it was asked for.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Plugin } from 'vite';
import { ON_DEMAND } from './budget.ts';

const PAGE = 'index.html';
/** Of the public folder. */
const PUBLIC_FILES = ['icon.svg'];

/** A plugin that writes the list in front of the service worker's code. `name` is the worker's entry. */
export function offlineFiles(name: string): Plugin {
  let publicFolder = '';
  return {
    name: 'stepcast-offline-files',
    apply: 'build',
    configResolved(config) {
      publicFolder = config.publicDir;
    },
    generateBundle: {
      // After everything else has been put into the bundle, the page itself too.
      order: 'post',
      handler(_options, bundle) {
        const worker = bundle[`${name}.js`];
        if (worker?.type !== 'chunk') return this.error(`there is no service worker ${name}.js`);
        if (worker.imports.length > 0) return this.error('the service worker has to be one file');
        const hash = createHash('sha256');
        const files = Object.values(bundle)
          .filter((file) => file !== worker && !ON_DEMAND.test(file.fileName))
          .sort((a, b) => (a.fileName < b.fileName ? -1 : 1));
        for (const file of files) {
          hash.update(`${file.fileName}\n`).update(file.type === 'chunk' ? file.code : file.source);
        }
        for (const file of PUBLIC_FILES) hash.update(readFileSync(join(publicFolder, file)));
        hash.update(worker.code);
        const version = hash.digest('hex').slice(0, 16);
        // The page goes by its folder's address: that is what people open.
        const names = [
          ...files.map(({ fileName }) => (fileName === PAGE ? './' : fileName)),
          ...PUBLIC_FILES,
        ];
        worker.code = `const STEPCAST_VERSION=${JSON.stringify(version)},STEPCAST_FILES=${JSON.stringify(names)};\n${worker.code}`;
      },
    },
  };
}
