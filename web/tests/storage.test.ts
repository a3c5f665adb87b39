// Prints kept on disk: journals only grow and are never torn by a full disk, copies are whole or not there, and there
// are never too many.
import { beforeEach, expect, test } from 'vitest';
import { PRINTS_MAX, PrintStore, StorageError } from '../src/machine/storage';
import { storageTrouble } from '../src/machine/troubles';
import { FakeDisk } from './fake_files';

let disk: FakeDisk;
let store: PrintStore;

beforeEach(() => {
  disk = new FakeDisk();
  store = new PrintStore(
    () => disk.handle(),
    async () => disk.bytesMax - disk.used,
  );
});

const bytes = (...values: number[]): Uint8Array => Uint8Array.from(values);
const stream = (...pieces: Uint8Array[]): ReadableStream<Uint8Array> =>
  new ReadableStream({
    start(controller) {
      for (const piece of pieces) controller.enqueue(piece);
      controller.close();
    },
  });
const codeOf = (work: Promise<unknown>): Promise<string> =>
  work.then(
    () => 'done',
    (error: unknown) => (error instanceof StorageError ? error.code : `not ours: ${error}`),
  );

test('a journal grows, is read back, and goes on where it was when the print is opened again', async () => {
  const print = await store.openPrint('one');
  print.appendJournal(bytes(1, 2));
  print.appendJournal(bytes(3));
  print.close();
  print.close();
  const again = await store.openPrint('one');
  again.appendJournal(bytes(4));
  again.close();
  expect([...(await store.readJournal('one'))]).toEqual([1, 2, 3, 4]);
  expect(() => again.appendJournal(bytes(5))).toThrow(StorageError);
});

test('what no longer fits is said, and leaves the journal as it was', async () => {
  const print = await store.openPrint('one');
  print.appendJournal(bytes(1, 2, 3));
  disk.bytesMax = 5;
  expect(() => print.appendJournal(bytes(4, 5, 6, 7))).toThrow(expect.objectContaining({ code: 'full' }));
  expect([...(await store.readJournal('one'))]).toEqual([1, 2, 3]);
  // With room again it goes on.
  disk.bytesMax = 100;
  print.appendJournal(bytes(4));
  expect([...(await store.readJournal('one'))]).toEqual([1, 2, 3, 4]);
  expect(storageTrouble('full', new StorageError('full')).todo).toContain('Free space');
});

test('a file is copied in pieces, and is there only when it is whole', async () => {
  const print = await store.openPrint('one');
  const told: number[] = [];
  await print.copyFile(stream(bytes(1, 2), bytes(3)), (done) => told.push(done));
  expect(told).toEqual([2, 3]);
  expect([...new Uint8Array(await (await store.openFile('one')).arrayBuffer())]).toEqual([1, 2, 3]);
  // A copy that breaks off is none, and neither is the one before it.
  let pulls = 0;
  const broken = new ReadableStream<Uint8Array>({
    pull(controller) {
      pulls += 1;
      if (pulls === 1) controller.enqueue(bytes(9));
      else controller.error(new DOMException('the file changed', 'NotReadableError'));
    },
  });
  expect(await codeOf(print.copyFile(broken))).toBe('broken');
  expect(await codeOf(store.openFile('one'))).toBe('incomplete');
  expect((await store.listPrints())[0]?.fileBytes).toBeNull();
  // Another try may do.
  await print.copyFile(stream(bytes(7)));
  expect((await store.openFile('one')).size).toBe(1);
});

test('a file that does not fit is said, best before it is copied', async () => {
  disk.bytesMax = 40 * 1024 * 1024;
  expect([await store.hasRoomFor(1024), await store.hasRoomFor(20 * 1024 * 1024)]).toEqual([true, false]);
  disk.bytesMax = 100;
  const print = await store.openPrint('one');
  expect(await codeOf(print.copyFile(stream(new Uint8Array(60), new Uint8Array(60))))).toBe('full');
  expect(await codeOf(store.openFile('one'))).toBe('incomplete');
});

test('one writer at a time', async () => {
  const print = await store.openPrint('one');
  expect(await codeOf(store.openPrint('one'))).toBe('in-use');
  expect(await codeOf(store.remove('one'))).toBe('in-use');
  print.close();
  expect(await codeOf(store.remove('one'))).toBe('done');
  expect(await codeOf(store.readJournal('one'))).toBe('missing');
  expect(await codeOf(store.remove('one'))).toBe('done');
});

test('the oldest prints go when there are too many, but none that is being written', async () => {
  const kept = await store.openPrint('print-0');
  kept.appendJournal(bytes(0));
  for (let at = 1; at < PRINTS_MAX + 4; at += 1) {
    const print = await store.openPrint(`print-${at}`);
    print.appendJournal(bytes(at));
    print.close();
  }
  const ids = (await store.listPrints()).map(({ id }) => id);
  expect(ids).toContain('print-0');
  expect(ids).toContain(`print-${PRINTS_MAX + 3}`);
  expect(ids.length).toBeLessThanOrEqual(PRINTS_MAX + 1);
  expect(ids[0]).toBe(`print-${PRINTS_MAX + 3}`);
});

test.each(['', '../other', 'a/b', 'x'.repeat(65)])('%j is no name of a print', async (id) => {
  expect(await codeOf(store.openPrint(id))).toBe('missing');
  expect(await codeOf(store.readJournal(id))).toBe('missing');
  expect(await codeOf(store.remove(id))).toBe('done');
});

test('without storage that is said', async () => {
  const none = new PrintStore(() => Promise.reject(new DOMException('private', 'SecurityError')));
  expect(await codeOf(none.openPrint('one'))).toBe('unavailable');
  expect(await codeOf(none.listPrints())).toBe('unavailable');
});
