// The double's connection to the bridge: one WebSocket for each realm, opened when the API is first used.
// Knows messages, not what they mean to a port.
import {
  type Ask,
  BRIDGE_PATH,
  FRAME_HEADER_BYTES,
  type FromBridge,
  type ToBridge,
  type Value,
} from '../messages.ts';

type Told = Exclude<FromBridge, { kind: 'answer' }>;

interface Waiting {
  readonly resolve: (value: Value) => void;
  readonly reject: (error: unknown) => void;
}

export interface Listener {
  told(message: Told): void;
  /** `clock` is in ms on the shared clock, NaN without one. */
  bytes(port: number, bytes: Uint8Array<ArrayBuffer>, clock: number): void;
}

export class Link {
  readonly #listener: Listener;
  readonly #waiting = new Map<number, Waiting>();
  #socket: WebSocket | undefined;
  #ready: Promise<void> | undefined;
  #lastId = 0;

  constructor(listener: Listener) {
    this.#listener = listener;
  }

  /** Opens the socket the first time. */
  ready(): Promise<void> {
    this.#ready ??= new Promise((resolve, reject) => {
      const url = new URL(BRIDGE_PATH, self.location.href);
      url.protocol = url.protocol.replace('http', 'ws');
      const socket = new WebSocket(url);
      socket.binaryType = 'arraybuffer';
      socket.onopen = () => resolve();
      socket.onerror = () => reject(new Error('the device bridge of the tests does not answer'));
      socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => this.#take(data);
      this.#socket = socket;
    });
    return this.#ready;
  }

  #take(data: string | ArrayBuffer): void {
    if (typeof data !== 'string') {
      const header = new DataView(data, 0, FRAME_HEADER_BYTES);
      const bytes = new Uint8Array(data, FRAME_HEADER_BYTES);
      this.#listener.bytes(header.getUint8(0), bytes, header.getFloat64(1, true));
      return;
    }
    const message = JSON.parse(data) as FromBridge;
    if (message.kind !== 'answer') return this.#listener.told(message);
    const waiting = this.#waiting.get(message.id);
    this.#waiting.delete(message.id);
    if (message.failure) waiting?.reject(failure(message.failure.name, message.failure.message));
    else waiting?.resolve(message.value);
  }

  tell(message: ToBridge): void {
    this.#socket?.send(JSON.stringify(message));
  }

  send(port: number, bytes: Uint8Array): void {
    const frame = new Uint8Array(FRAME_HEADER_BYTES + bytes.byteLength);
    frame[0] = port;
    frame.set(bytes, FRAME_HEADER_BYTES);
    this.#socket?.send(frame);
  }

  async ask(ask: Ask): Promise<Value> {
    await this.ready();
    this.#lastId += 1;
    const id = this.#lastId;
    return await new Promise<Value>((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.tell({ kind: 'ask', id, ask });
    });
  }
}

/** A DOMException, or the TypeError that the API throws where Web IDL says so. */
function failure(name: string, message: string): Error {
  return name === 'TypeError' ? new TypeError(message) : new DOMException(message, name);
}
