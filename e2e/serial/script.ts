// The double as one script, to be put before the page's own code in windows and workers. Knows nothing of tests.
import { fileURLToPath } from 'node:url';
import { build } from 'vite';

let made: Promise<string> | undefined;

async function bundle(): Promise<string> {
  const built = await build({
    configFile: false,
    logLevel: 'warn',
    publicDir: false,
    build: {
      write: false,
      minify: false,
      target: 'esnext',
      lib: {
        entry: fileURLToPath(new URL('./double/install.ts', import.meta.url)),
        formats: ['iife'],
        name: 'stepcastSerialDouble',
        fileName: 'serial_double',
      },
    },
  });
  const outputs = (Array.isArray(built) ? built : [built]).flatMap((one) =>
    'output' in one ? one.output : [],
  );
  const chunk = outputs.find((output) => output.type === 'chunk');
  if (chunk?.type !== 'chunk') throw new Error('the double of the serial ports was not built');
  return chunk.code;
}

/** Built once for each process. */
export function doubleScript(): Promise<string> {
  made ??= bundle();
  return made;
}
