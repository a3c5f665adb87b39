// Measures what a first visit fetches, prints it, and fails the build when it is too much.
//
// Everything that is emitted counts, the workers and the planner's WebAssembly too, but for what is loaded only on
// demand: the instruments, the sample, and the 3D view for browsers that cannot draw in a worker. The instruments' size
// is printed apart, where they are built. Sizes are those of brotli at its best, which static hosts serve.
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { brotliCompressSync, constants } from 'node:zlib';
import type { Plugin } from 'vite';

/** Emitted files that a first visit does not fetch. */
export const ON_DEMAND = /instruments|\/open_view-|\.gcode$|\.map$/;

/** Where the instruments lie in the public folder and in the page. */
const INSTRUMENTS = 'instruments';

/** Brotli's best takes half a minute on the instruments; this is a tenth above it. */
const INSTRUMENTS_QUALITY = 9;

function compressed(content: string | Uint8Array, quality = constants.BROTLI_MAX_QUALITY): number {
  const bytes = typeof content === 'string' ? Buffer.from(content) : content;
  return brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: quality } }).length;
}

const inKilobytes = (bytes: number): string => `${(bytes / 1000).toFixed(1).padStart(7)} KB`;

interface Size {
  readonly name: string;
  readonly bytes: number;
}

const total = (files: readonly Size[]): number => files.reduce((sum, { bytes }) => sum + bytes, 0);

function table(files: readonly Size[]): string {
  const largestFirst = [...files].sort((a, b) => b.bytes - a.bytes);
  return largestFirst.map(({ name, bytes }) => `  ${inKilobytes(bytes)}  ${name}`).join('\n');
}

/** What `cargo xtask instruments` has put into the public folder. */
function instruments(publicFolder: string): string {
  const folder = join(publicFolder, INSTRUMENTS);
  let names: string[];
  try {
    names = readdirSync(folder).filter((name) => !name.endsWith('.new'));
  } catch {
    return 'Instruments: not built yet (cargo xtask instruments); the page works without';
  }
  const files = names.map((name) => ({
    name: `${INSTRUMENTS}/${name}`,
    bytes: compressed(readFileSync(join(folder, name)), INSTRUMENTS_QUALITY),
  }));
  return `Instruments, loaded when they are opened, brotli ${INSTRUMENTS_QUALITY}: ${inKilobytes(total(files)).trim()}\n${table(files)}`;
}

/** A plugin that prints the size of the first load and fails above `maxBytes`. */
export function firstLoadBudget(maxBytes: number): Plugin {
  let publicFolder = '';
  return {
    name: 'stepcast-first-load-budget',
    apply: 'build',
    configResolved(config) {
      publicFolder = config.publicDir;
    },
    writeBundle(_options, bundle) {
      const files = Object.values(bundle)
        .filter((file) => !ON_DEMAND.test(file.fileName))
        .map((file) => ({
          name: file.fileName,
          bytes: compressed(file.type === 'chunk' ? file.code : file.source),
        }));
      const bytes = total(files);
      const title = `First load, brotli: ${inKilobytes(bytes).trim()} of at most ${inKilobytes(maxBytes).trim()}`;
      this.info(`${title}\n${table(files)}`);
      this.info(instruments(publicFolder));
      if (bytes > maxBytes)
        this.error(`the first load is ${bytes} bytes with brotli; at most ${maxBytes} are allowed`);
    },
  };
}
