// A board that holds a print whose page is gone: the print is looked for among those that are kept, and its plan is made
// again up to where the board is. That moves nothing; what moves is for the user to say.
//
// Knows neither ports nor how prints are stored.
import { share } from '../units';
import { type Archive, type Found, type PrintLog, troubleOf } from './archive';
import type { Machine } from './machine';
import type { HeldPrint, KeptPrint, MachineEvent, Trouble } from './protocol';
import { otherFile } from './troubles';

const REFUSED = 'continuation-refused';

export interface Holder {
  readonly machine: Machine;
  readonly archive: Archive;
  readonly tell: (held: HeldPrint | null) => void;
  readonly tellNotKept: (trouble: Trouble) => void;
  /** The print is this session's job. */
  readonly onTakenUp: (print: KeptPrint) => void;
  /** There is something to be done at once. */
  readonly tick: () => void;
}

export class Continuation {
  readonly #of: Holder;
  #held: HeldPrint | null = null;
  #found: Found | null = null;
  #file: Blob | null = null;
  /** The record that gets a copy of that file once the file has proved to be the right one. */
  #lacksCopy: PrintLog | null = null;
  /** Of what is done now; what was begun before it is of no interest any more. */
  #round = 0;
  /** One thing after the other: a record can be opened again only when it has been closed. */
  #last: Promise<void> = Promise.resolve();

  constructor(of: Holder) {
    this.#of = of;
  }

  #put(held: HeldPrint | null): void {
    this.#held = held;
    this.#of.tell(held);
  }

  /** Something happened to the machine. */
  note(event: MachineEvent): void {
    if (event.kind === 'phase') this.#onPhase(event.phase);
    else if (event.kind === 'trouble') this.#onTrouble(event.trouble);
    else if (event.kind === 'resumed' || event.kind === 'cancelled' || event.kind === 'done') this.#end();
  }

  #onPhase(phase: string): void {
    const held = this.#held;
    if (phase === 'holding') {
      if (held === null) this.#next((round) => this.#look(round));
    } else if (phase === 'ready' && held?.kind === 'finding' && this.#file) {
      if (this.#lacksCopy) this.#of.archive.copy(this.#lacksCopy, this.#file);
      this.#of.onTakenUp(held.print);
      this.#put({ kind: 'held', print: held.print, file: this.#file });
    } else if (held !== null) {
      const found = this.#found;
      this.#end();
      // Restarted at the user's word: of a print that had got nowhere nothing is left.
      if (phase === 'identifying' && found?.print.line === 0)
        this.#next(() => this.#of.archive.forget(found.print.id));
    }
  }

  #onTrouble(trouble: Trouble): void {
    if (this.#held?.kind !== 'finding') return;
    if (trouble.code === REFUSED || trouble.code === 'file-unreadable')
      this.#refuse(this.#held.print, trouble);
  }

  #refuse(print: KeptPrint, trouble: Trouble): void {
    this.#file = null;
    this.#lacksCopy = null;
    this.#of.machine.dropTakeUp();
    this.#put({ kind: 'refused', print, trouble });
  }

  #end(): void {
    if (this.#held === null) return;
    this.#found = null;
    this.#file = null;
    this.#lacksCopy = null;
    this.#round += 1;
    this.#put(null);
  }

  /** The connection is over: nothing is told any more. */
  stop(): void {
    this.#held = null;
    this.#round += 1;
  }

  #next(act: (round: number) => Promise<void>): void {
    this.#round += 1;
    const round = this.#round;
    this.#last = this.#last.then(() => (round === this.#round ? act(round) : undefined));
  }

  async #look(round: number): Promise<void> {
    const { machine, archive } = this.#of;
    const held = machine.heldPrint();
    if (held === null) return;
    this.#put({ kind: 'looking' });
    try {
      const found = await archive.find(held);
      if (round !== this.#round) return;
      if (!found) return this.#put({ kind: 'unknown', trouble: null });
      this.#found = found;
      const file = await archive.openFile(found.print);
      if (round !== this.#round) return;
      if (file) await this.#begin(found, file, round, true);
      else this.#put({ kind: 'needs-file', print: found.print, trouble: null });
    } catch (error) {
      if (round === this.#round) this.#put({ kind: 'unknown', trouble: troubleOf(error) });
    }
  }

  /** The file, from the user: where there is no copy, or what there is was refused. */
  give(file: Blob): void {
    const [held, found] = [this.#held, this.#found];
    if (!found || (held?.kind !== 'needs-file' && held?.kind !== 'refused')) return;
    this.#next(async (round) => {
      const isIts = await this.#of.archive.isItsFile(found.print, file).catch(() => false);
      if (round !== this.#round) return;
      const { print } = found;
      if (isIts) await this.#begin(found, file, round, false);
      else this.#put({ kind: 'needs-file', print, trouble: otherFile(print.facts.name) });
    });
  }

  async #begin(found: Found, file: Blob, round: number, isCopy: boolean): Promise<void> {
    const { machine, archive, tellNotKept, tick } = this.#of;
    const { print, journal } = found;
    let log: PrintLog;
    try {
      await machine.logClosed();
      log = await archive.reopen(found, tellNotKept);
    } catch (error) {
      if (round === this.#round) this.#put({ kind: 'refused', print, trouble: troubleOf(error) });
      return;
    }
    if (round !== this.#round) return await log.close();
    this.#file = file;
    this.#lacksCopy = isCopy ? null : log;
    this.#put({ kind: 'finding', print, share: share(0) });
    const trouble = await machine.takeUp(journal.subarray(0, found.readableBytes), file, log);
    if (trouble) await log.close();
    if (round !== this.#round) return;
    if (trouble) this.#refuse(print, trouble);
    else tick();
  }

  /** Tells how far it is; from time to time. */
  progress(): void {
    const held = this.#held;
    if (held?.kind !== 'finding') return;
    const { facts, line, fileBytes } = held.print;
    // The place is known by its line alone; lines are about equally long.
    const bytes = fileBytes * Math.min(1, line / Math.max(1, facts.lines));
    const done = Math.min(0.99, this.#of.machine.fileBytesRead / Math.max(1, bytes));
    if (done > held.share) this.#put({ ...held, share: share(done) });
  }
}
