// The writing half of an open port: a stream into a bounded buffer, renewed after a system error.
// Knows nothing of messages: it hands bytes to the port and is told when they have left the buffer.

export interface Sink {
  send(bytes: Uint8Array): void;
  /** Settles when all that was sent has left. */
  drain(): Promise<void>;
  /** Drops what has not left yet. */
  discard(): void;
}

const isBufferSource = (chunk: unknown): chunk is ArrayBuffer | ArrayBufferView =>
  chunk instanceof ArrayBuffer || ArrayBuffer.isView(chunk);

/** The bytes of a chunk from `offset`; none of a buffer that has been detached. */
function bytesFrom(chunk: ArrayBuffer | ArrayBufferView, offset: number): Uint8Array {
  if (chunk.byteLength <= offset) return new Uint8Array();
  return chunk instanceof ArrayBuffer
    ? new Uint8Array(chunk, offset)
    : new Uint8Array(chunk.buffer, chunk.byteOffset + offset, chunk.byteLength - offset);
}

export class Writing {
  readonly #bufferSize: number;
  readonly #sink: Sink;
  #stream: WritableStream<BufferSource> | null = null;
  #controller: WritableStreamDefaultController | undefined;
  #buffered = 0;
  #wait: { resolve: () => void; reject: (error: unknown) => void } | undefined;
  #ended = false;

  constructor(bufferSize: number, sink: Sink) {
    this.#bufferSize = bufferSize;
    this.#sink = sink;
  }

  get stream(): WritableStream<BufferSource> | null {
    if (!this.#stream && !this.#ended) this.#stream = this.#open();
    return this.#stream;
  }

  get current(): WritableStream<BufferSource> | null {
    return this.#stream;
  }

  #open(): WritableStream<BufferSource> {
    return new WritableStream<BufferSource>(
      {
        start: (controller) => {
          this.#controller = controller;
          // An abort does not wait for what may never come: room, or the device taking the last byte.
          controller.signal.addEventListener('abort', () => this.#wait?.reject(controller.signal.reason));
        },
        write: (chunk) => this.#write(chunk),
        close: () => this.#closed(),
        abort: () => this.#aborted(),
      },
      new CountQueuingStrategy({ highWaterMark: 1 }),
    );
  }

  async #write(chunk: BufferSource): Promise<void> {
    if (!isBufferSource(chunk)) throw new TypeError('The chunk is not a BufferSource.');
    for (let offset = 0; ; ) {
      const rest = bytesFrom(chunk, offset);
      if (rest.byteLength === 0) return;
      const room = this.#bufferSize - this.#buffered;
      if (room === 0) {
        await this.#waitForRoom();
        continue;
      }
      const piece = rest.slice(0, room);
      this.#buffered += piece.byteLength;
      offset += piece.byteLength;
      this.#sink.send(piece);
    }
  }

  #waitForRoom(): Promise<void> {
    return new Promise<void>((resolve, reject) => {
      this.#wait = { resolve, reject };
    }).finally(() => {
      this.#wait = undefined;
    });
  }

  async #closed(): Promise<void> {
    const cut = new Promise<void>((_, reject) => {
      this.#wait = { resolve: () => undefined, reject };
    });
    try {
      await Promise.race([this.#sink.drain(), cut]);
      this.#forget();
    } catch (error) {
      this.#aborted();
      throw error;
    } finally {
      this.#wait = undefined;
    }
  }

  #aborted(): void {
    this.#sink.discard();
    this.#forget();
  }

  #forget(): void {
    this.#stream = null;
    this.#controller = undefined;
  }

  /** So many bytes have left the buffer, or were dropped from it. */
  taken(bytes: number): void {
    this.#buffered = Math.max(0, this.#buffered - bytes);
    this.#wait?.resolve();
  }

  /** A system error: this stream ends, another follows. */
  error(error: DOMException): void {
    const controller = this.#controller;
    this.#forget();
    this.#wait?.reject(error);
    controller?.error(error);
  }

  /** The other end is gone: no stream follows. */
  lose(error: DOMException): void {
    this.#ended = true;
    this.error(error);
  }

  end(): void {
    this.#ended = true;
    this.#forget();
  }
}
