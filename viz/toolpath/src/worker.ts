/**
 * The view's worker: owns the OffscreenCanvas and the view, and does what messages say.
 *
 * Does not know: the page. A module worker; the first message must be `start`.
 */
import { carryOut, type View, type ViewEvent, type WorkerRequest } from './messages';
import { openView } from './open_view';
import { Source } from './source';

/** The part of a dedicated worker's global that is used here (the window's types are what is compiled against). */
interface WorkerScope {
  onmessage: ((message: MessageEvent<WorkerRequest>) => void) | null;
  postMessage(event: ViewEvent): void;
  close(): void;
}

const scope = self as unknown as WorkerScope;
let view: View | null = null;
const source = new Source((request) => view && carryOut(view, request));

function start({ canvas, size }: Extract<WorkerRequest, { type: 'start' }>): void {
  const started = openView(canvas, size, (event) => scope.postMessage(event));
  view = started.view;
  for (const event of started.events) scope.postMessage(event);
}

function receive({ data: request }: MessageEvent<WorkerRequest>): void {
  switch (request.type) {
    case 'start':
      return start(request);
    case 'source':
      return source.listen(request.port);
    case 'discard':
      return source.discard(request.before);
    case 'dispose':
      source.close();
      view?.dispose();
      return scope.close();
    default:
      if (view) carryOut(view, request);
  }
}

scope.onmessage = receive;
