/**
 * The view's worker: owns the OffscreenCanvas and the view, and does what messages say.
 *
 * Does not know: the page. A module worker; the first message must be `start`.
 */
import { carryOut, type ViewEvent, type WorkerRequest } from './messages';
import { Source } from './source';
import { ToolpathView } from './view';

/** The part of a dedicated worker's global that is used here (the window's types are what is compiled against). */
interface WorkerScope {
  onmessage: ((message: MessageEvent<WorkerRequest>) => void) | null;
  postMessage(event: ViewEvent): void;
  close(): void;
}

const scope = self as unknown as WorkerScope;
let view: ToolpathView | null = null;
const source = new Source((request) => view && carryOut(view, request));

function start(request: Extract<WorkerRequest, { type: 'start' }>): void {
  try {
    view = new ToolpathView(request.canvas, request.size, (event) => scope.postMessage(event));
    scope.postMessage({ type: 'ready' });
  } catch (error) {
    scope.postMessage({ type: 'failed', reason: error instanceof Error ? error.message : String(error) });
  }
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
