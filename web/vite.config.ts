// How the page is built: no framework plugin (the JSX runtime is Preact's), workers as modules, the size checked.
import { defineConfig } from 'vitest/config';
import { firstLoadBudget } from './build/budget.ts';
import { contentSecurityPolicy } from './build/policy.ts';

/** First load without the instruments, compressed with brotli. */
const FIRST_LOAD_MAX_BYTES = 700_000;

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
  },
  worker: { format: 'es' },
  plugins: [contentSecurityPolicy(), firstLoadBudget(FIRST_LOAD_MAX_BYTES)],
  test: {
    include: ['tests/**/*.test.{ts,tsx}'],
    environment: 'node',
  },
});
