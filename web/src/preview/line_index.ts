// Where the lines of a file begin, sparsely: every some thousand lines the offset of one, so that any line is found by
// reading a few tens of kilobytes. Bounded for any file: when the list is full, every second offset goes. Knows no G-code.

/** Lines from one remembered offset to the next, at first. */
const STRIDE_MIN = 1024;
/** Offsets kept at most. */
const OFFSETS_MAX = 1 << 16;
const NEW_LINE = 10;
const NEW_LINES = 0x0a0a_0a0a;
const LOW_BITS = 0x7f7f_7f7f;
const WORD_BYTES = 4;
const NO_WORDS = new Int32Array();

export interface LinePlace {
  /** Counted from 1. */
  readonly line: number;
  /** In bytes, of the line's first one. */
  readonly offset: number;
}

export class LineIndex {
  readonly #offsetsMax: number;
  #stride: number;
  /** Of lines 1, 1 + stride, 1 + 2 stride … */
  #offsets: Float64Array<ArrayBuffer>;
  #used = 1;
  /** Ends of lines that have been seen. */
  #ends = 0;
  #bytes = 0;
  #isLastOpen = false;

  constructor(strideMin = STRIDE_MIN, offsetsMax = OFFSETS_MAX) {
    this.#stride = strideMin;
    this.#offsetsMax = Math.max(2, offsetsMax);
    this.#offsets = new Float64Array(Math.min(256, this.#offsetsMax));
  }

  /** Lines that have been seen, the one that is not yet ended among them. */
  get lines(): number {
    return this.#ends + (this.#isLastOpen ? 1 : 0);
  }

  /** The next bytes of the file. */
  add(chunk: Uint8Array): void {
    // Four bytes at once, for each of the file's comes by here: a search from one line's end to the next takes as long as a
    // quarter of the reading.
    const first = Math.min(-chunk.byteOffset & (WORD_BYTES - 1), chunk.byteLength);
    const count = (chunk.byteLength - first) >> 2;
    const words = count === 0 ? NO_WORDS : new Int32Array(chunk.buffer, chunk.byteOffset + first, count);
    this.#addBytes(chunk, 0, first);
    let ends = this.#ends;
    let next = this.#used * this.#stride;
    for (let at = 0; at < words.length; at += 1) {
      const other = (words[at] ?? 0) ^ NEW_LINES;
      // The highest bit of each byte that is one.
      let found = ~(((other & LOW_BITS) + LOW_BITS) | other | LOW_BITS);
      if (found === 0) continue;
      if (ends + WORD_BYTES >= next) {
        this.#ends = ends;
        this.#addBytes(chunk, first + at * WORD_BYTES, first + (at + 1) * WORD_BYTES);
        ends = this.#ends;
        next = this.#used * this.#stride;
        continue;
      }
      for (; found !== 0; found &= found - 1) ends += 1;
    }
    this.#ends = ends;
    this.#addBytes(chunk, first + words.length * WORD_BYTES, chunk.byteLength);
    if (chunk.byteLength > 0) this.#isLastOpen = chunk[chunk.byteLength - 1] !== NEW_LINE;
    this.#bytes += chunk.byteLength;
  }

  /** One after the other. */
  #addBytes(chunk: Uint8Array, from: number, to: number): void {
    for (let at = from; at < to; at += 1) {
      if (chunk[at] !== NEW_LINE) continue;
      this.#ends += 1;
      if (this.#ends === this.#used * this.#stride) this.#keep(this.#bytes + at + 1);
    }
  }

  /** The nearest line at or before this one whose place is known. */
  before(line: number): LinePlace {
    const at = Math.min(Math.max(Math.floor((line - 1) / this.#stride), 0), this.#used - 1);
    return { line: 1 + at * this.#stride, offset: this.#offsets[at] ?? 0 };
  }

  #keep(offset: number): void {
    if (this.#used === this.#offsetsMax) {
      for (let at = 0; 2 * at < this.#used; at += 1) this.#offsets[at] = this.#offsets[2 * at] ?? 0;
      this.#used = Math.ceil(this.#used / 2);
      this.#stride *= 2;
      if (this.#ends !== this.#used * this.#stride) return;
    }
    if (this.#used === this.#offsets.length) {
      const larger = new Float64Array(Math.min(this.#offsets.length * 2, this.#offsetsMax));
      larger.set(this.#offsets);
      this.#offsets = larger;
    }
    this.#offsets[this.#used] = offset;
    this.#used += 1;
  }
}
