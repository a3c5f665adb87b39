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

export interface Transport {
  readonly readable: ReadableStream<Uint8Array<ArrayBuffer>>;
  readonly writable: WritableStream<Uint8Array<ArrayBuffer>>;
  /** Settles once, when the other end is gone; never after `close`. */
  readonly lost: Promise<PortError>;
  /** Errors on the line that were recovered from (framing, overrun …). */
  lineErrors(): number;
  close(): Promise<void>;
}
