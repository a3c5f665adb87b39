/**
 * Requests from a worker that makes vertices, each with the job that it belongs to.
 *
 * A job is the reading of one file; later ones have greater numbers. What is still on its way of a job that was put away
 * is dropped, whichever of the two channels is the faster. Does not know: what the requests do.
 */
import type { SourcedRequest, ViewRequest } from './messages';

export class Source {
  readonly #carryOut: (request: ViewRequest) => void;
  #job = 0;
  #port: MessagePort | null = null;

  constructor(carryOut: (request: ViewRequest) => void) {
    this.#carryOut = carryOut;
  }

  /** From now on requests come from here; a port from before is closed. */
  listen(port: MessagePort): void {
    this.close();
    this.#port = port;
    port.onmessage = ({ data }: MessageEvent<SourcedRequest>) => this.#take(data);
  }

  /** What comes of jobs before this one is not wanted any more; what is there of them goes. */
  discard(before: number): void {
    if (before <= this.#job) return;
    this.#turnTo(before);
  }

  close(): void {
    this.#port?.close();
    this.#port = null;
  }

  #take({ job, request }: SourcedRequest): void {
    if (job < this.#job) return;
    if (job > this.#job && request.type !== 'begin') return;
    if (job > this.#job) this.#turnTo(job);
    this.#carryOut(request);
  }

  /** What is there of jobs before goes, and all that comes is looked at. */
  #turnTo(job: number): void {
    this.#job = job;
    this.#carryOut({ type: 'clear' });
    this.#carryOut({ type: 'fit' });
  }
}
