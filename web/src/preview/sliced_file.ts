// A file from front to back at full speed: in large pieces, the next of which is fetched while one is worked on, where a
// stream comes in pieces of 64 KiB, each waited for. Bounded: two pieces. Knows nothing of packing or of what is read.

/** The first pieces are small, so that something is soon there. */
const PIECE_BYTES_MIN = 64 * 1024;
const PIECE_BYTES_MAX = 1024 * 1024;
const GROWTH = 4;

export class SlicedFile {
  readonly #file: Blob;
  #read = 0;
  #asked = 0;
  #pieceBytes = PIECE_BYTES_MIN;
  #coming: Promise<ArrayBuffer>;

  constructor(file: Blob) {
    this.#file = file;
    this.#coming = this.#fetch();
  }

  /** How much has been handed out. */
  get bytesRead(): number {
    return this.#read;
  }

  /** The next bytes, or undefined at the end. Rejects where the file cannot be read. */
  async next(): Promise<Uint8Array<ArrayBuffer> | undefined> {
    const piece = await this.#coming;
    if (piece.byteLength === 0) return undefined;
    this.#read += piece.byteLength;
    this.#pieceBytes = Math.min(this.#pieceBytes * GROWTH, PIECE_BYTES_MAX);
    this.#coming = this.#fetch();
    return new Uint8Array(piece);
  }

  #fetch(): Promise<ArrayBuffer> {
    const from = this.#asked;
    this.#asked = Math.min(from + this.#pieceBytes, this.#file.size);
    const piece = this.#file.slice(from, this.#asked).arrayBuffer();
    // It is told to who asks for the piece; one that stops reading never does.
    piece.catch(() => undefined);
    return piece;
  }
}
