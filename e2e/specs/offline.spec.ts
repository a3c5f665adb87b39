// The page without a network, and a new version of it: with the service worker that the other specs do without. The
// server is really gone, and the new version really lies in the folder that it serves.
import { cp, mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import type { Server } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { type BrowserContext, test as base, expect } from '@playwright/test';
import { travels } from '../fixtures/gcode.ts';
import { MainThread } from '../fixtures/main_thread.ts';
import { pageFolder, type Site, withSite } from '../fixtures/server.ts';
import { judgeTasks } from '../fixtures/test.ts';
import { ContextWatch } from '../fixtures/watch.ts';
import { Panel } from '../pages/panel.ts';

interface Visit {
  readonly folder: string;
  readonly site: Site;
  readonly context: BrowserContext;
  readonly panel: Panel;
}

const test = base.extend<{ visit: Visit }>({
  visit: async ({ browser }, use, { annotations }) => {
    const folder = await mkdtemp(join(tmpdir(), 'stepcast-offline-'));
    await cp(pageFolder(), folder, { recursive: true });
    await withSite(async (site) => {
      const context = await browser.newContext({ serviceWorkers: 'allow', baseURL: site.url });
      const watch = new ContextWatch(context, [new URL(site.url).origin], site.takeRefusals);
      const mainThread = MainThread.watch(browser, context, site.url);
      const panel = new Panel(await context.newPage());
      await use({ folder, site, context, panel });
      await judgeTasks(mainThread, annotations);
      expect(watch.troubles()).toEqual([]);
      await context.close();
    }, folder);
    await rm(folder, { recursive: true, force: true });
  },
});

/** Opens the page and waits until it is kept. */
async function keep({ panel }: Visit): Promise<void> {
  await panel.open();
  await panel.page.waitForFunction(() => navigator.serviceWorker.controller !== null);
}

async function goOffline(server: Server): Promise<void> {
  server.closeAllConnections();
  await new Promise((done) => server.close(done));
}

test('once loaded, the page opens and prints on the virtual printer without its server', async ({
  visit,
}) => {
  const { panel, site, context } = visit;
  await keep(visit);
  await goOffline(site.server);
  const refused = await context.request.get(site.url).catch(() => 'no server');
  expect(refused).toBe('no server');
  await panel.page.reload();
  await expect(panel.page.getByRole('heading', { name: 'Stepcast' })).toBeVisible();
  await panel.connectVirtual();
  const path = test.info().outputPath('travels.gcode');
  await writeFile(path, travels(20).gcode);
  await panel.drop(path);
  await panel.startPrint();
  await expect(panel.job).toContainText('The print is done.');
  // Another tab, too.
  const second = new Panel(await context.newPage());
  await second.open();
  await expect(second.status).toContainText('Viewer: ready');
});

/** Puts another version where the server takes the page from. */
async function release(folder: string): Promise<void> {
  const [page, worker] = [join(folder, 'index.html'), join(folder, 'sw.js')];
  const text = await readFile(page, 'utf8');
  await writeFile(page, text.replace('<title>', '<meta name="version" content="next" /><title>'));
  const code = await readFile(worker, 'utf8');
  const next = code.replace(/STEPCAST_VERSION="[^"]+"/, 'STEPCAST_VERSION="next"');
  expect(next).not.toBe(code);
  await writeFile(worker, next);
}

const isNext = (panel: Panel): Promise<boolean> =>
  panel.page
    .locator('meta[name="version"]')
    .count()
    .then((count) => count > 0);

test('a new version waits while a print runs, and is loaded when the user says so', async ({ visit }) => {
  const { folder, panel, context } = visit;
  await keep(visit);
  await panel.connectVirtual();
  const path = test.info().outputPath('travels.gcode');
  await writeFile(path, travels(3000).gcode);
  await panel.drop(path);
  await panel.startPrint();
  let loads = 0;
  panel.page.on('load', () => {
    loads += 1;
  });
  await release(folder);
  await panel.page.evaluate(async () => {
    await (await navigator.serviceWorker.ready).update();
  });
  const notices = panel.page.getByRole('status', { name: 'Notices' });
  await expect(notices).toContainText('A new version of this page is ready. It waits until no print runs.');
  const reload = notices.getByRole('button', { name: 'Reload' });
  await expect(reload).toBeDisabled();
  // A tab that is opened meanwhile is of the version that is in use, and may not reload either.
  const second = new Panel(await context.newPage());
  await second.open();
  expect(await isNext(second)).toBe(false);
  await expect(second.status).toContainText('Viewer: printing');
  await expect(second.page.getByRole('button', { name: 'Reload' })).toBeDisabled();
  await expect(panel.status).toContainText('Printing');

  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.status).toContainText('Ready');
  await expect(notices).toContainText('Reloading ends the connection.');
  expect([loads, await isNext(panel)]).toEqual([0, false]);
  await reload.click();
  await expect.poll(() => isNext(panel)).toBe(true);
  await expect(panel.status).toContainText('Not connected');
  expect(loads).toBe(1);
  // The other tab is not touched, and reloads when its own user says so.
  expect(await isNext(second)).toBe(false);
  await second.page.getByRole('button', { name: 'Reload' }).click();
  await expect.poll(() => isNext(second)).toBe(true);
});
