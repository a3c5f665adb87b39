// A SerialPort of the double: its states, its errors and its two halves, as the real one shows them.
// Knows the link to the bridge; the device is at the bridge's other end.
import type { FromBridge, InputSignals, OpenOptions, OutputSignals, PortState } from '../messages.ts';
import { chainHandler } from './events.ts';
import type { Link } from './link.ts';
import { Reading } from './reading.ts';
import { Writing } from './writing.ts';

const BUFFER_SIZE = 255;
const BUFFER_SIZE_MAX = 16 * 1024 * 1024;

type About = Extract<FromBridge, { port: number }>;

const invalidState = (message: string): DOMException => new DOMException(message, 'InvalidStateError');
const lost = (): DOMException => new DOMException('The device has been lost.', 'NetworkError');

const MESSAGES: Record<string, string> = {
  BreakError: 'Break received',
  FramingError: 'Framing error',
  ParityError: 'Parity error',
  BufferOverrunError: 'Buffer overrun',
  UnknownError: 'An unknown system error has occurred.',
};

/** The options that matter to the bridge; throws as the API does where one is not allowed. */
function checked(options: SerialOptions): OpenOptions {
  const refuse = (what: string): never => {
    throw new TypeError(`Failed to execute 'open' on 'SerialPort': ${what}`);
  };
  const { baudRate, dataBits, stopBits, parity, bufferSize, flowControl } = Object(options) as SerialOptions;
  if (baudRate === undefined) refuse("Failed to read the 'baudRate' property: Required member is undefined.");
  if (!Number.isFinite(baudRate) || baudRate <= 0) refuse('Requested baud rate must be greater than zero.');
  if (![undefined, 7, 8].includes(dataBits)) refuse('Requested number of data bits must be 7 or 8.');
  if (![undefined, 1, 2].includes(stopBits)) refuse('Requested number of stop bits must be 1 or 2.');
  if (![undefined, 'none', 'even', 'odd'].includes(parity))
    refuse(`The provided value '${parity}' is not a valid enum value of type ParityType.`);
  if (![undefined, 'none', 'hardware'].includes(flowControl))
    refuse(`The provided value '${flowControl}' is not a valid enum value of type FlowControlType.`);
  const size = bufferSize ?? BUFFER_SIZE;
  if (!(size > 0)) refuse('Requested buffer size must be greater than zero.');
  if (size > BUFFER_SIZE_MAX) refuse(`Requested buffer size (${size} bytes) is greater than the maximum.`);
  return { baudRate, bufferSize: size };
}

export class SerialPortDouble extends EventTarget {
  readonly #link: Link;
  #known: PortState;
  #state: 'closed' | 'opening' | 'open' | 'forgotten' = 'closed';
  #closing = false;
  /** Where the device went while the port was open. */
  #isLost = false;
  #reading: Reading | undefined;
  #writing: Writing | undefined;

  constructor(link: Link, known: PortState) {
    super();
    this.#link = link;
    this.#known = known;
    chainHandler(this, 'connect');
    chainHandler(this, 'disconnect');
  }

  get connected(): boolean {
    return this.#known.connected;
  }

  get readable(): ReadableStream<Uint8Array<ArrayBuffer>> | null {
    if (this.#closing) return this.#reading?.current ?? null;
    return this.#reading?.stream ?? null;
  }

  get writable(): WritableStream<BufferSource> | null {
    if (this.#closing) return this.#writing?.current ?? null;
    return this.#writing?.stream ?? null;
  }

  getInfo(): SerialPortInfo {
    const { vendor, product } = this.#known;
    return vendor === null ? {} : { usbVendorId: vendor, ...(product !== null && { usbProductId: product }) };
  }

  async open(options: SerialOptions): Promise<void> {
    if (this.#state === 'opening') throw invalidState('A call to open() is already in progress.');
    if (this.#state === 'open') throw invalidState('The port is already open.');
    if (this.#state === 'forgotten') throw invalidState('The port has been forgotten.');
    const wanted = checked(options);
    this.#state = 'opening';
    try {
      await this.#link.ask({ kind: 'open', port: this.#known.id, options: wanted });
      this.#opened(wanted);
    } catch (error) {
      if (this.#state === 'opening') this.#state = 'closed';
      throw error;
    }
  }

  #opened({ bufferSize }: OpenOptions): void {
    const port = this.#known.id;
    this.#state = 'open';
    this.#isLost = false;
    this.#reading = new Reading(bufferSize, (bytes) => this.#link.tell({ kind: 'credit', port, bytes }));
    this.#writing = new Writing(bufferSize, {
      send: (bytes) => this.#link.send(port, bytes),
      drain: async () => void (await this.#link.ask({ kind: 'drain', port })),
      discard: () => this.#link.tell({ kind: 'discard', port }),
    });
  }

  async close(): Promise<void> {
    if (this.#state !== 'open') throw invalidState('The port is already closed.');
    if (this.#closing) throw invalidState('A call to close() is already in progress.');
    this.#closing = true;
    try {
      // Refused with a TypeError where somebody holds one of them.
      await Promise.all([
        this.#reading?.current?.cancel(),
        this.#writing?.current?.abort(invalidState('The port has been closed.')),
      ]);
      await this.#link.ask({ kind: 'close', port: this.#known.id });
      this.#shut('closed');
    } finally {
      this.#closing = false;
    }
  }

  #shut(state: 'closed' | 'forgotten'): void {
    this.#state = state;
    this.#reading?.end();
    this.#writing?.end();
    this.#reading = undefined;
    this.#writing = undefined;
  }

  async forget(): Promise<void> {
    if (this.#state === 'forgotten') return;
    this.#reading?.lose(lost());
    this.#writing?.lose(lost());
    await this.#link.ask({ kind: 'forget', port: this.#known.id });
    this.#shut('forgotten');
  }

  async getSignals(): Promise<InputSignals> {
    this.#mustBeOpen();
    return (await this.#link.ask({ kind: 'get-signals', port: this.#known.id })) as InputSignals;
  }

  async setSignals(signals: OutputSignals = {}): Promise<void> {
    this.#mustBeOpen();
    const { dataTerminalReady, requestToSend, break: pause } = signals;
    if (dataTerminalReady === undefined && requestToSend === undefined && pause === undefined) {
      const call = "Failed to execute 'setSignals' on 'SerialPort'";
      throw new TypeError(`${call}: Signals dictionary must contain at least one member.`);
    }
    await this.#link.ask({ kind: 'set-signals', port: this.#known.id, signals });
  }

  #mustBeOpen(): void {
    if (this.#state !== 'open') throw invalidState('The port is closed.');
    if (this.#isLost) throw new DOMException('Failed to reach the device.', 'NetworkError');
  }

  static take(port: SerialPortDouble, bytes: Uint8Array<ArrayBuffer>): void {
    port.#reading?.take(bytes);
  }

  static know(port: SerialPortDouble, known: PortState): void {
    port.#known = known;
  }

  static told(port: SerialPortDouble, message: About): void {
    port.#told(message);
  }

  #told(message: About): void {
    switch (message.kind) {
      case 'read-error':
        this.#reading?.error(new DOMException(MESSAGES[message.name], message.name));
        break;
      case 'write-error':
        this.#writing?.error(new DOMException(MESSAGES['UnknownError'], 'UnknownError'));
        break;
      case 'lost':
        this.#isLost = true;
        this.#reading?.lose(lost());
        this.#writing?.lose(lost());
        break;
      case 'taken':
        this.#writing?.taken(message.bytes);
        break;
      case 'plug':
        this.#known = { ...this.#known, connected: message.connected };
        break;
    }
  }
}
