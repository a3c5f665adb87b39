// The reading half of an open port: a byte stream over a bounded pipe, renewed after each error that allows it.
// Knows nothing of messages: the port tells it bytes and errors, it tells the port what room there is.

type Item = Uint8Array<ArrayBuffer> | DOMException;

export class Reading {
  readonly #bufferSize: number;
  /** Bytes left the pipe, so as many more may come. */
  readonly #onRoom: (bytes: number) => void;
  #pipe: Item[] = [];
  #stream: ReadableStream<Uint8Array<ArrayBuffer>> | null = null;
  #controller: ReadableByteStreamController | undefined;
  #pulled: (() => void) | undefined;
  /** After this there is no other stream. */
  #ended = false;
  #fatal: DOMException | undefined;

  constructor(bufferSize: number, onRoom: (bytes: number) => void) {
    this.#bufferSize = bufferSize;
    this.#onRoom = onRoom;
    onRoom(bufferSize);
  }

  /** The stream, made anew where the last one ended and may be followed. */
  get stream(): ReadableStream<Uint8Array<ArrayBuffer>> | null {
    if (!this.#stream && !this.#ended) this.#stream = this.#open();
    return this.#stream;
  }

  /** The stream that there is, without making one. */
  get current(): ReadableStream<Uint8Array<ArrayBuffer>> | null {
    return this.#stream;
  }

  #open(): ReadableStream<Uint8Array<ArrayBuffer>> {
    return new ReadableStream<Uint8Array<ArrayBuffer>>(
      {
        type: 'bytes',
        start: (controller) => {
          // A stream of bytes has no other kind.
          this.#controller = controller as ReadableByteStreamController;
        },
        pull: () => this.#pull(),
        cancel: () => this.#cancelled(),
      },
      { highWaterMark: 0 },
    );
  }

  #pull(): Promise<void> | undefined {
    if (this.#pipe.length > 0) {
      this.#deliver();
      return undefined;
    }
    return new Promise((resolve) => {
      this.#pulled = resolve;
    });
  }

  /** Hands the first thing in the pipe to the stream. */
  #deliver(): void {
    const item = this.#pipe[0];
    const controller = this.#controller;
    if (!item || !controller) return;
    if (item instanceof DOMException) {
      this.#pipe.shift();
      this.#fail(item);
      return;
    }
    const view = controller.byobRequest?.view;
    const length = Math.min(item.byteLength, view?.byteLength ?? this.#bufferSize);
    const piece = item.slice(0, length);
    if (length === item.byteLength) this.#pipe.shift();
    else this.#pipe[0] = item.subarray(length);
    if (view) {
      new Uint8Array(view.buffer, view.byteOffset, length).set(piece);
      controller.byobRequest?.respond(length);
    } else controller.enqueue(piece);
    this.#onRoom(length);
    this.#failIfDrained();
  }

  #failIfDrained(): void {
    if (this.#fatal && this.#pipe.length === 0) this.#fail(this.#fatal);
  }

  #fail(error: DOMException): void {
    const controller = this.#controller;
    this.#stream = null;
    this.#controller = undefined;
    if (error === this.#fatal) this.#ended = true;
    controller?.error(error);
    this.#settle();
  }

  #settle(): void {
    const pulled = this.#pulled;
    this.#pulled = undefined;
    pulled?.();
  }

  #cancelled(): void {
    const dropped = this.#pipe.reduce(
      (sum, item) => sum + (item instanceof DOMException ? 0 : item.byteLength),
      0,
    );
    this.#pipe = [];
    this.#stream = null;
    this.#controller = undefined;
    this.#settle();
    if (dropped > 0) this.#onRoom(dropped);
  }

  take(bytes: Uint8Array<ArrayBuffer>): void {
    this.#push(bytes);
  }

  /** An error on the line: this stream ends after what came before it, the next begins after it. */
  error(error: DOMException): void {
    this.#push(error);
  }

  #push(item: Item): void {
    if (this.#fatal) return;
    this.#pipe.push(item);
    if (!this.#pulled) return;
    this.#deliver();
    this.#settle();
  }

  /** The other end is gone: no stream follows. What came before can still be read. */
  lose(error: DOMException): void {
    this.#fatal = error;
    if (!this.#stream && this.#pipe.length > 0) this.#pipe = [];
    this.#failIfDrained();
  }

  end(): void {
    this.#ended = true;
    this.#stream = null;
  }
}
