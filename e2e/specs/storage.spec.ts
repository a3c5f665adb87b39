// Prints kept in the browser's own file system: what was written is there after the renderer was killed, and two tabs
// do not write one print.
import type { Page, Worker } from '@playwright/test';
import { installStorage, type Storage } from '../fixtures/storage.ts';
import { expect, test } from '../fixtures/test.ts';
import { machineWorker } from '../fixtures/worker.ts';
import { Panel } from '../pages/panel.ts';

async function storeIn(page: Page): Promise<Worker> {
  await expect.poll(() => machineWorker(page).catch(() => null)).not.toBeNull();
  const worker = await machineWorker(page);
  await installStorage(worker);
  return worker;
}

/** Opens the print and writes; leaves it open. */
const write = (worker: Worker, id: string): Promise<{ copied: number; appendMs: number }> =>
  worker.evaluate(async (id) => {
    const { PrintStore } = (globalThis as unknown as { storage: Storage }).storage;
    const print = await new PrintStore().openPrint(id);
    const began = performance.now();
    for (let row = 0; row < 100; row += 1) print.appendJournal(new Uint8Array(100).fill(row));
    const appendMs = (performance.now() - began) / 100;
    const part = new Uint8Array(1_000_000).fill(7);
    const told: number[] = [];
    await print.copyFile(new Blob(Array.from({ length: 20 }, () => part)).stream(), (bytes) =>
      told.push(bytes),
    );
    Object.assign(globalThis, { print });
    return { copied: told.at(-1) ?? 0, appendMs };
  }, id);

const failure = (worker: Worker, id: string): Promise<string> =>
  worker.evaluate(async (id) => {
    const { PrintStore } = (globalThis as unknown as { storage: Storage }).storage;
    return await new PrintStore().openPrint(id).then(
      () => 'opened',
      (error: unknown) => (error as { code: string }).code,
    );
  }, id);

test('a journal and a file outlive a renderer that is killed; one tab at a time writes them', async ({
  context,
  panel,
  watch,
}) => {
  watch.expectError(/the page crashed/);
  const first = await storeIn(panel.page);
  const { copied, appendMs } = await write(first, 'part-1');
  console.log(`    a row of the journal to the disk: ${appendMs.toFixed(2)} ms`);
  expect(copied).toBe(20_000_000);
  const second = new Panel(await context.newPage());
  await second.open();
  const worker = await storeIn(second.page);
  expect(await failure(worker, 'part-1')).toBe('in-use');

  const session = await context.newCDPSession(panel.page);
  const crashed = panel.page.waitForEvent('crash');
  void session.send('Page.crash').catch(() => undefined);
  await crashed;
  await expect.poll(() => failure(worker, 'part-1')).toBe('opened');

  const found = await worker.evaluate(async () => {
    const { PrintStore } = (globalThis as unknown as { storage: Storage }).storage;
    const store = new PrintStore();
    const journal = await store.readJournal('part-1');
    const file = new Uint8Array(await (await store.openFile('part-1')).arrayBuffer());
    const prints = await store.listPrints();
    return {
      rows: journal.every((byte, at) => byte === Math.floor(at / 100)),
      bytes: [journal.length, file.length, prints[0]?.journalBytes, prints[0]?.fileBytes],
      isSame: file.every((byte) => byte === 7),
      prints: prints.map(({ id }) => id),
      hasRoom: [await store.hasRoomFor(1e6), await store.hasRoomFor(1e18)],
    };
  });
  expect(found).toEqual({
    rows: true,
    bytes: [10_000, 20_000_000, 10_000, 20_000_000],
    isSame: true,
    prints: ['part-1'],
    hasRoom: [true, false],
  });
});
