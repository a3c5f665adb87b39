// The loop between a session and a real port, in real time.
//
// Host time is the worker's monotonic clock. Timers are the worker's: a hidden page does not slow them down.
import type { Transport } from '../transport/transport';
import type { Seconds } from '../units';
import type { Machine } from './machine';

export interface LoopOptions {
  readonly machine: Machine;
  readonly now: () => Seconds;
  /** Bytes as they come, for those who judge what is on the other end. */
  readonly onBytes: (bytes: Uint8Array) => void;
}

export class RealTimeLoop {
  readonly #transport: Transport;
  readonly #writer: WritableStreamDefaultWriter<Uint8Array<ArrayBuffer>>;
  readonly #reader: ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>>;
  readonly #options: LoopOptions;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** When the session wanted to be called at the latest. */
  #wake: Seconds | undefined;
  #stopped = false;
  #onFailure: (error: unknown) => void = () => undefined;

  constructor(transport: Transport, options: LoopOptions) {
    this.#transport = transport;
    this.#options = options;
    this.#writer = transport.writable.getWriter();
    this.#reader = transport.readable.getReader();
  }

  /** `onFailure` is told what was thrown by the machine. */
  start(onFailure: (error: unknown) => void): void {
    this.#onFailure = onFailure;
    void this.#read();
    this.tick();
  }

  async #read(): Promise<void> {
    for (;;) {
      // The transport tells by `lost` why there is nothing more to read.
      const { value } = await this.#reader.read().catch(() => ({ value: undefined }));
      if (!value || this.#stopped) return;
      this.#attempt(() => {
        this.#options.onBytes(value);
        this.#options.machine.receive(value, this.#options.now());
      });
      this.tick();
    }
  }

  #attempt(act: () => void): void {
    try {
      act();
    } catch (error) {
      this.#onFailure(error);
    }
  }

  /** Lets the session do what is due, now. */
  readonly tick = (): void => {
    if (!this.#stopped) this.#attempt(() => this.#turn());
  };

  #turn(): void {
    clearTimeout(this.#timer);
    const { machine, now } = this.#options;
    // After a stall bytes may come before the timer.
    if (this.#wake !== undefined) machine.woke((now() - this.#wake) as Seconds);
    const bytes = machine.poll(now());
    // Errors are told by the transport's `lost`; how much may be under way is bounded by the link's window.
    if (bytes.byteLength > 0) this.#writer.write(bytes).catch(() => undefined);
    this.#wake = machine.wake(now());
    this.#timer = setTimeout(this.tick, Math.max(0, (this.#wake - now()) * 1000));
  }

  async stop(): Promise<void> {
    if (this.#stopped) return;
    this.#stopped = true;
    clearTimeout(this.#timer);
    this.#reader.cancel().catch(() => undefined);
    await this.#transport.close();
  }
}
