// A connection as it is told to other tabs, and the one thing that they may ask for: the emergency stop. From worker to
// page directly: what the page of this tab does, or whether it does anything, does not matter.
//
// Knows neither ports nor sessions. Bounded: a view a quarter of a second, and one for whoever begins to watch.
import {
  CHANNEL,
  type FromDriver,
  type FromViewer,
  liveLock,
  type MachineView,
  type Outcome,
} from './broadcast_protocol';
import type { FromMachine, MachineEvent, PortChoice, PrintFacts, Snapshot, Trouble } from './protocol';

/** How often other tabs are told how things are, in ms. */
export const TELL_OTHERS_MS = 250;
/** Newcomers are answered at once, but not more often than this, in ms. */
const GREET_MS = 50;

export interface Driven {
  readonly id: string;
  readonly name: string;
  readonly port: PortChoice;
  /** The machine now; null where that cannot be said any more. */
  readonly look: () => Snapshot | null;
  readonly stop: () => Trouble | null;
}

/** What of a connection's news lasts until other tabs ask. */
class News {
  print: PrintFacts | null = null;
  outcome: Outcome | null = null;
  trouble: Trouble | null = null;
  #isPrinting = false;

  begins(print: PrintFacts): void {
    this.print = print;
    this.outcome = null;
  }

  happened(event: MachineEvent): void {
    if (event.kind === 'done' || event.kind === 'cancelled') this.outcome = event.kind;
    else if (event.kind === 'held' || event.kind === 'trouble') this.trouble = event.trouble;
    else if (event.kind === 'resumed' || (event.kind === 'phase' && event.phase === 'ready'))
      this.trouble = null;
  }

  look({ job, phase }: Snapshot): void {
    const isPrinting = job !== 'none' && phase === 'ready';
    // It ended without a word of how: in an error.
    if (this.#isPrinting && !isPrinting) this.outcome ??= 'stopped';
    if (isPrinting && !this.#isPrinting) this.outcome = null;
    this.#isPrinting = isPrinting;
  }
}

export class Broadcast {
  readonly #driven: Driven;
  readonly #news = new News();
  #channel: BroadcastChannel | undefined;
  #timer: ReturnType<typeof setInterval> | undefined;
  #toldAt = Number.NEGATIVE_INFINITY;
  #letGo: (() => void) | undefined;
  #isOver = false;

  constructor(driven: Driven) {
    this.#driven = driven;
    // Nobody is told of a machine before its lock is held: a viewer that gets the lock takes the machine for gone.
    navigator.locks
      .request(liveLock(driven.id), () => this.#live())
      .catch(() => {
        // Without locks no viewer could know when this tab is gone: then there are none.
      });
  }

  #live(): Promise<void> | undefined {
    if (this.#isOver) return undefined;
    const channel = new BroadcastChannel(CHANNEL);
    this.#channel = channel;
    channel.onmessage = ({ data }: MessageEvent<FromViewer>) => this.#take(data);
    this.#timer = setInterval(() => this.#tellView(), TELL_OTHERS_MS);
    this.#tellView();
    return new Promise((resolve) => {
      this.#letGo = resolve;
    });
  }

  #take(message: FromViewer): void {
    if (message.kind === 'hello') {
      if (performance.now() - this.#toldAt >= GREET_MS) this.#tellView();
    } else if (message.kind === 'stop' && message.id === this.#driven.id) {
      this.#tell({ kind: 'stopped', request: message.request, trouble: this.#driven.stop() });
    }
  }

  #tell(message: FromDriver): void {
    this.#channel?.postMessage(message);
  }

  #tellView(): void {
    const { id, name, port, look } = this.#driven;
    const snapshot = look();
    if (!snapshot) return;
    this.#toldAt = performance.now();
    this.#news.look(snapshot);
    const { print, outcome, trouble } = this.#news;
    const view: MachineView = { id, name, port, snapshot, print, outcome, trouble };
    this.#tell({ kind: 'view', view });
  }

  /** What the page of this tab is told, too. */
  note(message: FromMachine): void {
    if (message.kind === 'events') for (const event of message.events) this.#news.happened(event);
  }

  /** A print was begun. */
  begins(print: PrintFacts): void {
    this.#news.begins(print);
  }

  /** The connection is over. */
  end(trouble: Trouble | null): void {
    if (this.#isOver) return;
    this.#isOver = true;
    clearInterval(this.#timer);
    this.#tell({ kind: 'bye', id: this.#driven.id, trouble });
    this.#channel?.close();
    this.#channel = undefined;
    this.#letGo?.();
  }
}
