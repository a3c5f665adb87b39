// The text of a packed file, kept unpacked while it is read, so that any line of it is found as quickly as in a plain one. In
// blobs, which the browser puts on disk where they are large. Bounded: beyond that nothing is kept. Knows no lines.

/** More of it is not kept. */
export const UNPACKED_BYTES_MAX = 2 ** 31;
/** Chunks are put together to parts of this size. */
const PART_BYTES = 4 << 20;

export class Unpacked {
  readonly #bytesMax: number;
  #parts: Blob[] = [];
  #chunks: Uint8Array<ArrayBuffer>[] = [];
  #open = 0;
  #bytes = 0;

  constructor(bytesMax = UNPACKED_BYTES_MAX) {
    this.#bytesMax = bytesMax;
  }

  /** It has become too large to be kept. */
  get isGivenUp(): boolean {
    return this.#bytes > this.#bytesMax;
  }

  /** The next bytes; they are not to be changed afterwards. */
  add(chunk: Uint8Array<ArrayBuffer>): void {
    this.#bytes += chunk.byteLength;
    if (this.isGivenUp) {
      this.#parts = [];
      this.#chunks = [];
      return;
    }
    this.#chunks.push(chunk);
    this.#open += chunk.byteLength;
    if (this.#open >= PART_BYTES) this.#close();
  }

  /** All that has been added; null where it was too much. */
  text(): Blob | null {
    if (this.isGivenUp) return null;
    this.#close();
    return new Blob(this.#parts);
  }

  #close(): void {
    if (this.#open > 0) this.#parts.push(new Blob(this.#chunks));
    this.#chunks = [];
    this.#open = 0;
  }
}
