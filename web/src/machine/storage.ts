// Prints kept in the origin's private file system, so that they outlive the page: for each a journal that only grows,
// what is to be known about it, and a copy of its file. Runs in the worker, where files can be written in place and at
// once.
//
// Knows nothing of what a journal says. Layout: prints/<id>/journal, prints/<id>/about, prints/<id>/file, and
// prints/<id>/complete with the file's size and CRC-32 once it has been read to its end. Bounded: so many prints, so long a journal; the
// oldest prints go first. Sizes in bytes.
import { Crc32 } from './crc32';

/** Prints that are kept, the one that is open included. */
export const PRINTS_MAX = 8;
/** A journal that grows beyond this is not one of ours. */
export const JOURNAL_BYTES_MAX = 64 * 1024 * 1024;
/** So much stays free when a file is copied: the journal needs room, too. */
const SPARE_BYTES = 32 * 1024 * 1024;
/** So much of a copy is brought to the disk at once: the worker that drives the printer waits for it. */
const FLUSH_BYTES = 4 * 1024 * 1024;
const FOLDER = 'prints';
const JOURNAL = 'journal';
const FILE = 'file';
const COMPLETE = 'complete';
const ABOUT = 'about';
/** More than that is to be known about no print. */
const ABOUT_BYTES_MAX = 4 * 1024 * 1024;
const ID = /^[A-Za-z0-9-]{1,64}$/;

export type StorageCode =
  /** The browser keeps nothing for this page: a private window, or a setting. */
  | 'unavailable'
  /** The disk, or what the browser gives this page of it, is full. */
  | 'full'
  /** Another tab has this print open. */
  | 'in-use'
  | 'missing'
  /** The copy of the file broke off. */
  | 'incomplete'
  | 'too-long'
  | 'broken';

export class StorageError extends Error {
  readonly code: StorageCode;

  constructor(code: StorageCode, cause?: unknown) {
    super(code, { cause });
    this.name = 'StorageError';
    this.code = code;
  }
}

const CODES: ReadonlyMap<string, StorageCode> = new Map([
  ['QuotaExceededError', 'full'],
  ['NoModificationAllowedError', 'in-use'],
  ['InvalidStateError', 'broken'],
  ['NotFoundError', 'missing'],
  ['SecurityError', 'unavailable'],
  ['NotAllowedError', 'unavailable'],
]);

function asStorageError(error: unknown): StorageError {
  if (error instanceof StorageError) return error;
  const name = error instanceof Error || error instanceof DOMException ? error.name : '';
  return new StorageError(CODES.get(name) ?? 'broken', error);
}

/** Does what may fail in the browser's ways; it then fails in ours. */
async function tried<T>(act: () => Promise<T>): Promise<T> {
  try {
    return await act();
  } catch (error) {
    throw asStorageError(error);
  }
}

/** A file that is written in place: only workers have these, and TypeScript's types for pages lack them. */
export interface SyncFile {
  getSize(): number;
  write(bytes: Uint8Array, options: { readonly at: number }): number;
  truncate(size: number): void;
  flush(): void;
  close(): void;
}

type Writable = FileSystemFileHandle & { createSyncAccessHandle(): Promise<SyncFile> };

export interface StoredPrint {
  readonly id: string;
  readonly journalBytes: number;
  /** Null where there is no whole copy of the file. */
  readonly fileBytes: number | null;
  /** When the journal was last written. */
  readonly changed: Date;
}

/** Writes all of `bytes`; a file system that takes less is full. */
function writeAll(file: SyncFile, bytes: Uint8Array, at: number): void {
  for (let done = 0; done < bytes.byteLength; ) {
    const written = file.write(bytes.subarray(done), { at: at + done });
    if (written <= 0) throw new StorageError('full');
    done += written;
  }
}

/** A print that is being written. Nobody else can open it meanwhile. */
export class OpenPrint {
  readonly #folder: FileSystemDirectoryHandle;
  readonly #journal: SyncFile;
  #end: number;
  #isClosed = false;

  constructor(folder: FileSystemDirectoryHandle, journal: SyncFile) {
    this.#folder = folder;
    this.#journal = journal;
    this.#end = journal.getSize();
  }

  /** Behind what is there; on the disk when it returns. What could not be written whole is not there at all. */
  appendJournal(bytes: Uint8Array): void {
    if (this.#isClosed) throw new StorageError('broken');
    if (this.#end + bytes.byteLength > JOURNAL_BYTES_MAX) throw new StorageError('too-long');
    try {
      writeAll(this.#journal, bytes, this.#end);
      this.#journal.flush();
      this.#end += bytes.byteLength;
    } catch (error) {
      this.#cut();
      throw asStorageError(error);
    }
  }

  /** Only so many bytes of the journal stay: what follows them cannot be read, and nothing behind it could be. */
  keepJournal(bytes: number): void {
    this.#end = Math.min(this.#end, bytes);
    this.#cut();
  }

  /** Writes down what is to be known about the print, in the place of what was. */
  async describe(about: Uint8Array): Promise<void> {
    await tried(async () => writeWhole(this.#folder, ABOUT, about));
  }

  #cut(): void {
    try {
      this.#journal.truncate(this.#end);
    } catch {
      // The reader of a journal looks for a torn end anyhow.
    }
  }

  /** Keeps a copy of the print's file, in pieces; `progress` is told the bytes so far. */
  async copyFile(
    stream: ReadableStream<Uint8Array>,
    progress: (bytes: number) => void = () => undefined,
  ): Promise<void> {
    await tried(async () => {
      // What was said of an older copy does not hold any more.
      await this.#folder.removeEntry(COMPLETE).catch(ignoreMissing);
      const mark = await fill(await openSync(this.#folder, FILE), stream, progress);
      await writeWhole(this.#folder, COMPLETE, new TextEncoder().encode(mark));
    });
  }

  /** Reads the file through without a copy of it: by its check it is known again. */
  async markFile(stream: ReadableStream<Uint8Array>): Promise<void> {
    await tried(async () => {
      const mark = await fill(null, stream, () => undefined);
      await this.#folder.removeEntry(FILE).catch(ignoreMissing);
      await writeWhole(this.#folder, COMPLETE, new TextEncoder().encode(mark));
    });
  }

  close(): void {
    if (this.#isClosed) return;
    this.#isClosed = true;
    this.#journal.close();
  }
}

/** A small file, on the disk when it returns. */
async function writeWhole(folder: FileSystemDirectoryHandle, name: string, bytes: Uint8Array): Promise<void> {
  const file = await openSync(folder, name);
  try {
    file.truncate(0);
    writeAll(file, bytes, 0);
    file.flush();
  } finally {
    file.close();
  }
}

/** What is written down of a copy: its size and its check. */
const markOf = (bytes: number, crc: Crc32): string => `${bytes} ${crc.text}`;

async function markOfFile(file: Blob): Promise<string> {
  const crc = new Crc32();
  const reader = file.stream().getReader();
  for (let piece = await reader.read(); !piece.done; piece = await reader.read()) crc.add(piece.value);
  return markOf(file.size, crc);
}

/** Fills the file, where there is one; its mark. */
async function fill(
  file: SyncFile | null,
  stream: ReadableStream<Uint8Array>,
  progress: (bytes: number) => void,
): Promise<string> {
  const reader = stream.getReader();
  const crc = new Crc32();
  let [bytes, flushed] = [0, 0];
  try {
    file?.truncate(0);
    for (;;) {
      const { value, done } = await reader.read();
      if (done) break;
      if (file) writeAll(file, value, bytes);
      crc.add(value);
      bytes += value.byteLength;
      if (bytes - flushed > FLUSH_BYTES) {
        file?.flush();
        flushed = bytes;
      }
      progress(bytes);
    }
    file?.flush();
    return markOf(bytes, crc);
  } catch (error) {
    await reader.cancel(error).catch(() => undefined);
    throw error;
  } finally {
    file?.close();
  }
}

async function openSync(folder: FileSystemDirectoryHandle, name: string): Promise<SyncFile> {
  const handle = (await folder.getFileHandle(name, { create: true })) as Writable;
  return await handle.createSyncAccessHandle();
}

function ignoreMissing(error: unknown): void {
  if (asStorageError(error).code !== 'missing') throw error;
}

export class PrintStore {
  readonly #root: () => Promise<FileSystemDirectoryHandle>;
  readonly #free: () => Promise<number>;

  /** `free` says how many bytes may still be stored, as far as the browser tells. */
  constructor(
    root: () => Promise<FileSystemDirectoryHandle> = () => navigator.storage.getDirectory(),
    free: () => Promise<number> = freeBytes,
  ) {
    this.#root = root;
    this.#free = free;
  }

  #prints(): Promise<FileSystemDirectoryHandle> {
    return this.#root().then((root) => root.getDirectoryHandle(FOLDER, { create: true }));
  }

  async #folder(id: string, create = false): Promise<FileSystemDirectoryHandle> {
    if (!ID.test(id)) throw new StorageError('missing');
    return await (await this.#prints()).getDirectoryHandle(id, { create });
  }

  /** Opens a print for writing, new or again; the oldest of the others go where there are too many. */
  async openPrint(id: string): Promise<OpenPrint> {
    return await tried(async () => {
      const folder = await this.#folder(id, true);
      const print = new OpenPrint(folder, await openSync(folder, JOURNAL));
      await this.#tidy(id);
      return print;
    });
  }

  /** Whether a file of that size can be copied: better said before than half-way. */
  async hasRoomFor(bytes: number): Promise<boolean> {
    return (await this.#free()) >= bytes + SPARE_BYTES;
  }

  async #tidy(open: string): Promise<void> {
    const others = (await this.listPrints()).filter(({ id }) => id !== open);
    for (const { id } of others.slice(PRINTS_MAX - 1)) {
      // One that another tab writes stays.
      await this.remove(id).catch(() => undefined);
    }
  }

  /** The newest first. */
  async listPrints(): Promise<readonly StoredPrint[]> {
    return await tried(async () => {
      const found: StoredPrint[] = [];
      for await (const [id, entry] of (await this.#prints()).entries()) {
        if (entry.kind === 'directory') found.push(await describe(id, entry as FileSystemDirectoryHandle));
      }
      return found.sort((a, b) => b.changed.getTime() - a.changed.getTime());
    });
  }

  async readJournal(id: string): Promise<Uint8Array<ArrayBuffer>> {
    return await tried(async () => {
      const journal = await (await (await this.#folder(id)).getFileHandle(JOURNAL)).getFile();
      if (journal.size > JOURNAL_BYTES_MAX) throw new StorageError('too-long');
      return new Uint8Array(await journal.arrayBuffer());
    });
  }

  /** What was written down about the print. */
  async readAbout(id: string): Promise<Uint8Array<ArrayBuffer>> {
    return await tried(async () => {
      const about = await (await (await this.#folder(id)).getFileHandle(ABOUT)).getFile();
      if (about.size > ABOUT_BYTES_MAX) throw new StorageError('broken');
      return new Uint8Array(await about.arrayBuffer());
    });
  }

  /** The copy of the print's file, read through and found to be as it was; `incomplete` where there is none. */
  async openFile(id: string): Promise<File> {
    return await tried(async () => {
      const folder = await this.#folder(id);
      const mark = await markIn(folder);
      if (mark === null) throw new StorageError('incomplete');
      const file = await (await folder.getFileHandle(FILE)).getFile();
      if (mark !== (await markOfFile(file))) throw new StorageError('incomplete');
      return file;
    });
  }

  /** Whether a file is the print's, byte by byte, as far as that is known. */
  async isItsFile(id: string, file: Blob): Promise<boolean> {
    return await tried(async () => {
      const mark = await markIn(await this.#folder(id));
      return mark === null || mark === (await markOfFile(file));
    });
  }

  /** Nothing of it is left; it is no error where nothing was. */
  async remove(id: string): Promise<void> {
    if (!ID.test(id)) return;
    await tried(async () => (await this.#prints()).removeEntry(id, { recursive: true }).catch(ignoreMissing));
  }
}

/** What was written down of the copy once it was whole; else null. */
async function markIn(folder: FileSystemDirectoryHandle): Promise<string | null> {
  try {
    return await (await (await folder.getFileHandle(COMPLETE)).getFile()).text();
  } catch (error) {
    ignoreMissing(error);
    return null;
  }
}

/** The size of the copy where it is whole, else null. */
async function copiedBytes(folder: FileSystemDirectoryHandle): Promise<number | null> {
  const mark = await markIn(folder);
  if (mark === null) return null;
  try {
    const { size } = await (await folder.getFileHandle(FILE)).getFile();
    return mark.startsWith(`${size} `) ? size : null;
  } catch (error) {
    ignoreMissing(error);
    return null;
  }
}

async function describe(id: string, folder: FileSystemDirectoryHandle): Promise<StoredPrint> {
  let [journalBytes, changed] = [0, new Date(0)];
  try {
    const journal = await (await folder.getFileHandle(JOURNAL)).getFile();
    [journalBytes, changed] = [journal.size, new Date(journal.lastModified)];
  } catch (error) {
    ignoreMissing(error);
  }
  return { id, journalBytes, fileBytes: await copiedBytes(folder), changed };
}

async function freeBytes(): Promise<number> {
  const { quota, usage } = await navigator.storage.estimate();
  return quota === undefined || usage === undefined ? Number.POSITIVE_INFINITY : quota - usage;
}
