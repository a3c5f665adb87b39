// A port of the Web Serial API as a Transport. Runs in the worker, where ports are found but never asked for.
//
// A framing or overrun error ends the browser's stream, not the connection: the next stream is taken up. An unplugged
// device rejects with NetworkError and leaves `readable` null, on a terminal even without a `disconnect` event.
import { type LineErrorKind, type LineErrors, NO_LINE_ERRORS, PortError, type Transport } from './transport';

/** The browser's default of 255 bytes loses data as soon as a task takes long. */
const BUFFER_BYTES = 64 * 1024;
/** So many errors with no byte between them are not a noisy line but a broken one. */
const ERRORS_IN_A_ROW_MAX = 50;
/** A device that does not take its last bytes, or a system that does not let go of a port, is not waited for longer. */
const CLOSE_MS_MAX = 500;
/** Errors after which the browser offers a new stream at once. */
const RECOVERABLE: ReadonlyMap<string, LineErrorKind> = new Map([
  ['BreakError', 'break'],
  ['FramingError', 'framing'],
  ['ParityError', 'parity'],
  ['BufferOverrunError', 'overrun'],
  ['UnknownError', 'system'],
]);

/** What tells a port from others in another realm: the devices' kind and which of that kind it is. */
export interface PortId {
  readonly vendor: number | null;
  readonly product: number | null;
  /** Among the ports of that kind, in the order of `getPorts()`. */
  readonly index: number;
}

const sameKind = (port: SerialPort, vendor: number | null, product: number | null): boolean => {
  const info = port.getInfo();
  return (info.usbVendorId ?? null) === vendor && (info.usbProductId ?? null) === product;
};

/** Whether the port is of the kind of device that the identity is of. */
export const isSameKind = (port: SerialPort, { vendor, product }: PortId): boolean =>
  sameKind(port, vendor, product);

/** How to find `port` again from a worker. */
export function identify(port: SerialPort, all: readonly SerialPort[]): PortId {
  const info = port.getInfo();
  const vendor = info.usbVendorId ?? null;
  const product = info.usbProductId ?? null;
  const alike = all.filter((other) => sameKind(other, vendor, product));
  return { vendor, product, index: Math.max(0, alike.indexOf(port)) };
}

/** The port of that identity among those that the user has allowed. */
export function find(id: PortId, all: readonly SerialPort[]): SerialPort | undefined {
  return all.filter((port) => sameKind(port, id.vendor, id.product))[id.index];
}

const nameOf = (error: unknown): string => (error instanceof DOMException ? error.name : '');

/** Opens a port. Rejects with a PortError. */
export async function openSerial(port: SerialPort, baudRate: number): Promise<Transport> {
  try {
    await port.open({ baudRate, bufferSize: BUFFER_BYTES });
  } catch (error) {
    const code = port.connected === false ? 'port-gone' : 'port-busy';
    throw new PortError(code, error);
  }
  return new SerialTransport(port);
}

/**
 * Waits until something has ended, but not for ever; false where it has not. Streams that ended in an error cannot be
 * ended again; the port must be closed all the same.
 */
async function settle(ending: Promise<unknown> | undefined): Promise<boolean> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const late = new Promise<boolean>((resolve) => {
    timer = setTimeout(() => resolve(false), CLOSE_MS_MAX);
  });
  const ended = Promise.resolve(ending).then(
    () => true,
    () => true,
  );
  const hasEnded = await Promise.race([ended, late]);
  clearTimeout(timer);
  return hasEnded;
}

class SerialTransport implements Transport {
  readonly readable: ReadableStream<Uint8Array<ArrayBuffer>>;
  readonly writable: WritableStream<Uint8Array<ArrayBuffer>>;
  readonly lost: Promise<PortError>;
  readonly #port: SerialPort;
  #lose: (error: PortError) => void = () => undefined;
  #reader: ReadableStreamDefaultReader<Uint8Array> | undefined;
  #writer: WritableStreamDefaultWriter<Uint8Array> | undefined;
  #errors: LineErrors = NO_LINE_ERRORS;
  #inARow = 0;
  #closing = false;

  constructor(port: SerialPort) {
    this.#port = port;
    this.lost = new Promise((resolve) => {
      this.#lose = resolve;
    });
    port.addEventListener('disconnect', this.#unplugged);
    this.readable = new ReadableStream({
      pull: async (controller) => {
        const bytes = await this.#read();
        if (bytes) controller.enqueue(bytes);
        else controller.close();
      },
    });
    this.writable = new WritableStream({ write: (bytes) => this.#write(bytes) });
  }

  lineErrors(): LineErrors {
    return this.#errors;
  }

  readonly #unplugged = (): void => this.#fail('unplugged');

  #fail(code: 'unplugged' | 'port-error', cause?: unknown): void {
    if (!this.#closing) this.#lose(new PortError(code, cause));
  }

  /** The next bytes, over as many streams as it takes; undefined when there will be none. */
  async #read(): Promise<Uint8Array<ArrayBuffer> | undefined> {
    while (!this.#closing) {
      const stream = this.#port.readable;
      if (!stream) {
        this.#fail('unplugged');
        return undefined;
      }
      this.#reader ??= stream.getReader();
      try {
        const { value, done } = await this.#reader.read();
        if (value && value.byteLength > 0) {
          this.#inARow = 0;
          return value as Uint8Array<ArrayBuffer>;
        }
        if (done) this.#release();
      } catch (error) {
        this.#release();
        if (!this.#recovers(error)) return undefined;
      }
    }
    return undefined;
  }

  #count(kind: LineErrorKind): void {
    this.#errors = { ...this.#errors, [kind]: this.#errors[kind] + 1 };
  }

  #recovers(error: unknown): boolean {
    const kind = RECOVERABLE.get(nameOf(error));
    if (!kind) {
      this.#fail('unplugged', error);
      return false;
    }
    this.#count(kind);
    this.#inARow += 1;
    if (this.#inARow <= ERRORS_IN_A_ROW_MAX) return true;
    this.#fail('port-error', error);
    return false;
  }

  #release(): void {
    this.#reader?.releaseLock();
    this.#reader = undefined;
  }

  async #write(bytes: Uint8Array): Promise<void> {
    const stream = this.#port.writable;
    if (!stream) {
      this.#fail('unplugged');
      throw new PortError('unplugged');
    }
    try {
      this.#writer ??= stream.getWriter();
      await this.#writer.write(bytes);
    } catch (error) {
      this.#writer?.releaseLock();
      this.#writer = undefined;
      // A new stream replaces one that failed; what was in it is lost, which the link repairs.
      if (nameOf(error) === 'UnknownError') this.#count('system');
      else {
        this.#fail('unplugged', error);
        throw new PortError('unplugged', error);
      }
    }
  }

  async close(): Promise<void> {
    if (this.#closing) return;
    this.#closing = true;
    this.#port.removeEventListener('disconnect', this.#unplugged);
    await settle(this.#reader?.cancel());
    this.#release();
    await this.#endWriting();
    await settle(this.#port.close());
  }

  async #endWriting(): Promise<void> {
    const writer = this.#writer;
    this.#writer = undefined;
    if (!writer || (await settle(writer.close()))) return writer?.releaseLock();
    // A port with a stream that still waits for its device cannot be closed.
    await settle(writer.abort());
    writer.releaseLock();
  }
}
