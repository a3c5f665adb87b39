// The preview worker: reads a file through the planner's preview and hands out geometry, findings and estimates. Also
// checks printer.cfg texts. One file at a time: a new one ends the reading of the one before.
import { FileChunks, linesOf } from '../files';
import { fileUnreadable, plannerMissing } from '../machine/troubles';
import { type FilePreview, loadReader, type Reader } from './planner';
import type { FromPreview, ToPreview } from './protocol';

/** Progress is told this often at most, in ms. */
const PROGRESS_MS = 50;

const scope = self as unknown as { postMessage(message: FromPreview, transfer?: Transferable[]): void };
const tell = (message: FromPreview, transfer: Transferable[] = []): void =>
  scope.postMessage(message, transfer);

let loading: Promise<Reader> | undefined;
let current = 0;

function load(): Promise<Reader> {
  loading ??= loadReader();
  return loading;
}

/** Without a machine where its file has errors: the picture is the same, and nothing can be printed with it anyway. */
function openPreview(reader: Reader, config: string | null): FilePreview {
  try {
    return reader.preview(config);
  } catch (error) {
    if (config === null || reader.asTrouble(error) === null) throw error;
    return reader.preview(null);
  }
}

async function read(
  reader: Reader,
  { job, file, name, config }: ToPreview & { kind: 'open' },
): Promise<void> {
  const chunks = await FileChunks.open(file);
  const first = await chunks.next();
  const refusal = reader.refuse(first ?? new Uint8Array(), name.replace(/\.gz$/i, ''));
  if (refusal) {
    await chunks.cancel();
    return tell({ kind: 'failed', job, trouble: refusal });
  }
  const preview = openPreview(reader, config);
  const pass = (): void => {
    for (;;) {
      const vertices = preview.takeVertices();
      const marks = preview.takeMarks();
      if (marks.length > 0) tell({ kind: 'marks', job, marks }, [marks.buffer]);
      const steps = preview.takeLineSteps();
      if (steps.length > 0) tell({ kind: 'line-steps', job, steps }, [steps.buffer]);
      const thumbnails = preview.takeThumbnails();
      if (thumbnails.length > 0) tell({ kind: 'thumbnails', job, thumbnails });
      if (vertices.length === 0) return;
      tell({ kind: 'vertices', job, vertices }, [vertices.buffer]);
    }
  };
  const feed = (chunk: Uint8Array): void => {
    for (let rest = chunk; rest.byteLength > 0; ) {
      const piece = rest.subarray(0, preview.wants());
      if (piece.byteLength === 0) throw new Error('the preview wants nothing more');
      preview.feed(piece);
      pass();
      rest = rest.subarray(piece.byteLength);
    }
  };
  try {
    let told = 0;
    tell({ kind: 'begun', job, header: preview.header() });
    for (let chunk = first; chunk; chunk = await chunks.next()) {
      if (current !== job) return;
      feed(chunk);
      if (performance.now() - told > PROGRESS_MS) {
        told = performance.now();
        tell({ kind: 'progress', job, bytes: chunks.bytesRead });
      }
    }
    preview.finish();
    pass();
    tell({ kind: 'summary', job, summary: preview.summary() });
  } finally {
    preview.free();
    await chunks.cancel();
  }
}

async function open(message: ToPreview & { kind: 'open' }): Promise<void> {
  current = message.job;
  let reader: Reader;
  try {
    reader = await load();
  } catch (error) {
    return tell({ kind: 'failed', job: message.job, trouble: plannerMissing(error) });
  }
  try {
    await read(reader, message);
  } catch (error) {
    tell({ kind: 'failed', job: message.job, trouble: reader.asTrouble(error) ?? fileUnreadable(error) });
  }
}

async function checkConfig({ id, text }: ToPreview & { kind: 'check-config' }): Promise<void> {
  try {
    tell({ kind: 'config', id, report: (await load()).checkConfig(text) });
  } catch (error) {
    tell({ kind: 'failed', job: null, trouble: plannerMissing(error) });
  }
}

/** The last question for lines. */
let asked = 0;

async function tellLines({ id, file, first, last }: ToPreview & { kind: 'lines' }): Promise<void> {
  asked = id;
  const texts = await linesOf(file, first, last, () => asked === id).catch(() => []);
  if (asked === id) tell({ kind: 'lines', id, texts });
}

self.onmessage = ({ data }: MessageEvent<ToPreview>): void => {
  if (data.kind === 'open') void open(data);
  else if (data.kind === 'lines') void tellLines(data);
  else void checkConfig(data);
};

load().then(
  () => tell({ kind: 'loaded' }),
  (error: unknown) => tell({ kind: 'failed', job: null, trouble: plannerMissing(error) }),
);
