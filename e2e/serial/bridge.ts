// The device bridge: ports with devices in the test process, reached from all windows and workers of the page through
// WebSockets on the page's own origin. It outlives pages, and keeps what the user allowed.
// Knows the browser's rules about who may have a port; the ports' own behaviour is in port.ts.
import type { IncomingMessage, Server } from 'node:http';
import type { Duplex } from 'node:stream';
import { type WebSocket, WebSocketServer } from 'ws';
import type { Device } from './device.ts';
import {
  type Ask,
  BRIDGE_PATH,
  type Failure,
  type Filter,
  FRAME_HEADER_BYTES,
  type FromBridge,
  type InputSignals,
  type ToBridge,
  type Value,
} from './messages.ts';
import { BridgePort, type Holder, type PortOptions } from './port.ts';

/** What the user does when the browser asks which port. */
export type UserAnswer = BridgePort | 'cancels' | 'is not asked';

class Refusal extends Error {
  readonly failure: Failure;

  constructor(name: string, message: string) {
    super(message);
    this.failure = { name, message };
  }
}

const SIGNALS: InputSignals = {
  dataCarrierDetect: true,
  clearToSend: true,
  ringIndicator: false,
  dataSetReady: true,
};

/** A window or worker. */
class Realm implements Holder {
  readonly #socket: WebSocket;

  constructor(socket: WebSocket) {
    this.#socket = socket;
  }

  tell(message: FromBridge): void {
    this.#socket.send(JSON.stringify(message));
  }

  send(port: number, bytes: Uint8Array, clockMs: number): void {
    const frame = Buffer.alloc(FRAME_HEADER_BYTES + bytes.byteLength);
    frame.writeUInt8(port, 0);
    frame.writeDoubleLE(clockMs, 1);
    frame.set(bytes, FRAME_HEADER_BYTES);
    this.#socket.send(frame);
  }
}

const matches = (port: BridgePort, filters: readonly Filter[]): boolean =>
  filters.length === 0 ||
  filters.some(
    ({ usbVendorId, usbProductId }) =>
      usbVendorId === port.options.vendor &&
      (usbProductId === undefined || usbProductId === port.options.product),
  );

export class DeviceBridge {
  readonly ports: BridgePort[] = [];
  readonly #server: Server;
  readonly #sockets = new WebSocketServer({ noServer: true });
  readonly #realms = new Set<Realm>();
  readonly #answers: UserAnswer[] = [];
  readonly #upgrade = (request: IncomingMessage, socket: Duplex, head: Buffer): void => {
    if (new URL(request.url ?? '/', 'http://localhost').pathname !== BRIDGE_PATH)
      return void socket.destroy();
    this.#sockets.handleUpgrade(request, socket, head, (opened) => this.#serve(opened));
  };

  constructor(server: Server) {
    this.#server = server;
    server.on('upgrade', this.#upgrade);
  }

  /** Plugs a device in. */
  add(device: Device, options: PortOptions = {}): BridgePort {
    const port = new BridgePort(this.ports.length, device, options);
    this.ports.push(port);
    this.#tellPorts();
    return port;
  }

  /** What the user will do the next time. */
  nextAnswer(answer: UserAnswer): void {
    this.#answers.push(answer);
  }

  /** The cable comes out: whoever has the port open loses it, and all who may use it are told. */
  unplug(port: BridgePort): void {
    port.unplug();
    if (!port.connected) this.#tellPlug(port);
  }

  replug(port: BridgePort): void {
    port.replug();
    this.#tellPlug(port);
  }

  #tellPlug(port: BridgePort): void {
    for (const realm of this.#realms) {
      realm.tell({ kind: 'plug', port: port.id, connected: port.connected });
    }
    this.#tellPorts();
  }

  #tellPorts(): void {
    const ports = this.ports.map(({ state }) => state);
    for (const realm of this.#realms) realm.tell({ kind: 'ports', ports });
  }

  async close(): Promise<void> {
    this.#server.off('upgrade', this.#upgrade);
    for (const port of this.ports) port.powerDown();
    for (const socket of this.#sockets.clients) socket.terminate();
    await new Promise((done) => this.#sockets.close(done));
  }

  #serve(socket: WebSocket): void {
    const realm = new Realm(socket);
    this.#realms.add(realm);
    realm.tell({ kind: 'ports', ports: this.ports.map(({ state }) => state) });
    socket.on('message', (data: Buffer, isBinary: boolean) => {
      if (isBinary) this.ports[data.readUInt8(0)]?.take(data.subarray(FRAME_HEADER_BYTES));
      else this.#take(realm, JSON.parse(data.toString()) as ToBridge);
    });
    socket.on('close', () => {
      this.#realms.delete(realm);
      // A page that ends closes its ports.
      for (const port of this.ports) if (port.holder === realm) port.close();
    });
  }

  #take(realm: Realm, message: ToBridge): void {
    switch (message.kind) {
      case 'ask':
        void this.#answer(realm, message.id, message.ask);
        break;
      case 'credit':
        this.#held(realm, message.port)?.credit(message.bytes);
        break;
      case 'discard':
        this.#held(realm, message.port)?.discard();
        break;
      case 'idle':
        for (const port of this.ports) if (port.holder === realm) port.idle(message.until);
        break;
    }
  }

  #held(realm: Realm, id: number): BridgePort | undefined {
    const port = this.ports[id];
    return port?.holder === realm ? port : undefined;
  }

  async #answer(realm: Realm, id: number, ask: Ask): Promise<void> {
    try {
      const value = await this.#act(realm, ask);
      realm.tell({ kind: 'answer', id, value, failure: null });
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      realm.tell({ kind: 'answer', id, value: null, failure: error.failure });
    }
  }

  async #act(realm: Realm, ask: Ask): Promise<Value> {
    if (ask.kind === 'ports') return null;
    if (ask.kind === 'request') return this.#request(ask.filters);
    const port = this.ports[ask.port];
    if (!port) throw new Refusal('NetworkError', 'There is no such port.');
    switch (ask.kind) {
      case 'open':
        return this.#open(realm, port, ask);
      case 'close':
        if (port.holder === realm) port.close();
        return null;
      case 'forget':
        if (port.holder === realm) port.close();
        port.granted = false;
        this.#tellPorts();
        return null;
      case 'drain':
        await port.drain();
        return null;
      default:
        if (port.options.isTerminal || !port.connected)
          throw new Refusal('NetworkError', 'Failed to get or set control signals.');
        if (ask.kind !== 'set-signals') return SIGNALS;
        port.signals = { ...port.signals, ...ask.signals };
        return null;
    }
  }

  #open(realm: Realm, port: BridgePort, ask: Ask & { kind: 'open' }): null {
    const isTaken = port.holder !== undefined && port.options.isExclusive !== false;
    if (!port.granted || !port.connected || port.isHeldElsewhere || isTaken)
      throw new Refusal('NetworkError', 'Failed to open serial port.');
    // Two hosts on one line: the first one is not told.
    port.close();
    port.open(realm, ask.options);
    return null;
  }

  #request(filters: readonly Filter[]): number {
    const answer = this.#answers.shift();
    if (answer === undefined) throw new Refusal('AbortError', 'The test has not said what the user does.');
    if (answer === 'is not asked')
      throw new Refusal(
        'SecurityError',
        'Access to the feature "serial" is disallowed by permissions policy.',
      );
    if (answer === 'cancels' || !answer.connected || !matches(answer, filters))
      throw new Refusal('NotFoundError', 'No port selected by the user.');
    answer.granted = true;
    this.#tellPorts();
    return answer.id;
  }
}
