// What is at the other end of a cable, in time of its own: nothing happens in it but while time is let pass.
// Knows neither browsers nor ports. Times are in seconds since it was powered up.

export interface Device {
  now(): number;
  /** The host opened or closed the port. */
  opened?(baudRate: number): void;
  closed?(): void;
  /** Bytes from the host come now. */
  write(bytes: Uint8Array): void;
  /** Lets time pass until `untilS`, or until there are bytes for the host; returns those. */
  runUntil(untilS: number): Uint8Array;
}

/** Says something at a time, s. */
interface Saying {
  readonly at: number;
  readonly bytes: Uint8Array;
}

/** Bytes that wait to be said; more than this is a mistake in a script. */
const SAYINGS_MAX = 100_000;

/** A device that does what a script says: a few lines of text, noise, nothing. */
export class ScriptedDevice implements Device {
  #now = 0;
  #sayings: Saying[] = [];
  readonly #onOpen: (device: ScriptedDevice, baudRate: number) => void;
  readonly #onBytes: (device: ScriptedDevice, bytes: Uint8Array) => void;
  /** All that the host sent. */
  readonly received: number[] = [];

  constructor(
    onOpen: (device: ScriptedDevice, baudRate: number) => void = () => undefined,
    onBytes: (device: ScriptedDevice, bytes: Uint8Array) => void = () => undefined,
  ) {
    this.#onOpen = onOpen;
    this.#onBytes = onBytes;
  }

  now(): number {
    return this.#now;
  }

  opened(baudRate: number): void {
    this.#onOpen(this, baudRate);
  }

  write(bytes: Uint8Array): void {
    for (const byte of bytes) this.received.push(byte);
    this.#onBytes(this, bytes);
  }

  /** Bytes, or text in Latin-1, for the host after so many seconds. */
  say(what: string | Uint8Array, afterS = 0): void {
    if (this.#sayings.length >= SAYINGS_MAX) throw new Error('a scripted device says too much');
    const bytes = typeof what === 'string' ? Buffer.from(what, 'latin1') : what;
    this.#sayings.push({ at: this.#now + afterS, bytes });
    this.#sayings.sort((one, other) => one.at - other.at);
  }

  runUntil(untilS: number): Uint8Array {
    const next = this.#sayings[0];
    if (!next || next.at > untilS) {
      this.#now = Math.max(this.#now, untilS);
      return new Uint8Array();
    }
    this.#sayings.shift();
    this.#now = Math.max(this.#now, next.at);
    return next.bytes;
  }
}
