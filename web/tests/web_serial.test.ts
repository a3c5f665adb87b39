// A serial port as a transport: errors on the line are survived, an unplugged device is told once.
import { expect, test, vi } from 'vitest';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { find, identify, openSerial } from '../src/transport/web_serial';

type Step = number[] | DOMException | 'unplug';

/** A port whose streams give these steps; each error ends a stream, as in the browser. */
class ScriptedPort extends EventTarget {
  readable: ReadableStream<Uint8Array> | null = null;
  writable: WritableStream<Uint8Array> | null = null;
  connected = true;
  closed = false;
  readonly written: number[] = [];
  readonly #steps: Step[];
  readonly #info: SerialPortInfo;

  constructor(steps: Step[], info: SerialPortInfo = {}) {
    super();
    this.#steps = steps;
    this.#info = info;
  }

  getInfo(): SerialPortInfo {
    return this.#info;
  }

  async open(options: SerialOptions): Promise<void> {
    if (!this.connected) throw new DOMException('not there', 'NetworkError');
    expect(options.bufferSize).toBeGreaterThan(255);
    this.#renew();
    this.writable = new WritableStream({ write: (bytes) => void this.written.push(...bytes) });
  }

  #renew(): void {
    this.readable = new ReadableStream(
      {
        pull: (controller) => {
          const step = this.#steps.shift();
          if (step === undefined) return new Promise<void>(() => undefined);
          if (step === 'unplug') {
            controller.error(new DOMException('lost', 'NetworkError'));
            this.readable = null;
          } else if (step instanceof DOMException) {
            controller.error(step);
            this.#renew();
          } else controller.enqueue(Uint8Array.from(step));
          return undefined;
        },
      },
      { highWaterMark: 0 },
    );
  }

  async close(): Promise<void> {
    this.closed = true;
  }
}

const asPort = (port: ScriptedPort): SerialPort => port as unknown as SerialPort;
const framing = () => new DOMException('framing', 'FramingError');

test.each([
  ['BreakError', 'break'],
  ['FramingError', 'framing'],
  ['ParityError', 'parity'],
  ['BufferOverrunError', 'overrun'],
  ['UnknownError', 'system'],
] as const)('reads on over a %s and counts it', async (name, kind) => {
  const error = () => new DOMException('on the line', name);
  const port = new ScriptedPort([[1], error(), [2, 3], error(), [4]]);
  const transport = await openSerial(asPort(port), 250_000);
  const reader = transport.readable.getReader();
  const got: number[] = [];
  while (got.length < 4) got.push(...((await reader.read()).value ?? []));
  expect(got).toEqual([1, 2, 3, 4]);
  expect(transport.lineErrors()).toEqual({ ...NO_LINE_ERRORS, [kind]: 2 });
  await transport.close();
  expect(port.closed).toBe(true);
});

test('an error that no new stream follows is a loss, not an error of the line', async () => {
  const gone = new DOMException('gone', 'NetworkError');
  const transport = await openSerial(asPort(new ScriptedPort([[1], gone])), 250_000);
  const reader = transport.readable.getReader();
  await reader.read();
  expect((await reader.read()).done).toBe(true);
  expect((await transport.lost).code).toBe('unplugged');
  expect(transport.lineErrors()).toEqual(NO_LINE_ERRORS);
});

test('an unplugged device is lost', async () => {
  const transport = await openSerial(asPort(new ScriptedPort([[1], 'unplug'])), 250_000);
  const reader = transport.readable.getReader();
  await reader.read();
  expect((await reader.read()).done).toBe(true);
  expect((await transport.lost).code).toBe('unplugged');
  await transport.close();
});

test('a disconnect event alone is enough', async () => {
  const port = new ScriptedPort([]);
  const transport = await openSerial(asPort(port), 250_000);
  port.dispatchEvent(new Event('disconnect'));
  expect((await transport.lost).code).toBe('unplugged');
});

test('nothing but errors is given up', async () => {
  const transport = await openSerial(asPort(new ScriptedPort(Array.from({ length: 200 }, framing))), 9600);
  void transport.readable.getReader().read();
  expect((await transport.lost).code).toBe('port-error');
});

test('writes reach the port', async () => {
  const port = new ScriptedPort([]);
  const transport = await openSerial(asPort(port), 250_000);
  await transport.writable.getWriter().write(Uint8Array.of(9, 8));
  expect(port.written).toEqual([9, 8]);
});

test('a device that takes nothing any more does not keep the port from being closed', async () => {
  vi.useFakeTimers();
  const port = new ScriptedPort([]);
  const transport = await openSerial(asPort(port), 250_000);
  let aborted = false;
  const never = (): Promise<void> => new Promise(() => undefined);
  port.writable = new WritableStream({
    close: never,
    start: (controller) => {
      controller.signal.addEventListener('abort', () => {
        aborted = true;
      });
    },
  });
  await transport.writable.getWriter().write(Uint8Array.of(1));
  const closing = transport.close();
  await vi.advanceTimersByTimeAsync(2000);
  await closing;
  expect([aborted, port.closed]).toEqual([true, true]);
  vi.useRealTimers();
});

test('a port that cannot be opened says whether it is there', async () => {
  const port = new ScriptedPort([]);
  port.connected = false;
  await expect(openSerial(asPort(port), 250_000)).rejects.toMatchObject({ code: 'port-gone' });
  const busy = new ScriptedPort([]);
  busy.open = () => Promise.reject(new DOMException('busy', 'NetworkError'));
  await expect(openSerial(asPort(busy), 250_000)).rejects.toMatchObject({ code: 'port-busy' });
});

test('a port is found again in another realm by its kind and place', () => {
  const kinds = [
    { usbVendorId: 1, usbProductId: 2 },
    { usbVendorId: 1, usbProductId: 3 },
    { usbVendorId: 1, usbProductId: 2 },
    {},
  ];
  const here = kinds.map((info) => asPort(new ScriptedPort([], info)));
  const there = kinds.map((info) => asPort(new ScriptedPort([], info)));
  for (const [index, port] of here.entries()) expect(find(identify(port, here), there)).toBe(there[index]);
  expect(find({ vendor: 7, product: 7, index: 0 }, there)).toBeUndefined();
});
