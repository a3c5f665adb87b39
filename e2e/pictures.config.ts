// The pictures in the README, taken of a print as a newcomer makes it: npm run pictures --workspace=@stepcast/e2e
import { defineConfig } from '@playwright/test';
import base from './playwright.config.ts';

export default defineConfig({ ...base, testDir: './pictures', timeout: 240_000 });
