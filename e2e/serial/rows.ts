// The behaviour of Web Serial, row by row, as the real implementation in Chromium showed it; `window` and `worker` alike
// unless a row says where. Each row gets a port of its own, allowed and closed.
import { expect } from '@playwright/test';
import type { DeviceBridge } from './bridge.ts';
import type { ScriptedDevice } from './device.ts';
import type { Kit, Realm } from './kit.ts';
import type { BridgePort, PortOptions } from './port.ts';

/** In the realm. */
declare const kit: Kit;

export interface Setting {
  readonly realm: Realm;
  readonly bridge: DeviceBridge;
  readonly port: BridgePort;
  readonly device: ScriptedDevice;
  /** The port's USB product: how it is found in the realm. */
  readonly id: number;
}

export interface Row {
  readonly name: string;
  readonly options?: PortOptions;
  readonly run: (setting: Setting) => Promise<void>;
}

const bytes = (...values: number[]): Uint8Array => Uint8Array.from(values);

const opening: readonly Row[] = [
  {
    name: 'open with options that mean nothing: TypeError',
    run: async ({ realm, id }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        const baudRate = 9600;
        const wrong: object[] = [
          {},
          { baudRate: 0 },
          { baudRate, dataBits: 6 },
          { baudRate, stopBits: 3 },
          { baudRate, parity: 'mark' },
          { baudRate, flowControl: 'software' },
          { baudRate, bufferSize: 0 },
          { baudRate, bufferSize: 16_777_217 },
        ];
        const outcomes: string[] = [];
        for (const options of wrong) outcomes.push(await kit.outcome(port.open(options as SerialOptions)));
        outcomes.push(await kit.outcome(port.open({ baudRate, bufferSize: 16_777_216 })));
        await port.close();
        return outcomes;
      }, id);
      expect(outcomes).toEqual([...Array(8).fill('TypeError'), 'resolves']);
    },
  },
  {
    name: 'open twice; close and signals while closed: InvalidStateError',
    run: async ({ realm, id }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        const closed = [port.close(), port.getSignals(), port.setSignals({ requestToSend: true })];
        const outcomes = await Promise.all(closed.map(kit.outcome));
        const first = port.open({ baudRate: 9600 });
        outcomes.push(await kit.outcome(port.open({ baudRate: 9600 })));
        await first;
        outcomes.push(await kit.outcome(port.open({ baudRate: 9600 })));
        await port.close();
        return outcomes;
      }, id);
      expect(outcomes).toEqual(Array(5).fill('InvalidStateError'));
    },
  },
  {
    name: 'readable and writable are null before open and after close',
    run: async ({ realm, id }) => {
      const found = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        const look = () => [port.readable === null, port.writable === null];
        const before = look();
        await port.open({ baudRate: 9600 });
        const [readable, writable] = [port.readable, port.writable];
        const again = [port.readable === readable, port.writable === writable];
        const during = [...look(), ...again];
        await port.close();
        return { before, during, after: look() };
      }, id);
      expect(found).toEqual({
        before: [true, true],
        during: [false, false, true, true],
        after: [true, true],
      });
    },
  },
  {
    name: 'close with a locked stream: TypeError, and the port stays open',
    run: async ({ realm, id, device }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const outcomes: string[] = [];
        for (const half of ['readable', 'writable'] as const) {
          const held = half === 'readable' ? port.readable?.getReader() : port.writable?.getWriter();
          outcomes.push(await kit.outcome(port.close()));
          held?.releaseLock();
        }
        const writer = port.writable?.getWriter();
        outcomes.push(await kit.outcome(writer?.write(Uint8Array.of(7))));
        writer?.releaseLock();
        outcomes.push(await kit.outcome(port.close()));
        return outcomes;
      }, id);
      expect(outcomes).toEqual(['TypeError', 'TypeError', 'resolves', 'resolves']);
      expect(device.received).toEqual([7]);
    },
  },
  {
    name: 'a port that somebody else has open: NetworkError',
    run: async ({ realm, id, port }) => {
      const open = () =>
        realm.evaluate(async (id) => kit.outcome((await kit.port(id)).open({ baudRate: 9600 })), id);
      port.isHeldElsewhere = true;
      expect(await open()).toBe('NetworkError');
      port.isHeldElsewhere = false;
      expect(await open()).toBe('resolves');
      expect(port.baudRates).toEqual([9600]);
    },
  },
  {
    name: 'signals: none given, TypeError; else they reach the device',
    run: async ({ realm, id, port }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const empty = await kit.outcome(port.setSignals({}));
        await port.setSignals({ dataTerminalReady: false, requestToSend: true });
        const signals = await port.getSignals();
        await port.close();
        return [empty, ...Object.keys(signals).sort()];
      }, id);
      const names = ['clearToSend', 'dataCarrierDetect', 'dataSetReady', 'ringIndicator'];
      expect(outcomes).toEqual(['TypeError', ...names]);
      expect(port.signals).toEqual({ dataTerminalReady: false, requestToSend: true });
    },
  },
  {
    name: 'signals on a terminal: NetworkError',
    options: { isTerminal: true },
    run: async ({ realm, id }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const calls = [port.getSignals(), port.setSignals({ break: true })];
        const outcomes = await Promise.all(calls.map(kit.outcome));
        await port.close();
        return outcomes;
      }, id);
      expect(outcomes).toEqual(['NetworkError', 'NetworkError']);
    },
  },
];

const LINE_ERRORS = [
  'BreakError',
  'FramingError',
  'ParityError',
  'BufferOverrunError',
  'UnknownError',
] as const;

const reading: readonly Row[] = [
  ...LINE_ERRORS.map(
    (error): Row => ({
      name: `${error} while reading ends the stream after what came before it; the next one goes on`,
      run: async ({ realm, id, port, device }) => {
        await realm.evaluate(async (id) => (await kit.port(id)).open({ baudRate: 9600 }), id);
        const read = realm.evaluate(async (id) => {
          const port = await kit.port(id);
          const first = port.readable;
          const reader = first?.getReader();
          const { value } = (await reader?.read()) ?? {};
          const outcome = await kit.outcome(reader?.read());
          reader?.releaseLock();
          const isNew = port.readable !== null && port.readable !== first;
          return { before: [...(value ?? [])], outcome, isNew, after: await kit.read(port, 2) };
        }, id);
        device.say(bytes(1, 2));
        await expect.poll(() => port.counts.toHost).toBe(2);
        port.lineError(error);
        device.say(bytes(3, 4));
        expect(await read).toEqual({ before: [1, 2], outcome: error, isNew: true, after: [3, 4] });
      },
    }),
  ),
  {
    name: 'reads into a buffer that is brought along',
    run: async ({ realm, id, device }) => {
      device.say(bytes(1, 2, 3, 4, 5), 0.05);
      const read = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const reader = port.readable?.getReader({ mode: 'byob' });
        const got: number[] = [];
        const sizes: number[] = [];
        let buffer = new ArrayBuffer(3);
        while (reader && got.length < 5) {
          const { value } = await reader.read(new Uint8Array(buffer));
          if (!value) break;
          got.push(...value);
          sizes.push(value.byteLength);
          buffer = value.buffer;
        }
        reader?.releaseLock();
        await port.close();
        return { got, largest: Math.max(...sizes) };
      }, id);
      expect(read).toEqual({ got: [1, 2, 3, 4, 5], largest: 3 });
    },
  },
  {
    name: 'what nobody reads stays with the device, beyond bufferSize; nothing is lost',
    run: async ({ realm, id, port, device }) => {
      await realm.evaluate(
        async (id) => void (await (await kit.port(id)).open({ baudRate: 9600, bufferSize: 64 })),
        id,
      );
      const all = Array.from({ length: 1000 }, (_, index) => index & 0xff);
      device.say(Uint8Array.from(all));
      await expect.poll(() => port.counts.toHost).toBe(64);
      const read = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        // Opened for reading only now, and still no more than the buffer had left the device.
        const got = await kit.read(port, 1000);
        await port.close();
        return got;
      }, id);
      expect(read).toEqual(all);
    },
  },
  {
    name: 'cancelling drops what has come; the next stream begins after it',
    run: async ({ realm, id, port, device }) => {
      await realm.evaluate(async (id) => void (await (await kit.port(id)).open({ baudRate: 9600 })), id);
      device.say(bytes(1, 2, 3));
      await expect.poll(() => port.counts.toHost).toBe(3);
      await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        const reader = port.readable?.getReader();
        // One of three: the rest waits in the port's buffer or in the stream.
        await reader?.cancel();
        reader?.releaseLock();
      }, id);
      device.say(bytes(9));
      const next = await realm.evaluate(async (id) => kit.read(await kit.port(id), 1), id);
      expect(next).toEqual([9]);
    },
  },
];

const writing: readonly Row[] = [
  {
    name: 'a system error while writing: UnknownError; a new stream replaces the old',
    run: async ({ realm, id, port, device }) => {
      port.holdBack(true);
      await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600, bufferSize: 16 });
        const writer = port.writable?.getWriter();
        kit.kept = {
          write: kit.outcome(writer?.write(new Uint8Array(64))),
          closed: kit.outcome(writer?.closed),
        };
      }, id);
      port.writeError();
      port.holdBack(false);
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        const outcomes = [await kit.kept['write'], await kit.kept['closed']];
        const writer = port.writable?.getWriter();
        outcomes.push(await kit.outcome(writer?.write(Uint8Array.of(5))));
        writer?.releaseLock();
        await kit.outcome(port.close());
        return outcomes;
      }, id);
      expect(outcomes).toEqual(['UnknownError', 'UnknownError', 'resolves']);
      expect(device.received.at(-1)).toBe(5);
    },
  },
  {
    name: 'writes wait where the device does not take what fills bufferSize',
    run: async ({ realm, id, port, device }) => {
      port.holdBack(true);
      const held = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600, bufferSize: 16 });
        const writer = port.writable?.getWriter();
        const small = await kit.now(writer?.write(new Uint8Array(16)) ?? Promise.reject());
        const large = writer?.write(Uint8Array.of(8)) ?? Promise.reject();
        kit.kept = { large: kit.outcome(large) };
        const now = await kit.now(large);
        writer?.releaseLock();
        return [small, now];
      }, id);
      expect(held).toEqual(['resolves', 'pending']);
      expect(device.received).toEqual([]);
      port.holdBack(false);
      expect(await realm.evaluate(() => kit.kept['large'])).toBe('resolves');
      await expect.poll(() => device.received.length).toBe(17);
    },
  },
  {
    name: 'writer.close() waits until everything is sent',
    run: async ({ realm, id, port, device }) => {
      port.holdBack(true);
      const held = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const writer = port.writable?.getWriter();
        await writer?.write(Uint8Array.of(1, 2, 3));
        const closing = writer?.close() ?? Promise.reject();
        kit.kept = { closing: kit.outcome(closing) };
        return await kit.now(closing);
      }, id);
      expect([held, device.received]).toEqual(['pending', []]);
      port.holdBack(false);
      expect(await realm.evaluate(() => kit.kept['closing'])).toBe('resolves');
      expect(device.received).toEqual([1, 2, 3]);
    },
  },
  {
    name: 'writer.abort() drops what is buffered',
    run: async ({ realm, id, port, device }) => {
      port.holdBack(true);
      const outcome = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600, bufferSize: 16 });
        const writer = port.writable?.getWriter();
        const write = writer?.write(new Uint8Array(64)).catch(() => 'dropped');
        const abort = await kit.outcome(writer?.abort());
        writer?.releaseLock();
        const next = port.writable?.getWriter();
        await next?.write(Uint8Array.of(6));
        return [abort, await write];
      }, id);
      port.holdBack(false);
      expect(outcome).toEqual(['resolves', 'dropped']);
      await expect.poll(() => device.received).toEqual([6]);
    },
  },
  {
    name: 'a detached buffer is written like an empty one; what is not bytes is a TypeError',
    run: async ({ realm, id, device }) => {
      const outcomes = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const data = Uint8Array.of(1, 2, 3);
        structuredClone(data.buffer, { transfer: [data.buffer] });
        const writer = port.writable?.getWriter();
        const outcomes = [await kit.outcome(writer?.write(data))];
        outcomes.push(await kit.outcome(writer?.write('text' as unknown as Uint8Array)));
        writer?.releaseLock();
        await kit.outcome(port.close());
        return outcomes;
      }, id);
      expect(outcomes).toEqual(['resolves', 'TypeError']);
      expect(device.received).toEqual([]);
    },
  },
];

const plugging: readonly Row[] = [
  {
    name: 'unplugged: reads and writer.closed reject, streams are null, disconnect bubbles, close resolves; plugged in again the same object opens',
    run: async ({ realm, id, port, bridge }) => {
      await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        const read = kit.outcome(port.readable?.getReader().read());
        const closed = kit.outcome(port.writable?.getWriter().closed);
        const seen: string[] = [];
        port.ondisconnect = (event) => seen.push(`port ${event.target === port} ${event.bubbles}`);
        const gone = new Promise<string>((resolve) => {
          const see = (event: Event) => resolve([...seen, `serial ${event.target === port}`].join(', '));
          navigator.serial.addEventListener('disconnect', see, { once: true });
        });
        const back = new Promise<string>((resolve) => {
          const see = (event: Event) => resolve(`serial ${event.target === port}`);
          navigator.serial.addEventListener('connect', see, { once: true });
        });
        Object.assign(globalThis, { lostPort: port });
        kit.kept = { read, closed, gone, back };
      }, id);
      bridge.unplug(port);
      const lost = await realm.evaluate(async () => {
        const port = (globalThis as unknown as { lostPort: SerialPort }).lostPort;
        const { read, closed, gone } = kit.kept;
        const outcomes = [await read, await closed, await gone];
        const streams = [port.readable, port.writable, port.connected];
        const isListed = (await navigator.serial.getPorts()).includes(port);
        return {
          outcomes,
          streams,
          isListed,
          ends: [await kit.outcome(port.close()), await kit.outcome(port.open({ baudRate: 9600 }))],
        };
      });
      expect(lost).toEqual({
        outcomes: ['NetworkError', 'NetworkError', 'port true true, serial true'],
        streams: [null, null, false],
        isListed: false,
        ends: ['resolves', 'NetworkError'],
      });
      bridge.replug(port);
      const again = await realm.evaluate(async (id) => {
        const port = (globalThis as unknown as { lostPort: SerialPort }).lostPort;
        const event = await kit.kept['back'];
        const isSame = (await kit.port(id)) === port;
        return [event, isSame, port.connected, await kit.outcome(port.open({ baudRate: 9600 }))];
      }, id);
      expect(again).toEqual(['serial true', true, true, 'resolves']);
    },
  },
  {
    name: 'a terminal that hangs up: reads reject, readable is null, no event, connected stays',
    options: { isTerminal: true },
    run: async ({ realm, id, port, bridge }) => {
      await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.open({ baudRate: 9600 });
        kit.kept = { read: kit.outcome(port.readable?.getReader().read()), event: Promise.resolve('none') };
        port.ondisconnect = () => {
          kit.kept['event'] = Promise.resolve('disconnect');
        };
      }, id);
      bridge.unplug(port);
      const found = await realm.evaluate(async (id) => {
        const read = await kit.kept['read'];
        const port = await kit.port(id);
        const streams = [port.readable, port.connected];
        return [read, ...streams, await kit.kept['event'], await kit.outcome(port.close())];
      }, id);
      expect(found).toEqual(['NetworkError', null, true, 'none', 'resolves']);
    },
  },
  {
    name: 'a forgotten port is no longer listed and does not open',
    run: async ({ realm, id, port }) => {
      const found = await realm.evaluate(async (id) => {
        const port = await kit.port(id);
        await port.forget();
        const isListed = (await navigator.serial.getPorts()).includes(port);
        return [isListed, await kit.outcome(port.open({ baudRate: 9600 }))];
      }, id);
      expect(found).toEqual([false, 'InvalidStateError']);
      expect(port.granted).toBe(false);
    },
  },
];

export const ROWS: readonly Row[] = [...opening, ...reading, ...writing, ...plugging];
