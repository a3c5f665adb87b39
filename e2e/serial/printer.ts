// The virtual printer as a device: the product's own firmware and a simulated machine, with a record of its own.
// Knows nothing of the host. Times in s since it was powered up.
import type { Device } from './device.ts';
import { bindings, sampleConfig, type VirtualPrinter, type VirtualState } from './planner.ts';

/** How the motors stood at a time. */
export interface Sample {
  readonly timeS: number;
  /** X, Y, Z, extruder: pulses so far, both ways. */
  readonly pulses: readonly number[];
  /** The same: where the loads stand. */
  readonly mm: readonly number[];
}

export interface PrinterOptions {
  readonly config?: string;
  readonly seed?: number;
  readonly faults?: string;
  /** Its motors are looked at so often, s. */
  readonly sampleS?: number;
  /** The rate of its UART; at another one both sides get noise. Left out: USB, any rate. */
  readonly baudRate?: number;
}

const SAMPLE_S = 0.5;
const SAMPLES_MAX = 100_000;

/** What a UART makes of bytes at another rate: bytes that have little to do with them, but always the same. */
const garbled = (bytes: Uint8Array): Uint8Array =>
  bytes.map((byte, index) => ((byte * 73 + index * 31) & 0xff) | 0x80);

export class PrinterDevice implements Device {
  readonly #printer: VirtualPrinter;
  readonly #options: PrinterOptions;
  readonly samples: Sample[] = [];
  #nextSample = 0;
  #isGarbled = false;
  #isDead = false;
  #dieAfter: number | undefined;

  constructor(options: PrinterOptions = {}) {
    const { config = sampleConfig(), seed = 7, faults = '' } = options;
    this.#options = options;
    this.#printer = new (bindings().VirtualPrinter)(config, undefined, seed, faults);
  }

  now(): number {
    return this.#printer.now_s();
  }

  /** The machine as an onlooker sees it. */
  state(): VirtualState {
    return JSON.parse(this.#printer.state()) as VirtualState;
  }

  opened(baudRate: number): void {
    const own = this.#options.baudRate;
    this.#isGarbled = own !== undefined && own !== baudRate;
  }

  write(bytes: Uint8Array): void {
    if (!this.#isDead) this.#printer.write(this.#isGarbled ? garbled(bytes) : bytes);
  }

  /** After so many more bytes to the host the board says nothing more and hears nothing more. */
  dieAfter(bytes: number): void {
    this.#dieAfter = bytes;
  }

  runUntil(untilS: number): Uint8Array {
    const bytes = this.#printer.run_until_s(Math.min(untilS, this.#nextSample));
    if (this.now() >= this.#nextSample) this.#sample();
    return this.#isGarbled ? garbled(bytes) : this.#dying(bytes);
  }

  #dying(bytes: Uint8Array): Uint8Array {
    if (this.#isDead) return new Uint8Array();
    if (this.#dieAfter === undefined) return bytes;
    const rest = bytes.subarray(0, this.#dieAfter);
    this.#dieAfter -= rest.byteLength;
    this.#isDead = this.#dieAfter === 0;
    return rest;
  }

  #sample(): void {
    this.#nextSample = this.now() + (this.#options.sampleS ?? SAMPLE_S);
    const { motors } = this.state();
    const pulses = motors.map((motor) => motor.pulses);
    this.samples.push({ timeS: this.now(), pulses, mm: motors.map((motor) => motor.position_mm) });
    if (this.samples.length > SAMPLES_MAX) this.samples.shift();
  }
}
