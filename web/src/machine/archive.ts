// The prints that the worker keeps, so that they can be gone on with after the page is gone: each with its journal, what
// is to be known about it, and a copy of its file. Whatever fails here is told and stops no print.
//
// Knows no port and no session; what a journal says, the planner reads.
import type { PortId } from '../transport/web_serial';
import type { KeptPrint, PrintFacts, Trouble } from './protocol';
import type { JournalSummary } from './session';
import { type OpenPrint, type PrintStore, StorageError } from './storage';
import { copyMissing, storageTrouble } from './troubles';

/** Numbers from a print's own on belong to it. */
const NUMBERS_PER_PRINT = 2 ** 20;
const NUMBERS_MAX = 2 ** 32;

/** What is written down when a print begins. */
export interface About {
  readonly facts: PrintFacts;
  readonly machine: { readonly name: string; readonly config: string };
  readonly port: PortId;
  readonly fileBytes: number;
}

/** Who has which print open, among all tabs. */
export interface PrintLocks {
  /** Lets go again; null where another has it. */
  hold(id: string): Promise<(() => void) | null>;
  held(): Promise<ReadonlySet<string>>;
}

const LOCK = 'stepcast-print:';

export const webLocks: PrintLocks = {
  hold: (id) =>
    new Promise((resolve, reject) => {
      const keep = (lock: Lock | null): Promise<void> | undefined => {
        if (lock) return new Promise<void>((release) => resolve(release));
        resolve(null);
        return undefined;
      };
      navigator.locks.request(`${LOCK}${id}`, { ifAvailable: true }, keep).catch(reject);
    }),
  held: async () => {
    const names = ((await navigator.locks.query()).held ?? []).map(({ name = '' }) => name);
    return new Set(names.flatMap((name) => (name.startsWith(LOCK) ? [name.slice(LOCK.length)] : [])));
  },
};

export type ReadJournal = (journal: Uint8Array, held: number | null) => JournalSummary | null;
export type Tell = (trouble: Trouble) => void;

/** A print that a board holds, as it was found. */
export interface Found {
  readonly print: KeptPrint;
  readonly number: number;
  readonly journal: Uint8Array;
  readonly readableBytes: number;
}

const encoder = new TextEncoder();
/** One print that cannot be read does not hide the others. */
const nothing = (): [] => [];

/** Whatever was thrown: what cannot be kept must not stop a print. */
const asStorageError = (error: unknown): StorageError =>
  error instanceof StorageError ? error : new StorageError('broken', error);

/** In words, for the user. */
export function troubleOf(error: unknown): Trouble {
  const { code, cause } = asStorageError(error);
  return storageTrouble(code, cause ?? code);
}

/** A print that this tab alone writes. */
interface Opened {
  readonly open: OpenPrint;
  readonly letGo: () => void;
}

/** The journal of the print that runs, and the copy of its file. Never throws. */
export class PrintLog {
  readonly id: string;
  readonly number: number;
  readonly #open: OpenPrint;
  readonly #letGo: () => void;
  readonly #tell: Tell;
  #isOver = false;
  #copying: Promise<void> = Promise.resolve();
  readonly #closing = new AbortController();

  constructor(id: string, number: number, { open, letGo }: Opened, tell: Tell) {
    this.id = id;
    this.number = number;
    this.#open = open;
    this.#letGo = letGo;
    this.#tell = tell;
  }

  /** On the disk when it returns. After a failure nothing is added any more: a journal with a gap says what is not so. */
  append(text: string): void {
    if (this.#isOver) return;
    try {
      this.#open.appendJournal(encoder.encode(text));
    } catch (error) {
      this.#isOver = true;
      this.#open.close();
      this.#tell(troubleOf(error));
    }
  }

  /** Copies the file alongside. */
  copy(file: Blob, hasRoom: Promise<boolean>): void {
    this.#copying = this.#copy(file, hasRoom).catch((error: unknown) => {
      if (!this.#isOver) this.#tell(copyMissing(asStorageError(error).code));
    });
  }

  async #copy(file: Blob, hasRoom: Promise<boolean>): Promise<void> {
    try {
      if (!(await hasRoom.catch(() => true))) throw new StorageError('full');
      await this.#open.copyFile(this.#read(file));
    } catch (error) {
      if (this.#isOver) return;
      // The file will have to be given again: then it is known again, at least.
      await this.#open.markFile(this.#read(file));
      throw error;
    }
  }

  /** Breaks off when the record is closed, even where the file is just not to be had. */
  #read(file: Blob): ReadableStream<Uint8Array> {
    const { signal } = this.#closing;
    return file.stream().pipeThrough(new TransformStream<Uint8Array, Uint8Array>(), { signal });
  }

  /** Settles once nothing of it is open any more. */
  async close(): Promise<void> {
    this.#isOver = true;
    this.#closing.abort();
    this.#open.close();
    await this.#copying;
    this.#letGo();
  }
}

export class Archive {
  readonly #store: PrintStore;
  readonly #read: ReadJournal;
  readonly #locks: PrintLocks;

  constructor(store: PrintStore, read: ReadJournal, locks = webLocks) {
    this.#store = store;
    this.#read = read;
    this.#locks = locks;
  }

  /** Opens the record of a print that is about to begin; null where that cannot be, which is told. */
  async begin(about: About, tell: Tell): Promise<PrintLog | null> {
    const id = crypto.randomUUID();
    let opened: Opened | undefined;
    try {
      const number = await this.#number();
      opened = await this.#open(id);
      await opened.open.describe(encoder.encode(JSON.stringify(about)));
      return new PrintLog(id, number, opened, tell);
    } catch (error) {
      opened?.open.close();
      opened?.letGo();
      tell(troubleOf(error));
      return null;
    }
  }

  async #open(id: string): Promise<Opened> {
    const letGo = await this.#locks.hold(id);
    if (!letGo) throw new StorageError('in-use');
    try {
      return { open: await this.#store.openPrint(id), letGo };
    } catch (error) {
      letGo();
      throw error;
    }
  }

  /** A number of its own, far enough from those of all prints that are kept. */
  async #number(): Promise<number> {
    const taken: number[] = [];
    for (const { id } of await this.#store.listPrints()) {
      const summary = await this.#summary(id);
      if (summary) taken.push(summary.number);
    }
    for (;;) {
      const [number = 0] = crypto.getRandomValues(new Uint32Array(1));
      const isOwn = taken.every((other) => Math.abs(other - number) > NUMBERS_PER_PRINT);
      if (number > 0 && number < NUMBERS_MAX - NUMBERS_PER_PRINT && isOwn) return number;
    }
  }

  async #summary(id: string, held: number | null = null): Promise<JournalSummary | null> {
    return await this.#store.readJournal(id).then(
      (journal) => this.#read(journal, held),
      () => null,
    );
  }

  /** Has the file of a print copied beside it. */
  copy(log: PrintLog, file: Blob): void {
    log.copy(file, this.#store.hasRoomFor(file.size));
  }

  /** A print is over for this page: what has come to its end is not kept. `isLost`: the board has nothing of it any more. */
  async settle(log: PrintLog, isLost: boolean): Promise<void> {
    await log.close();
    if (isLost || (await this.#summary(log.id))?.hasEnded) await this.forget(log.id);
  }

  /** Prints that were interrupted, the newest first. Those that have ended are put away. Empty where nothing can be read. */
  async list(): Promise<readonly KeptPrint[]> {
    const found: KeptPrint[] = [];
    try {
      const prints = await this.#store.listPrints();
      // Asked after that: whoever begins a print has its lock first.
      const busy = await this.#locks.held();
      for (const { id, changed, journalBytes } of prints) {
        if (busy.has(id)) continue;
        const summary = await this.#summary(id);
        if (journalBytes === 0 || summary?.hasEnded) await this.forget(id);
        else if (summary)
          found.push(...(await this.#kept(id, summary, changed).then((one) => [one], nothing)));
      }
    } catch {
      // Where nothing can be read nothing is offered; a print that begins says so.
    }
    return found;
  }

  async #kept(id: string, { line, elapsed }: JournalSummary, changed: Date): Promise<KeptPrint> {
    const { facts, machine, port, fileBytes } = await this.#about(id);
    return { id, facts, machine, port, fileBytes, line, elapsed, heardOf: changed.getTime() };
  }

  async #about(id: string): Promise<About> {
    // Written by this page's own code; one that was torn off cannot be parsed.
    return JSON.parse(new TextDecoder().decode(await this.#store.readAbout(id))) as About;
  }

  /** The print whose journal knows the number under which the board holds one. Rejects where nothing can be read. */
  async find(held: number): Promise<Found | null> {
    for (const { id, changed } of await this.#store.listPrints()) {
      const journal = await this.#store.readJournal(id).catch(() => null);
      const summary = journal && this.#read(journal, held);
      if (!journal || !summary?.isHeld) continue;
      const { number, readableBytes } = summary;
      return { print: await this.#kept(id, summary, changed), number, journal, readableBytes };
    }
    return null;
  }

  /** The whole copy of a print's file; null where there is none. */
  async openFile({ id }: KeptPrint): Promise<Blob | null> {
    try {
      return await this.#store.openFile(id);
    } catch {
      return null;
    }
  }

  /** Whether a file from the user can be the print's. Rejects where nothing can be read. */
  async isItsFile({ id, fileBytes }: KeptPrint, file: Blob): Promise<boolean> {
    return file.size === fileBytes && (await this.#store.isItsFile(id, file));
  }

  /** Opens a record again, to be added to. Rejects where another tab has it. */
  async reopen({ print, number, readableBytes }: Found, tell: Tell): Promise<PrintLog> {
    const opened = await this.#open(print.id);
    opened.open.keepJournal(readableBytes);
    return new PrintLog(print.id, number, opened, tell);
  }

  async forget(id: string): Promise<void> {
    try {
      await this.#store.remove(id);
    } catch {
      // Another tab has it open, or nothing can be written: it is tried again with the next list.
    }
  }
}
