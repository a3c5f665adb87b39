// A file's bytes in chunks of bounded size, unpacked where it is gzip. Never the whole file, never as a string: V8's
// strings end at 512 MiB. Knows nothing of G-code.

/** What one chunk holds at most. */
export const CHUNK_BYTES_MAX = 256 * 1024;
const GZIP = [0x1f, 0x8b] as const;

async function isGzip(file: Blob): Promise<boolean> {
  const start = new Uint8Array(await file.slice(0, GZIP.length).arrayBuffer());
  return GZIP.every((byte, index) => start[index] === byte);
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

  static async open(file: Blob): Promise<FileChunks> {
    const count = { bytes: 0 };
    const counted = file.stream().pipeThrough(
      new TransformStream<Uint8Array<ArrayBuffer>, Uint8Array<ArrayBuffer>>({
        transform(chunk, controller) {
          count.bytes += chunk.byteLength;
          controller.enqueue(chunk);
        },
      }),
    );
    const unpacked = (await isGzip(file)) ? counted.pipeThrough(new DecompressionStream('gzip')) : counted;
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
