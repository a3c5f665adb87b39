// What is kept of prints: the journal before anything else, the file beside it, and nothing of what has ended. Whatever
// fails is said once and stops no print.
import { beforeEach, expect, test } from 'vitest';
import { type About, Archive, type PrintLog } from '../src/machine/archive';
import { type Trouble, WHOLE } from '../src/machine/protocol';
import type { JournalSummary } from '../src/machine/session';
import { PrintStore } from '../src/machine/storage';
import { seconds } from '../src/units';
import { FakeDisk } from './fake_files';
import { FakeLocks } from './fake_locks';

const ABOUT: About = {
  facts: { name: 'part.gcode', time: seconds(60), lines: 100 },
  machine: { name: 'Mill', config: '[printer]' },
  port: { vendor: 1, product: 2, index: 0 },
  fileBytes: 4,
  start: WHOLE,
  continues: null,
};

/** A journal of this test: numbers by spaces, the first the print's own; what follows a hash is torn off. */
function read(journal: Uint8Array, held: number | null): JournalSummary | null {
  const text = Buffer.from(journal).toString().replace(/#.*/s, '');
  const numbers = text.split(' ').map(Number);
  const [number = Number.NaN] = numbers;
  if (text === '' || Number.isNaN(number)) return null;
  return {
    number,
    hasEnded: numbers.includes(-1),
    isHeld: held !== null && numbers.includes(held),
    line: numbers.length > 1 ? numbers.length : 0,
    elapsed: seconds(1),
    readableBytes: text.length,
  };
}

let disk: FakeDisk;
let locks: FakeLocks;
let store: PrintStore;
let archive: Archive;
let told: Trouble[];
const tell = (trouble: Trouble): void => void told.push(trouble);
const file = new Blob(['G28\n']);

beforeEach(() => {
  disk = new FakeDisk();
  locks = new FakeLocks();
  told = [];
  store = new PrintStore(
    () => disk.handle(),
    async () => disk.bytesMax - disk.used,
  );
  archive = new Archive(store, read, locks);
});

async function begun(about = ABOUT): Promise<PrintLog> {
  const log = await archive.begin(about, tell);
  if (!log) throw new Error('it was not begun');
  return log;
}

/** The page is gone without a word: nothing is closed in order, and the browser lets go of everything. */
async function interrupted(log: PrintLog): Promise<void> {
  await log.close();
}

test('a print that was interrupted is found again, with all there is to know of it', async () => {
  const log = await begun();
  archive.copy(log, file);
  log.append(`${log.number} 7 `);
  log.append('8 ');
  expect(await archive.list(), 'it is under way').toEqual([]);
  await expect.poll(() => store.openFile(log.id).then((copy) => copy.text(), String)).toBe('G28\n');
  await interrupted(log);
  const [print] = await archive.list();
  const { start, continues, ...known } = ABOUT;
  expect(continues).toBeNull();
  expect(print).toEqual({
    ...known,
    id: log.id,
    line: 4,
    startLine: start.line,
    confirmedLines: start.confirmedLines,
    elapsed: 1,
    heardOf: expect.any(Number),
  });
  const found = await archive.find(8);
  expect(found?.print).toMatchObject(known);
  expect(await archive.find(9)).toBeNull();
  if (!found) throw new Error('not found');
  expect(await (await archive.openFile(found.print))?.text()).toBe('G28\n');
  expect(told).toEqual([]);
});

test('what is added to a torn journal follows what can be read', async () => {
  const log = await begun();
  log.append('5 6#torn');
  await interrupted(log);
  const found = await archive.find(6);
  if (!found) throw new Error('not found');
  const again = await archive.reopen(found, tell);
  again.append(' 7');
  expect(Buffer.from(await store.readJournal(log.id)).toString()).toBe('5 6 7');
});

test('one tab at a time has a print', async () => {
  const log = await begun();
  log.append('5 6');
  const found = await archive.find(6);
  if (!found) throw new Error('not found');
  await expect(archive.reopen(found, tell)).rejects.toMatchObject({ code: 'in-use' });
  await interrupted(log);
  expect((await archive.reopen(found, tell)).id).toBe(log.id);
});

test('what has come to its end is not kept, what was left or lost in its middle is', async () => {
  const [done, over, lost, idle, left] = [
    await begun(),
    await begun(),
    await begun(),
    await begun(),
    await begun(),
  ];
  done.append('5 6 -1');
  over.append('15 16');
  lost.append('25 26');
  idle.append('35');
  left.append('45 46');
  await archive.settle(done, 'left');
  await archive.settle(over, 'over');
  await archive.settle(lost, 'lost');
  await archive.settle(idle, 'lost');
  await archive.settle(left, 'left');
  const kept = [lost.id, left.id].sort();
  expect((await archive.list()).map(({ id }) => id).sort()).toEqual(kept);
  expect((await store.listPrints()).map(({ id }) => id).sort()).toEqual(kept);
  expect(locks.names.size).toBe(0);
  await archive.forget(left.id);
  await archive.forget(lost.id);
  expect(await archive.list()).toEqual([]);
});

test('a record that cannot be read for now is not thrown away for that', async () => {
  const log = await begun();
  log.append('5 6');
  const { readJournal } = store;
  store.readJournal = () => Promise.reject(new DOMException('busy', 'UnknownError'));
  await archive.settle(log, 'left');
  expect(await archive.list()).toEqual([]);
  store.readJournal = readJournal;
  expect((await archive.list()).map(({ id }) => id)).toEqual([log.id]);
});

/** A print in its middle, and another that goes on with it. */
async function goneOnWith(journal: string): Promise<{ first: PrintLog; second: PrintLog }> {
  const first = await begun();
  archive.copy(first, file);
  first.append('5 6');
  await expect.poll(() => store.openFile(first.id).then((copy) => copy.text(), String)).toBe('G28\n');
  await interrupted(first);
  const start = { confirmedLines: [], line: 3, transform: null };
  const second = await begun({ ...ABOUT, start, continues: first.id });
  second.append(journal);
  return { first, second };
}

test('the print that another goes on with is kept as long as its file is needed', async () => {
  const { second } = await goneOnWith('15 16');
  expect(await archive.list(), 'both are under way').toEqual([]);
  await archive.settle(second, 'done');
  expect(await store.listPrints()).toEqual([]);
  expect(locks.names.size).toBe(0);
});

test('what a continuation was given up for is kept for the board that may hold it, and offered to no other', async () => {
  const { first, second } = await goneOnWith('15 16');
  await archive.settle(second, 'over');
  // Begun there it would run into what the other has printed.
  expect(await archive.list()).toEqual([]);
  expect((await store.listPrints()).map(({ id }) => id)).toEqual([first.id]);
  const found = await archive.find(6);
  if (!found) throw new Error('not found');
  expect(await (await archive.openFile(found.print))?.text()).toBe('G28\n');
  // Taken up and interrupted anew it is one like all others.
  await interrupted(await archive.reopen(found, tell));
  expect((await archive.list()).map(({ id }) => id)).toEqual([first.id]);
  expect(locks.names.size).toBe(0);
});

test('the same where the page was gone before it could put the continuation away', async () => {
  const { first, second } = await goneOnWith('15 16 -1');
  await interrupted(second);
  expect(await archive.list()).toEqual([]);
  expect((await store.listPrints()).map(({ id }) => id)).toEqual([first.id]);
  expect((await archive.find(6))?.print.id).toBe(first.id);
});

test('with a print goes all that it went on with: when it is done, and at the user\u2019s word', async () => {
  for (const act of ['done', 'discard'] as const) {
    const { second } = await goneOnWith('15 16');
    await interrupted(second);
    const third = await begun({ ...ABOUT, continues: second.id });
    third.append('25 26');
    if (act === 'done') await archive.settle(third, 'done');
    else {
      await interrupted(third);
      expect((await archive.list()).map(({ id }) => id)).toEqual([third.id]);
      expect(await store.listPrints()).toHaveLength(3);
      await archive.discard(third.id);
    }
    expect(await store.listPrints(), act).toEqual([]);
  }
});

test('records that go on with each other in a circle are discarded all the same', async () => {
  const { first, second } = await goneOnWith('15 16');
  await interrupted(second);
  const again = await store.openPrint(first.id);
  await again.describe(Buffer.from(JSON.stringify({ ...ABOUT, continues: second.id })));
  again.close();
  await archive.discard(second.id);
  expect(await store.listPrints()).toEqual([]);
});

test('a print that was to go on with another and got nowhere leaves it as it was', async () => {
  const { first, second } = await goneOnWith('15');
  await interrupted(second);
  expect((await archive.list()).map(({ id }) => id)).toEqual([first.id]);
  await archive.settle(second, 'over');
  expect((await archive.list()).map(({ id }) => id)).toEqual([first.id]);
});

test('what has got further takes the place of what it went on with, which is kept for the board that may hold it', async () => {
  const { first, second } = await goneOnWith('15 16');
  await interrupted(second);
  expect((await archive.list()).map(({ id, startLine }) => [id, startLine])).toEqual([[second.id, 3]]);
  expect((await store.listPrints()).map(({ id }) => id)).toContain(first.id);
  const found = await archive.find(16);
  if (!found) throw new Error('not found');
  const again = await archive.reopen(found, tell);
  archive.copy(again, file);
  await expect.poll(() => store.openFile(second.id).then((copy) => copy.text(), String)).toBe('G28\n');
  await interrupted(again);
  expect((await archive.list()).map(({ id }) => id)).toEqual([second.id]);
  expect((await archive.find(6))?.print.id).toBe(first.id);
});

test('the file of a kept print: its copy, or the very same from the user', async () => {
  const log = await begun();
  log.append('5 6');
  expect(await archive.fileOf(log.id, null)).toBeNull();
  archive.copy(log, file);
  await expect.poll(async () => (await archive.fileOf(log.id, null)) instanceof Blob).toBe(true);
  const given = new Blob(['G28\n']);
  expect(await archive.fileOf(log.id, given)).toBe(given);
  for (const other of ['G29\n', 'G28\nG1'])
    expect(await archive.fileOf(log.id, new Blob([other]))).toMatchObject({ code: 'other-file' });
  expect(await archive.recordOf(log.id)).toMatchObject({ config: ABOUT.machine.config });
  await interrupted(log);
  await archive.forget(log.id);
  expect(await archive.fileOf(log.id, null)).toMatchObject({ code: 'storage-missing' });
});

test('a record in which nothing was written, or whose print has ended, is put away with the list', async () => {
  const [empty, ended, odd] = [await begun(), await begun(), await begun()];
  ended.append('5 -1');
  odd.append('of another version');
  for (const log of [empty, ended, odd]) await interrupted(log);
  expect(await archive.list()).toEqual([]);
  // Another version may be able to read it.
  expect((await store.listPrints()).map(({ id }) => id)).toEqual([odd.id]);
});

test('numbers of prints keep apart', async () => {
  const numbers: number[] = [];
  for (let count = 0; count < 6; count += 1) {
    const log = await begun();
    log.append(`${log.number}`);
    numbers.push(log.number);
  }
  for (const [index, one] of numbers.entries()) {
    expect(one).toBeGreaterThan(0);
    expect(one).toBeLessThan(2 ** 32 - 2 ** 20);
    for (const other of numbers.slice(index + 1)) expect(Math.abs(one - other)).toBeGreaterThan(2 ** 20);
  }
});

test('where nothing can be stored, the print begins without and it is said', async () => {
  const closed = new Archive(
    new PrintStore(async () => {
      throw new DOMException('private window', 'SecurityError');
    }),
    read,
    locks,
  );
  expect(await closed.begin(ABOUT, tell)).toBeNull();
  expect(told.map(({ code }) => code)).toEqual(['storage-unavailable']);
  expect(told[0]?.safe).toContain('not touched');
  expect(await closed.list()).toEqual([]);
  expect(locks.names.size).toBe(0);
});

test('a journal that cannot be gone on with is left alone, and that is said once', async () => {
  const log = await begun();
  log.append('5 6');
  disk.bytesMax = disk.used;
  log.append(' 7');
  disk.bytesMax = Number.POSITIVE_INFINITY;
  log.append(' 8');
  expect(told.map(({ code }) => code)).toEqual(['storage-full']);
  expect(Buffer.from(await store.readJournal(log.id)).toString()).toBe('5 6');
});

test('without room for a copy the file is asked for again, and known again', async () => {
  disk.bytesMax = 1024 * 1024;
  const log = await begun();
  log.append('5 6');
  archive.copy(log, file);
  await expect.poll(() => told.map(({ code }) => code)).toEqual(['copy-missing']);
  await interrupted(log);
  const found = await archive.find(6);
  if (!found) throw new Error('not found');
  expect(await archive.openFile(found.print)).toBeNull();
  expect(await archive.isItsFile(found.print, file)).toBe(true);
  expect(await archive.isItsFile(found.print, new Blob(['G29\n']))).toBe(false);
  expect(await archive.isItsFile(found.print, new Blob(['G28\nG1']))).toBe(false);
});

test('a file that does not come holds nothing up', async () => {
  const log = await begun();
  log.append('5 6');
  const stuck = new Blob(['G28']);
  Object.defineProperty(stuck, 'stream', { value: () => new ReadableStream() });
  archive.copy(log, stuck);
  await interrupted(log);
  expect(locks.names.size).toBe(0);
  expect(told).toEqual([]);
});

test('a copy that was broken off is none', async () => {
  const log = await begun();
  log.append('5 6');
  archive.copy(log, new Blob([new Uint8Array(1_000_000)]));
  await interrupted(log);
  const found = await archive.find(6);
  if (!found) throw new Error('not found');
  expect(await archive.openFile(found.print)).toBeNull();
  expect(told).toEqual([]);
});
