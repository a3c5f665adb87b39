// A port of the bridge: a device behind a cable, with what tests do to it, and the realm that has it open.
//
// Time. A device has its own clock. While nobody shares it, it follows the real clock, `speed` times as fast. A realm
// with a clock of its own may share it (`shared`): then the device goes on only as far as the realm has nothing to do
// before, and the realm's clock follows the device's, at most `speed` times as fast as the real one.
import type { Device } from './device.ts';
import type { FromBridge, OpenOptions, OutputSignals, PortState, StreamErrorName } from './messages.ts';

/** Who has a port open. */
export interface Holder {
  tell(message: FromBridge): void;
  /** `clockMs` on the shared clock, NaN without one. */
  send(port: number, bytes: Uint8Array, clockMs: number): void;
}

export interface PortOptions {
  readonly vendor?: number;
  readonly product?: number;
  /** Allowed by the user before. */
  readonly granted?: boolean;
  /** How many of its seconds pass in a real one, at most. */
  readonly speed?: number;
  /** The realm's clock is the device's. */
  readonly shared?: boolean;
  /** A terminal: no signals, and it hangs up without a word of the cable. */
  readonly isTerminal?: boolean;
  /** Whether a second opening fails, as nearly everywhere. */
  readonly isExclusive?: boolean;
}

/** How often a free device catches up with the real clock, ms. */
const TICK_MS = 2;
/** Bytes of a device that shares its clock are gathered for so long, s of its time. */
const GATHER_S = 4e-3;
/** So far a device may go before the realm is asked again, s of its time: it may have been given something to do. */
const GRANT_MAX_S = 50e-3;
/** A free device that is faster than real time and further behind, s of real time, goes on from where it is. */
const BEHIND_MAX_S = 0.1;
/** Turns of a device in one advance. */
const TURNS_MAX = 1_000_000;
/** Bytes for a host that does not take them; beyond it they are lost, as in a terminal's buffer. */
const TO_HOST_MAX = 4 * 1024 * 1024;

type Item = { readonly due: number; readonly what: Uint8Array | StreamErrorName };

const realS = (): number => performance.now() / 1000;

export class BridgePort {
  readonly id: number;
  readonly device: Device;
  readonly options: PortOptions;
  granted: boolean;
  connected = true;
  /** Another program has it open. */
  isHeldElsewhere = false;
  /** Device to host: its bytes are lost. */
  isMute = false;
  /** s of the device's time that its bytes are on the way. */
  latencyS = 0;
  /** Share of bytes with a flipped bit, both ways. */
  corruptShare = 0;
  /** After so many bytes to the host one is lost to a framing error; 0 is never. */
  framingErrorEvery = 0;
  readonly counts = { toDevice: 0, toHost: 0, openings: 0, damaged: 0 };
  readonly baudRates: number[] = [];
  signals: OutputSignals = {};
  /** Called with all bytes as they reach the device. */
  onToDevice: ((bytes: Uint8Array) => void) | undefined;
  #holder: Holder | undefined;
  #credit = 0;
  #toHost: Item[] = [];
  #toHostBytes = 0;
  #toDevice: Uint8Array[] = [];
  #isHeldBack = false;
  #drained: (() => void)[] = [];
  #sinceError = 0;
  #chance = 12345;
  #anchor: { real: number; device: number };
  /** The device's time when its clock was shared; undefined while it is free. */
  #sharedSince: number | undefined;
  #speed: number;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** So far the realm lets time pass, ms on the shared clock. */
  #grantedMs: number | undefined;

  constructor(id: number, device: Device, options: PortOptions) {
    this.id = id;
    this.device = device;
    this.options = options;
    this.granted = options.granted ?? false;
    this.#speed = options.speed ?? 1;
    this.#anchor = { real: realS(), device: device.now() };
    this.#timer = setTimeout(this.#tick, TICK_MS);
  }

  get state(): PortState {
    const { vendor = null, product = null } = this.options;
    return { id: this.id, vendor, product, connected: this.connected, granted: this.granted };
  }

  get holder(): Holder | undefined {
    return this.#holder;
  }

  get isShared(): boolean {
    return this.#sharedSince !== undefined;
  }

  // --- the host's side ---

  open(holder: Holder, { baudRate }: OpenOptions): void {
    this.#holder = holder;
    this.#credit = 0;
    this.#toHost = [];
    this.#toHostBytes = 0;
    this.counts.openings += 1;
    this.baudRates.push(baudRate);
    this.#reanchor();
    this.device.opened?.(baudRate);
    if (this.options.shared) this.#share(holder);
  }

  close(): void {
    const holder = this.#holder;
    if (!holder) return;
    this.#free();
    this.#holder = undefined;
    this.discard();
    this.device.closed?.();
  }

  credit(bytes: number): void {
    this.#credit += bytes;
    this.#flush();
  }

  take(bytes: Uint8Array): void {
    if (!this.connected) return;
    this.#toDevice.push(this.#damaged(bytes));
    this.#pass();
  }

  /** Drops what waits for the device. */
  discard(): void {
    const bytes = this.#toDevice.reduce((sum, piece) => sum + piece.byteLength, 0);
    this.#toDevice = [];
    this.#taken(bytes);
  }

  /** Settles when the device has taken everything. */
  drain(): Promise<void> {
    return new Promise((resolve) => {
      this.#drained.push(resolve);
      this.#taken(0);
    });
  }

  #taken(bytes: number): void {
    if (bytes > 0) this.#holder?.tell({ kind: 'taken', port: this.id, bytes });
    if (this.#toDevice.length > 0) return;
    for (const resolve of this.#drained.splice(0)) resolve();
  }

  #pass(): void {
    if (this.#isHeldBack) return;
    for (const piece of this.#toDevice.splice(0)) {
      this.counts.toDevice += piece.byteLength;
      this.onToDevice?.(piece);
      this.device.write(piece);
      this.#taken(piece.byteLength);
    }
    this.#taken(0);
  }

  // --- what tests do to it ---

  /** The cable comes out. A terminal's other end hangs up instead. */
  unplug(): void {
    const holder = this.#holder;
    this.#free();
    if (!this.options.isTerminal) this.connected = false;
    this.#toHost = [];
    this.#toHostBytes = 0;
    this.discard();
    this.#holder = undefined;
    this.device.closed?.();
    holder?.tell({ kind: 'lost', port: this.id });
  }

  replug(): void {
    this.connected = true;
  }

  /** An error on the line, after what has been sent. */
  lineError(what: StreamErrorName): void {
    this.#push(what);
    this.#flush();
  }

  /** The system refuses a write: what waits is dropped. */
  writeError(): void {
    this.discard();
    this.#holder?.tell({ kind: 'write-error', port: this.id });
  }

  /** The device takes no more bytes, or takes them again. */
  holdBack(isHeldBack: boolean): void {
    this.#isHeldBack = isHeldBack;
    this.#pass();
  }

  /** From now on so many of the device's seconds pass in a real one, at most. */
  setSpeed(speed: number): void {
    this.#speed = speed;
    this.#reanchor();
  }

  /** From now on realm and device go on in real time, each by its own clock. */
  goOnInRealTime(): void {
    this.#speed = 1;
    this.#reanchor();
    this.#free();
  }

  /** Ends its time. */
  powerDown(): void {
    this.#free();
    clearTimeout(this.#timer);
  }

  // --- bytes to the host ---

  #push(what: Uint8Array | StreamErrorName): void {
    if (!this.#holder || !this.connected || this.isMute) return;
    const size = typeof what === 'string' ? 0 : what.byteLength;
    if (this.#toHostBytes + size > TO_HOST_MAX) return;
    this.#toHostBytes += size;
    this.#toHost.push({ due: this.device.now() + this.latencyS, what });
  }

  #flush(): void {
    const now = this.device.now();
    for (let item = this.#toHost[0]; item && item.due <= now; item = this.#toHost[0]) {
      if (typeof item.what === 'string') {
        this.#toHost.shift();
        this.#holder?.tell({ kind: 'read-error', port: this.id, name: item.what });
        continue;
      }
      if (this.#credit === 0) return;
      const piece = item.what.subarray(0, this.#credit);
      if (piece.byteLength === item.what.byteLength) this.#toHost.shift();
      else this.#toHost[0] = { due: item.due, what: item.what.subarray(piece.byteLength) };
      this.#credit -= piece.byteLength;
      this.#toHostBytes -= piece.byteLength;
      this.counts.toHost += piece.byteLength;
      this.#holder?.send(this.id, piece, this.#sharedMs());
    }
  }

  #said(bytes: Uint8Array): void {
    if (bytes.byteLength === 0) return;
    const every = this.framingErrorEvery;
    let rest = this.#damaged(bytes);
    while (every > 0 && this.#sinceError + rest.byteLength > every) {
      const good = every - this.#sinceError;
      if (good > 0) this.#push(rest.subarray(0, good));
      this.#push('FramingError');
      this.counts.damaged += 1;
      rest = rest.subarray(good + 1);
      this.#sinceError = 0;
    }
    this.#sinceError += rest.byteLength;
    if (rest.byteLength > 0) this.#push(rest);
  }

  #damaged(bytes: Uint8Array): Uint8Array {
    if (this.corruptShare === 0) return bytes.slice();
    return bytes.map((byte) => {
      // A linear congruence: the same bits flip in every run.
      this.#chance = (this.#chance * 1_103_515_245 + 12_345) % 2 ** 31;
      const isHit = this.#chance / 2 ** 31 < this.corruptShare;
      if (isHit) this.counts.damaged += 1;
      return isHit ? byte ^ (1 << (this.#chance & 7)) : byte;
    });
  }

  // --- time ---

  #advance(untilS: number): void {
    let until = untilS;
    for (let turn = 0; this.device.now() < until; turn += 1) {
      if (turn >= TURNS_MAX) throw new Error('a device does not get on');
      const bytes = this.device.runUntil(until);
      this.#said(bytes);
      if (this.isShared && bytes.byteLength > 0) until = Math.min(until, this.device.now() + GATHER_S);
    }
    this.#flush();
  }

  #limit(): number {
    const { real, device } = this.#anchor;
    // Before anybody has opened it nothing happens that would be worth the work.
    const speed = this.counts.openings === 0 ? Math.min(1, this.#speed) : this.#speed;
    return device + (realS() - real) * speed;
  }

  #reanchor(): void {
    this.#anchor = { real: realS(), device: this.device.now() };
  }

  readonly #tick = (): void => {
    if (this.isShared) this.#round();
    else {
      this.#advance(this.#limit());
      // Who is faster than real time need not make up for what the computer cannot do.
      const speed = this.#speed;
      if (speed > 1 && this.#limit() - this.device.now() > BEHIND_MAX_S * speed) this.#reanchor();
    }
    this.#timer = setTimeout(this.#tick, TICK_MS);
  };

  #sharedMs(): number {
    return this.#sharedSince === undefined ? Number.NaN : (this.device.now() - this.#sharedSince) * 1000;
  }

  #share(holder: Holder): void {
    this.#sharedSince = this.device.now();
    this.#reanchor();
    holder.tell({ kind: 'clock-shared' });
    holder.tell({ kind: 'turn', passed: 0 });
  }

  #free(): void {
    if (!this.isShared) return;
    this.#sharedSince = undefined;
    this.#grantedMs = undefined;
    this.#reanchor();
    this.#holder?.tell({ kind: 'clock-free' });
  }

  /** The realm has nothing to do before this time on the shared clock, ms. */
  idle(untilMs: number): void {
    if (this.#sharedSince === undefined) return;
    this.#grantedMs = untilMs;
    this.#round();
  }

  /** The device goes on as far as the realm and the speed allow, then it is the realm's turn. */
  #round(): void {
    const granted = this.#grantedMs;
    if (granted === undefined || this.#sharedSince === undefined) return;
    const now = this.device.now();
    const wanted = this.#sharedSince + granted / 1000;
    const until = Math.max(now, Math.min(wanted, now + GRANT_MAX_S));
    // The next tick comes back to it.
    if (until > this.#limit()) return;
    this.#grantedMs = undefined;
    this.#advance(until);
    // What the realm waits for has come where it has: seconds and milliseconds round in their own ways.
    const isThere = this.device.now() >= wanted;
    this.#holder?.tell({ kind: 'turn', passed: Math.max(this.#sharedMs(), isThere ? granted : 0) });
  }
}
