// How the page is built: no framework plugin (the JSX runtime is Preact's), workers as modules, the size checked.
import { join } from 'node:path';
import { defineConfig } from 'vitest/config';
import { firstLoadBudget } from './build/budget.ts';
import { offlineFiles } from './build/offline.ts';
import { contentSecurityPolicy } from './build/policy.ts';

/** First load without the instruments, compressed with brotli. */
const FIRST_LOAD_MAX_BYTES = 700_000;

/** Keeps the page for when there is no network. */
const SERVICE_WORKER = 'sw';
const SERVICE_WORKER_SOURCE = join(import.meta.dirname, 'src', 'offline', 'service_worker.ts');

export default defineConfig({
  root: import.meta.dirname,
  base: './',
  publicDir: 'public',
  oxc: { jsx: { runtime: 'automatic', importSource: 'preact' } },
  build: {
    target: 'esnext',
    outDir: 'dist',
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
    chunkSizeWarningLimit: 1000,
    rolldownOptions: {
      input: { index: join(import.meta.dirname, 'index.html'), [SERVICE_WORKER]: SERVICE_WORKER_SOURCE },
      output: {
        // A service worker is known by its address.
        entryFileNames: ({ name }) => (name === SERVICE_WORKER ? `${name}.js` : 'assets/[name]-[hash].js'),
      },
    },
  },
  worker: { format: 'es' },
  plugins: [contentSecurityPolicy(), offlineFiles(SERVICE_WORKER), firstLoadBudget(FIRST_LOAD_MAX_BYTES)],
  test: {
    include: ['tests/**/*.test.{ts,tsx}'],
    environment: 'node',
  },
});
