// Hands a job's file to the session as fast as it wants it, reading ahead a bounded amount.
// Knows nothing of time or ports.
import { FileChunks } from '../files';
import type { Session } from './session';

/** Chunks read ahead of the session. */
const AHEAD_CHUNKS_MAX = 4;

export class Feeder {
  readonly #chunks: FileChunks;
  readonly #session: Session;
  readonly #waiting: Uint8Array<ArrayBuffer>[] = [];
  #ended = false;
  #told = false;
  #reading: Promise<void> | undefined;
  #failure: unknown;

  private constructor(chunks: FileChunks, session: Session) {
    this.#chunks = chunks;
    this.#session = session;
  }

  static async open(file: Blob, session: Session): Promise<Feeder> {
    const feeder = new Feeder(await FileChunks.open(file), session);
    await feeder.refill();
    return feeder;
  }

  /** Set once the file could not be read to its end. */
  get failure(): unknown {
    return this.#failure;
  }

  /**
   * Feeds what is wanted and there. True when the session has something new to work on. Nothing is fed of a file that
   * broke off, and its end is not told: the session would take half a line for a whole one.
   */
  feed(): boolean {
    let fed = false;
    if (this.#failure !== undefined) return fed;
    for (let wants = this.#session.jobWants(); wants > 0 && !this.#told; wants = this.#session.jobWants()) {
      const chunk = this.#waiting[0];
      if (!chunk) {
        if (!this.#ended) break;
        this.#session.jobEnd();
        this.#told = true;
        return true;
      }
      const piece = chunk.subarray(0, wants);
      this.#session.jobFeed(piece);
      fed = true;
      if (piece.byteLength === chunk.byteLength) this.#waiting.shift();
      else this.#waiting[0] = chunk.subarray(piece.byteLength);
    }
    if (this.#waiting.length < AHEAD_CHUNKS_MAX && !this.#ended) void this.refill();
    return fed;
  }

  /** How much of the file itself (packed, where it is) has been read. */
  get bytesRead(): number {
    return this.#chunks.bytesRead;
  }

  /** Whether the session wants bytes that are not here yet: time must not pass for it meanwhile. */
  get isBehind(): boolean {
    return !this.#ended && this.#waiting.length === 0 && this.#session.jobWants() > 0;
  }

  /** Reads ahead. Never rejects: a failure ends the file and is told by `failure`. */
  refill(): Promise<void> {
    this.#reading ??= this.#read().finally(() => {
      this.#reading = undefined;
    });
    return this.#reading;
  }

  async #read(): Promise<void> {
    try {
      while (this.#waiting.length < AHEAD_CHUNKS_MAX && !this.#ended) {
        const chunk = await this.#chunks.next();
        if (chunk) this.#waiting.push(chunk);
        else this.#ended = true;
      }
    } catch (error) {
      this.#failure = error ?? new Error('no reason was given');
      this.#ended = true;
    }
  }

  async close(): Promise<void> {
    this.#ended = true;
    this.#waiting.length = 0;
    await this.#chunks.cancel();
  }
}
