// Workers that do nothing but what a test has them say.
import { vi } from 'vitest';

export class FakeWorker<From, To> {
  readonly sent: To[] = [];
  isTerminated = false;
  onmessage: ((event: { data: From }) => void) | null = null;
  onerror: ((event: { message?: string; preventDefault(): void }) => void) | null = null;

  postMessage(message: To): void {
    this.sent.push(message);
  }
  terminate(): void {
    this.isTerminated = true;
  }
  say(message: From): void {
    this.onmessage?.({ data: message });
  }
  /** An error that it did not catch; without a text its script could not be loaded. */
  fail(message?: string): void {
    this.onerror?.({ ...(message === undefined ? {} : { message }), preventDefault: () => undefined });
  }
}

/** All workers that are made from now on, in order. */
export function fakeWorkers<From, To>(): FakeWorker<From, To>[] {
  const all: FakeWorker<From, To>[] = [];
  vi.stubGlobal(
    'Worker',
    class extends FakeWorker<From, To> {
      constructor() {
        super();
        all.push(this);
      }
    },
  );
  return all;
}
