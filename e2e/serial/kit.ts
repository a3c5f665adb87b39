// What the conformance spec uses inside a window or worker. Installed there as the global `kit`.
import type { Worker } from '@playwright/test';

export interface Kit {
  /** The allowed port with this USB product. */
  port(product: number): Promise<SerialPort>;
  /** The name of the error, or 'resolves'. */
  outcome(promise: Promise<unknown> | undefined): Promise<string>;
  /** 'pending' where nothing has come of it after a round trip to the device. */
  now(promise: Promise<unknown>): Promise<string>;
  /** Reads until there are so many bytes. */
  read(port: SerialPort, count: number): Promise<number[]>;
  /** Values that one step keeps for the next. */
  kept: Record<string, Promise<string>>;
}

/** A window or a worker. */
export type Realm = Pick<Worker, 'evaluate'>;

export async function installKit(realm: Realm): Promise<void> {
  await realm.evaluate(() => {
    const outcome = (promise: Promise<unknown> | undefined): Promise<string> =>
      Promise.resolve(promise).then(
        () => 'resolves',
        (error: unknown) => (error instanceof Error || error instanceof DOMException ? error.name : 'odd'),
      );
    const kit: Kit = {
      async port(product) {
        const ports = await navigator.serial.getPorts();
        const port = ports.find((one) => one.getInfo().usbProductId === product);
        if (!port) throw new Error(`port ${product} is not there`);
        return port;
      },
      outcome,
      async now(promise) {
        const settled = outcome(promise);
        await navigator.serial.getPorts();
        return await Promise.race([settled, Promise.resolve('pending')]);
      },
      async read(port, count) {
        const reader = port.readable?.getReader();
        const bytes: number[] = [];
        while (reader && bytes.length < count) {
          const { value, done } = await reader.read();
          if (done) break;
          bytes.push(...value);
        }
        reader?.releaseLock();
        return bytes;
      },
      kept: {},
    };
    Object.assign(globalThis, { kit });
  });
}
