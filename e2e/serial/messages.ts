// What the double of the Web Serial API, in the browser's realms, and the bridge in the test process say to each other.
// Shapes only. Bytes travel as binary frames of their own: one byte for the port, eight for the time on the shared
// clock (ms since it was shared, float64, little endian; NaN without one), then the data.

export const FRAME_HEADER_BYTES = 9;
/** Where the bridge listens, on the origin of the page. */
export const BRIDGE_PATH = '/device-bridge';

/** A port as a realm may know it. */
export interface PortState {
  readonly id: number;
  readonly vendor: number | null;
  readonly product: number | null;
  readonly connected: boolean;
  /** Whether the user has allowed this origin to use it. */
  readonly granted: boolean;
}

/** Errors after which the browser offers a new stream. */
export type StreamErrorName =
  | 'BreakError'
  | 'FramingError'
  | 'ParityError'
  | 'BufferOverrunError'
  | 'UnknownError';

export interface OpenOptions {
  readonly baudRate: number;
  readonly bufferSize: number;
}

export interface Filter {
  readonly usbVendorId?: number;
  readonly usbProductId?: number;
}

export interface OutputSignals {
  readonly dataTerminalReady?: boolean;
  readonly requestToSend?: boolean;
  readonly break?: boolean;
}

export interface InputSignals {
  readonly dataCarrierDetect: boolean;
  readonly clearToSend: boolean;
  readonly ringIndicator: boolean;
  readonly dataSetReady: boolean;
}

/** What gets an answer. */
export type Ask =
  | { readonly kind: 'ports' }
  | { readonly kind: 'request'; readonly filters: readonly Filter[] }
  | { readonly kind: 'open'; readonly port: number; readonly options: OpenOptions }
  | { readonly kind: 'close' | 'forget' | 'drain' | 'get-signals'; readonly port: number }
  | { readonly kind: 'set-signals'; readonly port: number; readonly signals: OutputSignals };

export interface Failure {
  readonly name: string;
  readonly message: string;
}

/** A port's number for `request`, signals for `get-signals`, else nothing. */
export type Value = number | InputSignals | null;

export type ToBridge =
  | { readonly kind: 'ask'; readonly id: number; readonly ask: Ask }
  /** So many more bytes of the device have room in the realm. */
  | { readonly kind: 'credit'; readonly port: number; readonly bytes: number }
  /** What waits for the device is dropped. */
  | { readonly kind: 'discard'; readonly port: number }
  /** Nothing will happen in the realm before this time on the shared clock, ms; infinite times are cut off. */
  | { readonly kind: 'idle'; readonly until: number };

export type FromBridge =
  | { readonly kind: 'ports'; readonly ports: readonly PortState[] }
  | { readonly kind: 'answer'; readonly id: number; readonly value: Value; readonly failure: Failure | null }
  /** The cable came or went. */
  | { readonly kind: 'plug'; readonly port: number; readonly connected: boolean }
  | { readonly kind: 'read-error'; readonly port: number; readonly name: StreamErrorName }
  | { readonly kind: 'write-error'; readonly port: number }
  /** Both streams end for good. */
  | { readonly kind: 'lost'; readonly port: number }
  /** So many bytes left the realm's buffer. */
  | { readonly kind: 'taken'; readonly port: number; readonly bytes: number }
  /** From now on time passes only with `turn`. */
  | { readonly kind: 'clock-shared' }
  /** It is this late on the shared clock, ms: do what is due and say when there is more. */
  | { readonly kind: 'turn'; readonly passed: number }
  | { readonly kind: 'clock-free' };
