// A file's bytes in chunks of bounded size, unpacked where it is gzip. Never the whole file, never as a string: V8's
// strings end at 512 MiB. Knows nothing of G-code.

/** What one chunk holds at most. */
export const CHUNK_BYTES_MAX = 256 * 1024;
const GZIP = [0x1f, 0x8b] as const;

export type Packing = 'plain' | 'gzip';

export async function packingOf(file: Blob): Promise<Packing> {
  const start = new Uint8Array(await file.slice(0, GZIP.length).arrayBuffer());
  return GZIP.every((byte, index) => start[index] === byte) ? 'gzip' : 'plain';
}

/** Reads a file from front to back. */
export class FileChunks {
  readonly #reader: ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>>;
  readonly #count: { bytes: number };
  #rest: Uint8Array<ArrayBuffer> = new Uint8Array();

  private constructor(
    reader: ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>>,
    count: { bytes: number },
  ) {
    this.#reader = reader;
    this.#count = count;
  }

  /** `packing` is what the file is; without it its first bytes say so. */
  static async open(file: Blob, packing?: Packing): Promise<FileChunks> {
    const count = { bytes: 0 };
    const counted = file.stream().pipeThrough(
      new TransformStream<Uint8Array<ArrayBuffer>, Uint8Array<ArrayBuffer>>({
        transform(chunk, controller) {
          count.bytes += chunk.byteLength;
          controller.enqueue(chunk);
        },
      }),
    );
    const isPacked = (packing ?? (await packingOf(file))) === 'gzip';
    const unpacked = isPacked ? counted.pipeThrough(new DecompressionStream('gzip')) : counted;
    return new FileChunks(unpacked.getReader(), count);
  }

  /** How much of the file itself (packed, where it is) has been read. */
  get bytesRead(): number {
    return this.#count.bytes;
  }

  /** The next bytes, or undefined at the end. Rejects where the file cannot be read. */
  async next(): Promise<Uint8Array<ArrayBuffer> | undefined> {
    while (this.#rest.byteLength === 0) {
      const { value, done } = await this.#reader.read();
      if (done) return undefined;
      this.#rest = value;
    }
    const chunk = this.#rest.subarray(0, CHUNK_BYTES_MAX);
    this.#rest = this.#rest.subarray(chunk.byteLength);
    return chunk;
  }

  async cancel(): Promise<void> {
    await this.#reader.cancel().catch(() => undefined);
  }
}

/** Longer lines are cut: they are to be looked at. */
const LINE_CHARACTERS_MAX = 120;
/** Four bytes make a character at most. */
const LINE_BYTES_MAX = 4 * LINE_CHARACTERS_MAX;
const NEW_LINE = 10;

/** Picks some lines out of bytes that come in pieces. */
class LinePicker {
  readonly texts: string[] = [];
  readonly #first: number;
  readonly #last: number;
  #line = 1;
  /** Of the line that is being read. */
  #bytes: number[] = [];

  constructor(first: number, last: number) {
    this.#first = first;
    this.#last = last;
  }

  get isDone(): boolean {
    return this.#line > this.#last;
  }

  take(chunk: Uint8Array): void {
    let at = 0;
    while (at < chunk.byteLength && !this.isDone) {
      const found = chunk.indexOf(NEW_LINE, at);
      const end = found < 0 ? chunk.byteLength : found;
      this.#keep(chunk.subarray(at, Math.min(end, at + LINE_BYTES_MAX)));
      if (found < 0) return;
      this.#end();
      at = end + 1;
    }
  }

  #keep(bytes: Uint8Array): void {
    if (this.#line >= this.#first && this.#bytes.length < LINE_BYTES_MAX) this.#bytes.push(...bytes);
  }

  #end(): void {
    if (this.#line >= this.#first) {
      const text = new TextDecoder().decode(Uint8Array.from(this.#bytes)).trimEnd();
      const isLong = text.length > LINE_CHARACTERS_MAX;
      this.texts.push(isLong ? `${text.slice(0, LINE_CHARACTERS_MAX)}…` : text);
    }
    this.#bytes = [];
    this.#line += 1;
  }

  /** The file has ended: a last line needs no end of its own. */
  finish(): string[] {
    if (this.#bytes.length > 0) this.#end();
    return this.texts;
  }
}

/**
 * The lines `first` to `last` (both counted from 1 and included) as texts, without what ends them; fewer where the file
 * ends before. Stops half-way, with nothing, once `isWanted` says no.
 */
export async function linesOf(
  file: Blob,
  first: number,
  last: number,
  isWanted: () => boolean = () => true,
  packing?: Packing,
): Promise<string[]> {
  const chunks = await FileChunks.open(file, packing);
  const picker = new LinePicker(first, last);
  try {
    for (let chunk = await chunks.next(); chunk && !picker.isDone; chunk = await chunks.next()) {
      if (!isWanted()) return [];
      picker.take(chunk);
    }
    return picker.finish();
  } finally {
    await chunks.cancel();
  }
}
