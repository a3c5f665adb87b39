// The prints that the worker keeps, so that they can be gone on with after the page is gone: each with its journal, what
// is to be known about it, and a copy of its file. Whatever fails here is told and stops no print.
//
// Knows no port and no session; what a journal says, the planner reads.
import type { PortId } from '../transport/web_serial';
import type { Ending } from './machine';
import { type KeptPrint, type PrintFacts, type PrintStart, type Trouble, WHOLE } from './protocol';
import type { JournalSummary } from './session';
import { type OpenPrint, PRINTS_MAX, type PrintStore, StorageError } from './storage';
import { copyMissing, otherFile, storageTrouble } from './troubles';

/** Numbers from a print's own on belong to it. */
const NUMBERS_PER_PRINT = 2 ** 20;
const NUMBERS_MAX = 2 ** 32;

/** What is written down when a print begins. */
export interface About {
  readonly facts: PrintFacts;
  readonly machine: { readonly name: string; readonly config: string };
  readonly port: PortId;
  readonly fileBytes: number;
  readonly start: PrintStart;
  /** The interrupted print that it goes on with. */
  readonly continues: string | null;
  /** Another print has gone on with it and was given up: it is offered no more, and kept for a board that may hold it. */
  readonly isOvertaken?: boolean;
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

interface Listed {
  readonly print: KeptPrint;
  readonly continues: string | null;
  readonly isOvertaken: boolean;
}

const encoder = new TextEncoder();
const NONE: Pick<About, 'start' | 'continues'> = { start: WHOLE, continues: null };

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
  /** Of the print that it goes on with: its copy of the file may be what is printed. */
  readonly letGoOther: (() => void) | null;
}

/** The journal of the print that runs, and the copy of its file. Never throws. */
export class PrintLog {
  readonly id: string;
  readonly number: number;
  /** The interrupted print that it goes on with. */
  readonly continues: string | null;
  readonly #open: OpenPrint;
  readonly #letGo: () => void;
  readonly #tell: Tell;
  #isOver = false;
  #copying: Promise<void> = Promise.resolve();
  readonly #closing = new AbortController();

  constructor(
    id: string,
    number: number,
    { open, letGo, letGoOther }: Opened,
    tell: Tell,
    continues: string | null,
  ) {
    this.id = id;
    this.number = number;
    this.continues = continues;
    this.#open = open;
    this.#letGo = () => {
      letGo();
      letGoOther?.();
    };
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
      opened = await this.#open(id, about.continues);
      await opened.open.describe(encoder.encode(JSON.stringify(about)));
      return new PrintLog(id, number, opened, tell, about.continues);
    } catch (error) {
      opened?.open.close();
      opened?.letGo();
      opened?.letGoOther?.();
      tell(troubleOf(error));
      return null;
    }
  }

  async #open(id: string, continues: string | null): Promise<Opened> {
    const letGo = await this.#locks.hold(id);
    if (!letGo) throw new StorageError('in-use');
    const letGoOther = continues === null ? null : await this.#locks.hold(continues);
    try {
      return { open: await this.#store.openPrint(id), letGo, letGoOther };
    } catch (error) {
      letGo();
      letGoOther?.();
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

  /** A print is over for this page: what has come to its end is not kept, and neither is what has not got anywhere. What it
   * went on with goes with one that is done; where it got nowhere, that can be gone on with again. */
  async settle(log: PrintLog, ending: Ending): Promise<void> {
    await log.close();
    const summary = await this.#summary(log.id);
    const hasBegun = summary !== null && summary.line > 0;
    const isOver = ending === 'done' || ending === 'over' || summary?.hasEnded;
    if (!isOver && (ending === 'left' || hasBegun)) return;
    if (ending === 'done' && hasBegun) await this.discard(log.id);
    else await this.#putAway(log.id, hasBegun ? log.continues : null);
  }

  /** Nothing more comes of it. What it had gone on with may still be held by a board, if that is another one. */
  async #putAway(id: string, overtaken: string | null): Promise<void> {
    if (overtaken !== null) await this.#overtake(overtaken);
    await this.forget(id);
  }

  /** Begun where it was interrupted it would run into what has been printed since. */
  async #overtake(id: string): Promise<void> {
    try {
      await this.#mark(id, { ...(await this.#about(id)), isOvertaken: true });
    } catch {
      // It is gone, or another tab has taken it up: that one knows better.
    }
  }

  async #mark(id: string, about: About): Promise<void> {
    const { open, letGo } = await this.#open(id, null);
    try {
      await open.describe(encoder.encode(JSON.stringify(about)));
    } finally {
      open.close();
      letGo();
    }
  }

  /** Prints that were interrupted, the newest first. Those that have ended are put away. Empty where nothing can be read. */
  async list(): Promise<readonly KeptPrint[]> {
    const found: Listed[] = [];
    /** Prints that were gone on with and got further by that, and when that was last heard of. */
    const overtaken = new Map<string, number>();
    try {
      const prints = await this.#store.listPrints();
      // Asked after that: whoever begins a print has its lock first.
      const busy = await this.#locks.held();
      for (const { id, changed, journalBytes } of prints) {
        if (busy.has(id)) continue;
        const summary = await this.#summary(id);
        // One that cannot be read does not hide the others.
        const one = summary && (await this.#listed(id, summary, changed).catch(() => null));
        const hasGotFurther = one && summary.line > 0 ? one.continues : null;
        if (one && hasGotFurther !== null) overtaken.set(hasGotFurther, one.print.heardOf);
        if (journalBytes === 0 || summary?.hasEnded) await this.#putAway(id, hasGotFurther);
        else if (one) found.push(one);
      }
    } catch {
      // Where nothing can be read nothing is offered; a print that begins says so.
    }
    const left = found.filter(
      ({ print, isOvertaken }) => !isOvertaken && !((overtaken.get(print.id) ?? -1) >= print.heardOf),
    );
    // One that never got anywhere says less than the one that it was to go on with.
    const isIdle = ({ print, continues }: Listed): boolean =>
      print.line === 0 && left.some((other) => other.print.id === continues);
    return left.filter((one) => !isIdle(one)).map(({ print }) => print);
  }

  async #listed(id: string, { line, elapsed }: JournalSummary, changed: Date): Promise<Listed> {
    const { facts, machine, port, fileBytes, start, continues, isOvertaken = false } = await this.#about(id);
    const { line: startLine, confirmedLines } = start;
    const heardOf = changed.getTime();
    const print = { id, facts, machine, port, fileBytes, line, startLine, elapsed, confirmedLines, heardOf };
    return { print, continues, isOvertaken };
  }

  async #about(id: string): Promise<About> {
    // Written by this page's own code; one that was torn off cannot be parsed.
    const about = JSON.parse(new TextDecoder().decode(await this.#store.readAbout(id))) as About;
    // One that an earlier version of the page wrote does not say how it was begun.
    return { ...NONE, ...about };
  }

  /** The print whose journal knows the number under which the board holds one. Rejects where nothing can be read. */
  async find(held: number): Promise<Found | null> {
    for (const { id, changed } of await this.#store.listPrints()) {
      const journal = await this.#store.readJournal(id).catch(() => null);
      const summary = journal && this.#read(journal, held);
      if (!journal || !summary?.isHeld) continue;
      const { number, readableBytes } = summary;
      const { print } = await this.#listed(id, summary, changed);
      return { print, number, journal, readableBytes };
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

  /** The file of a print that is kept: its copy, null without one, or the one that the user has given, where that is it. */
  async fileOf(id: string, given: Blob | null): Promise<Blob | Trouble | null> {
    try {
      const { facts, fileBytes } = await this.#about(id);
      if (given === null) return await this.#store.openFile(id).catch(() => null);
      const isIts = given.size === fileBytes && (await this.#store.isItsFile(id, given));
      return isIts ? given : otherFile(facts.name);
    } catch (error) {
      return troubleOf(error);
    }
  }

  /** The journal of a print, and the machine's file as it was then. Rejects where they cannot be read. */
  async recordOf(id: string): Promise<{ readonly journal: Uint8Array; readonly config: string }> {
    const { machine } = await this.#about(id);
    return { journal: await this.#store.readJournal(id), config: machine.config };
  }

  /** Whether a file from the user can be the print's. Rejects where nothing can be read. */
  async isItsFile({ id, fileBytes }: KeptPrint, file: Blob): Promise<boolean> {
    return file.size === fileBytes && (await this.#store.isItsFile(id, file));
  }

  /** Opens a record again, to be added to. Rejects where another tab has it. */
  async reopen({ print, number, readableBytes }: Found, tell: Tell): Promise<PrintLog> {
    const about = await this.#about(print.id);
    const { continues } = about;
    if (about.isOvertaken) await this.#mark(print.id, { ...about, isOvertaken: false });
    const opened = await this.#open(print.id, continues);
    opened.open.keepJournal(readableBytes);
    return new PrintLog(print.id, number, opened, tell, continues);
  }

  /** The print is done, or the user wants nothing of it kept: neither is what it went on with. */
  async discard(id: string): Promise<void> {
    // No longer than there can be prints: nobody says that what was written is no circle.
    let next: string | null = id;
    for (let count = 0; next !== null && count < PRINTS_MAX; count += 1) {
      const about: About | null = await this.#about(next).catch(() => null);
      await this.forget(next);
      next = about?.continues ?? null;
    }
  }

  async forget(id: string): Promise<void> {
    try {
      await this.#store.remove(id);
    } catch {
      // Another tab has it open, or nothing can be written: it is tried again with the next list.
    }
  }
}
