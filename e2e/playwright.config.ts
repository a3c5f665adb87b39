// The browser tests: one headless Chromium, one test at a time, against the built page.
import { defineConfig } from '@playwright/test';
import { BROWSER_ADVICE, browserArguments, findBrowser } from '../scripts/lib/browser.mjs';

const executablePath = findBrowser();
if (!executablePath) throw new Error(`Missing: ${BROWSER_ADVICE}`);

export default defineConfig({
  testDir: './specs',
  outputDir: './test-results',
  // Prints and pictures are timed: a second browser beside the first would make both late on a small computer.
  workers: 1,
  fullyParallel: false,
  forbidOnly: Boolean(process.env['CI']),
  // A shared machine may stand still for seconds: what passes only the second time is told as flaky.
  retries: process.env['CI'] ? 1 : 0,
  timeout: 60_000,
  expect: { timeout: 20_000 },
  reporter: [['list']],
  use: {
    browserName: 'chromium',
    headless: true,
    locale: 'en-GB',
    // Routes would not see what it answers; specs/offline.spec.ts has it.
    serviceWorkers: 'block',
    actionTimeout: 15_000,
    navigationTimeout: 30_000,
    // Without pictures of every moment: taking them would be most of the work here.
    trace: { mode: 'retain-on-failure', screenshots: false, snapshots: true, sources: false },
    screenshot: 'only-on-failure',
    launchOptions: { executablePath, args: browserArguments() },
  },
});
