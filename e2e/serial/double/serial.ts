// navigator.serial of the double. A window may ask for ports; a worker only finds those that were allowed.
import type { Filter, FromBridge, PortState } from '../messages.ts';
import { chainHandler, fireBubbling } from './events.ts';
import { Link, type Listener } from './link.ts';
import { SerialPortDouble } from './port.ts';

interface RequestFilter extends Filter {
  readonly bluetoothServiceClassId?: number | string;
}

/** Throws as the API does where a filter means nothing. */
function check(filters: readonly RequestFilter[]): void {
  for (const { usbVendorId, usbProductId, bluetoothServiceClassId } of filters) {
    const hasUsb = usbVendorId !== undefined || usbProductId !== undefined;
    if (!hasUsb && bluetoothServiceClassId === undefined)
      throw new TypeError('A filter must have at least one property.');
    if (hasUsb && bluetoothServiceClassId !== undefined)
      throw new TypeError(
        'A filter cannot specify both bluetoothServiceClassId and usbVendorId or usbProductId.',
      );
    if (usbProductId !== undefined && usbVendorId === undefined)
      throw new TypeError('A filter containing a usbProductId must also specify a usbVendorId.');
  }
}

/** A realm's clock, where the bridge shares one with it. Times are in ms since `share`. */
export interface SharedClock {
  /** From now on time passes only as told. */
  share(): void;
  free(): void;
  pass(sinceShareMs: number): void;
  /** Does what is due; then tells when there is more to do. */
  runDue(idle: (untilMs: number) => void): void;
}

export class SerialDouble extends EventTarget implements Listener {
  readonly #link: Link;
  readonly #clock: SharedClock | undefined;
  readonly #known = new Map<number, PortState>();
  readonly #ports = new Map<number, SerialPortDouble>();

  constructor(clock: SharedClock | undefined) {
    super();
    this.#clock = clock;
    this.#link = new Link(this);
    chainHandler(this, 'connect');
    chainHandler(this, 'disconnect');
  }

  override addEventListener(...args: Parameters<EventTarget['addEventListener']>): void {
    super.addEventListener(...args);
    // Whoever has no use for ports has no socket either.
    void this.#link.ready();
  }

  async getPorts(): Promise<SerialPortDouble[]> {
    // The answer comes behind the list.
    await this.#link.ask({ kind: 'ports' });
    return [...this.#known.values()]
      .filter(({ granted, connected }) => granted && connected)
      .map(({ id }) => this.#port(id));
  }

  async requestPort(options?: { filters?: readonly RequestFilter[] }): Promise<SerialPortDouble> {
    if (!navigator.userActivation.isActive)
      throw new DOMException(
        "Failed to execute 'requestPort' on 'Serial': Must be handling a user gesture to show a permission request.",
        'SecurityError',
      );
    const filters = options?.filters ?? [];
    check(filters);
    const id = await this.#link.ask({ kind: 'request', filters });
    return this.#port(id as number);
  }

  #port(id: number): SerialPortDouble {
    const known = this.#known.get(id);
    if (!known) throw new Error(`the bridge has no port ${id}`);
    let port = this.#ports.get(id);
    if (!port) {
      port = new SerialPortDouble(this.#link, known);
      this.#ports.set(id, port);
    }
    return port;
  }

  bytes(id: number, bytes: Uint8Array<ArrayBuffer>, clock: number): void {
    if (!Number.isNaN(clock)) this.#clock?.pass(clock);
    const port = this.#ports.get(id);
    if (port) SerialPortDouble.take(port, bytes);
  }

  told(message: Parameters<Listener['told']>[0]): void {
    switch (message.kind) {
      case 'ports':
        this.#know(message.ports);
        break;
      case 'clock-shared':
        this.#clock?.share();
        break;
      case 'clock-free':
        this.#clock?.free();
        break;
      case 'turn':
        this.#clock?.pass(message.passed);
        this.#clock?.runDue((until) => this.#link.tell({ kind: 'idle', until }));
        break;
      case 'plug':
        this.#plugged(message);
        break;
      default: {
        const port = this.#ports.get(message.port);
        if (port) SerialPortDouble.told(port, message);
      }
    }
  }

  #plugged(message: Extract<FromBridge, { kind: 'plug' }>): void {
    if (!this.#known.get(message.port)?.granted) return;
    const port = this.#port(message.port);
    SerialPortDouble.told(port, message);
    fireBubbling(port, this, message.connected ? 'connect' : 'disconnect');
  }

  #know(ports: readonly PortState[]): void {
    for (const known of ports) {
      this.#known.set(known.id, known);
      const port = this.#ports.get(known.id);
      if (port) SerialPortDouble.know(port, known);
    }
  }
}
