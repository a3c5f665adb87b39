// What the machine worker needs of a port, whatever is behind it.
// Knows nothing of the protocol: bytes go in, bytes come out, and it says when it is gone.

/** Why a port is of no use any more. */
export type PortFailureCode = 'unplugged' | 'port-busy' | 'port-gone' | 'port-error';

export class PortError extends Error {
  readonly code: PortFailureCode;

  constructor(code: PortFailureCode, cause?: unknown) {
    super(code, { cause });
    this.name = 'PortError';
    this.code = code;
  }
}

/** Errors on the line that were recovered from, by what the browser calls them. */
export type LineErrorKind = 'break' | 'framing' | 'parity' | 'overrun' | 'system';
export type LineErrors = Readonly<Record<LineErrorKind, number>>;

export const NO_LINE_ERRORS: LineErrors = { break: 0, framing: 0, parity: 0, overrun: 0, system: 0 };

export const allLineErrors = (errors: LineErrors): number =>
  Object.values(errors).reduce((sum, count) => sum + count, 0);

export interface Transport {
  readonly readable: ReadableStream<Uint8Array<ArrayBuffer>>;
  readonly writable: WritableStream<Uint8Array<ArrayBuffer>>;
  /** Settles once, when the other end is gone; never after `close`. */
  readonly lost: Promise<PortError>;
  lineErrors(): LineErrors;
  close(): Promise<void>;
}
