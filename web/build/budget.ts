// Measures what a first visit fetches, prints it, and fails the build when it is too much.
//
// Everything that is emitted counts, the workers and the planner's WebAssembly too, but for what is loaded only on
// demand: the instruments, the sample, and the 3D view for browsers that cannot draw in a worker. Sizes are those of brotli at its best, which static hosts serve.
import { brotliCompressSync, constants } from 'node:zlib';
import type { Plugin } from 'vite';

/** Emitted files that a first visit does not fetch. */
const ON_DEMAND = /instruments|\/view-|\.gcode$|\.map$/;

function compressed(content: string | Uint8Array): number {
  const bytes = typeof content === 'string' ? Buffer.from(content) : content;
  return brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } }).length;
}

const inKilobytes = (bytes: number): string => `${(bytes / 1000).toFixed(1).padStart(7)} KB`;

/** A plugin that prints the size of the first load and fails above `maxBytes`. */
export function firstLoadBudget(maxBytes: number): Plugin {
  return {
    name: 'stepcast-first-load-budget',
    apply: 'build',
    writeBundle(_options, bundle) {
      const files = Object.values(bundle)
        .filter((file) => !ON_DEMAND.test(file.fileName))
        .map((file) => ({
          name: file.fileName,
          bytes: compressed(file.type === 'chunk' ? file.code : file.source),
        }))
        .sort((a, b) => b.bytes - a.bytes);
      const total = files.reduce((sum, file) => sum + file.bytes, 0);
      const lines = files.map(({ name, bytes }) => `  ${inKilobytes(bytes)}  ${name}`);
      const title = `First load, brotli: ${inKilobytes(total).trim()} of at most ${inKilobytes(maxBytes).trim()}`;
      this.info(`${title}\n${lines.join('\n')}`);
      if (total > maxBytes)
        this.error(`the first load is ${total} bytes with brotli; at most ${maxBytes} are allowed`);
    },
  };
}
