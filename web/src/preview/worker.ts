// The preview worker: reads a file through the planner's preview, twice: for the geometry, which is soon there, and for
// times, findings and the planner's channels. Also checks printer.cfg texts. One file at a time: a new one ends the reading of
// the one before.
import type { Layer, SourcedRequest, ViewRequest } from '@stepcast/toolpath';
import { FileChunks, linesOf, type Packing, packingOf } from '../files';
import type { Trouble } from '../machine/protocol';
import { fileUnreadable, plannerMissing } from '../machine/troubles';
import { LineIndex } from './line_index';
import { type FilePreview, loadReader, type Reader } from './planner';
import type { FromPreview, Summary, ToPreview } from './protocol';
import { SlicedFile } from './sliced_file';
import { Unpacked } from './unpacked';

/**
 * Progress is told this often at most, in ms, and where lines lie on the path: each time, the page puts a picture of itself
 * together, and where the processor does that, it is taken from the reading.
 */
const PROGRESS_MS = 400;

const scope = self as unknown as { postMessage(message: FromPreview, transfer?: Transferable[]): void };
const tell = (message: FromPreview, transfer: Transferable[] = []): void =>
  scope.postMessage(message, transfer);

let loading: Promise<Reader> | undefined;
let current = 0;

function load(): Promise<Reader> {
  loading ??= loadReader();
  return loading;
}

/** A file's geometry, and the machine that it is for. */
interface Geometry {
  readonly preview: FilePreview;
  /** Null: there is none, or its file has errors. The picture is the same, and nothing can be printed with it anyway. */
  readonly config: string | null;
}

function openGeometry(reader: Reader, config: string | null): Geometry {
  try {
    if (config !== null) return { preview: reader.outline(config), config };
  } catch (error) {
    if (reader.asTrouble(error) === null) throw error;
  }
  return { preview: reader.preview(null), config: null };
}

/** The 3D view, where there is one. */
let drawing: MessagePort | undefined;

function draw(job: number, request: ViewRequest, transfer: Transferable[] = []): void {
  const message: SourcedRequest = { job, request };
  drawing?.postMessage(message, transfer);
}

/** The file that is open, for questions about its text. */
interface Opened {
  readonly job: number;
  readonly file: Blob;
  readonly index: LineIndex;
  /** Of a packed file, as far as it has been read; null where it is none. */
  readonly unpacked: Unpacked | null;
}
let opened: Opened | undefined;

/** Where the lines of the open file lie on the path, as far as the page has not been told. */
let places: { readonly job: number; readonly marks: Numbers32[]; readonly steps: Numbers8[] } | undefined;
type Numbers32 = Uint32Array<ArrayBuffer>;
type Numbers8 = Uint8Array<ArrayBuffer>;

function tellPlaces(): void {
  if (!places) return;
  const { job, marks, steps } = places;
  places = undefined;
  tell(
    { kind: 'places', job, marks, steps },
    [...marks, ...steps].map(({ buffer }) => buffer),
  );
}

function takePlaces(preview: FilePreview, job: number): void {
  const marks = preview.takeMarks();
  const steps = preview.takeLineSteps();
  if (marks.length === 0 && steps.length === 0) return;
  if (places?.job !== job) places = { job, marks: [], steps: [] };
  places.marks.push(marks);
  places.steps.push(steps);
}

/** Hands out what came of the bytes that were fed. */
function pass(preview: FilePreview, job: number): void {
  for (;;) {
    const vertices = preview.takeVertices();
    takePlaces(preview, job);
    const thumbnails = preview.takeThumbnails();
    if (thumbnails.length > 0) tell({ kind: 'thumbnails', job, thumbnails });
    if (vertices.length === 0) return;
    draw(job, { type: 'append', vertices }, [vertices.buffer]);
  }
}

/** Has the planner work on the bytes that were fed, and hands out what it knows by now. */
function plan(preview: FilePreview, job: number): void {
  preview.readOn();
  const words = preview.takeChannels();
  if (words.length > 0) draw(job, { type: 'appendChannels', words }, [words.buffer]);
}

function feed(preview: FilePreview, job: number, chunk: Uint8Array, work: typeof pass): void {
  for (let rest = chunk; rest.byteLength > 0; ) {
    const piece = rest.subarray(0, preview.wants());
    if (piece.byteLength === 0) throw new Error('the preview wants nothing more');
    preview.feed(piece);
    work(preview, job);
    rest = rest.subarray(piece.byteLength);
  }
}

/** By the way of the vertices, so that they come after these, whatever the view is busy with. */
function layersOf({ layers, time }: Summary): Layer[] {
  return layers.map(({ first, z, time: timeS }) => ({
    firstVertex: first,
    zMm: z,
    ...(time === null ? {} : { timeS }),
  }));
}

/** Tells how far the reading is, now and then; `share` 0 … 1. */
function progress(job: number): (share: number, lines: number) => void {
  let told = 0;
  return (share, lines) => {
    if (performance.now() - told <= PROGRESS_MS) return;
    told = performance.now();
    tellPlaces();
    tell({ kind: 'progress', job, share, lines });
  };
}

/** Of the whole reading, in time. */
const GEOMETRY_SHARE = 0.35;

/** The geometry as it is read, and the outline at its end; null where the file was put away meanwhile. */
async function readGeometry(chunks: Chunks, preview: FilePreview, open: Opened): Promise<Summary | null> {
  const { job, file, index, unpacked } = open;
  const told = progress(job);
  draw(job, { type: 'begin', header: preview.header() });
  for (let chunk = await chunks.next(); chunk; chunk = await chunks.next()) {
    if (current !== job) return null;
    index.add(chunk);
    unpacked?.add(chunk);
    feed(preview, job, chunk, pass);
    told((GEOMETRY_SHARE * chunks.bytesRead) / Math.max(1, file.size), index.lines);
  }
  preview.finish();
  pass(preview, job);
  tellPlaces();
  const outline = preview.summary();
  draw(job, { type: 'setLayers', layers: layersOf(outline) });
  draw(job, { type: 'end' });
  tell({ kind: 'outline', job, outline });
  return outline;
}

/** What the planner knows of it, and the summary. It takes longer, so it comes behind the geometry. */
async function readPlan(chunks: Chunks, preview: FilePreview, open: Opened): Promise<void> {
  const { job, file, index } = open;
  const told = progress(job);
  for (let chunk = await chunks.next(); chunk; chunk = await chunks.next()) {
    if (current !== job) return;
    feed(preview, job, chunk, plan);
    told(GEOMETRY_SHARE + ((1 - GEOMETRY_SHARE) * chunks.bytesRead) / Math.max(1, file.size), index.lines);
  }
  preview.finish();
  plan(preview, job);
  const summary = preview.summary();
  draw(job, { type: 'setLayers', layers: layersOf(summary) });
  tell({ kind: 'summary', job, summary });
}

type Chunks = Pick<FileChunks, 'next' | 'bytesRead'>;

/** Reads the open file from its beginning with this preview. */
async function through<T>(
  open: Opened,
  preview: FilePreview,
  read: (chunks: Chunks, preview: FilePreview, open: Opened) => Promise<T>,
): Promise<T> {
  try {
    if (!open.unpacked) return await read(new SlicedFile(open.file), preview, open);
    const chunks = await FileChunks.open(open.file, 'gzip');
    try {
      return await read(chunks, preview, open);
    } finally {
      await chunks.cancel();
    }
  } finally {
    preview.free();
  }
}

/** What stands against reading the file, by its first bytes. */
async function refusalOf(
  reader: Reader,
  file: Blob,
  packing: Packing,
  name: string,
): Promise<Trouble | null> {
  const chunks = await FileChunks.open(file, packing);
  const first = await chunks.next();
  await chunks.cancel();
  return reader.refuse(first ?? new Uint8Array(), name.replace(/\.gz$/i, ''));
}

/** Until the page has shown the outline, it has the processor to itself: it is not held up by what nobody waits for yet. */
let waiting: { readonly job: number; readonly go: () => void } | undefined;

async function read(
  reader: Reader,
  { job, file, name, config: machine }: ToPreview & { kind: 'open' },
): Promise<void> {
  const packing = await packingOf(file);
  const refusal = await refusalOf(reader, file, packing, name);
  if (refusal) return tell({ kind: 'failed', job, trouble: refusal });
  if (current !== job) return;
  const unpacked = packing === 'gzip' ? new Unpacked() : null;
  const open = { job, file, index: new LineIndex(), unpacked };
  opened = open;
  const { preview, config } = openGeometry(reader, machine);
  const outline = await through(open, preview, readGeometry);
  if (!outline || current !== job) return;
  if (unpacked?.isGivenUp) tell({ kind: 'slow-text', job });
  if (config === null) return tell({ kind: 'summary', job, summary: outline });
  await new Promise<void>((go) => {
    waiting = { job, go };
  });
  if (current === job) await through(open, reader.preview(config), readPlan);
}

async function open(message: ToPreview & { kind: 'open' }): Promise<void> {
  close(message.job);
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

/** The last question for the open file's text. */
let textAsked = 0;

/** Any line is found by reading a few tens of kilobytes, but in a packed file that is too large to be kept unpacked. */
async function textOf(open: Opened, first: number, last: number, id: number): Promise<string[]> {
  const isWanted = (): boolean => textAsked === id && opened === open;
  const plain = open.unpacked ? open.unpacked.text() : open.file;
  if (!plain) return await linesOf(open.file, first, last, isWanted, 'gzip');
  const { line, offset } = open.index.before(first);
  return await linesOf(plain.slice(offset), first - line + 1, last - line + 1, isWanted, 'plain');
}

async function tellText({ id, job, first, last }: ToPreview & { kind: 'text' }): Promise<void> {
  textAsked = id;
  const open = opened?.job === job ? opened : undefined;
  const texts = open ? await textOf(open, first, last, id).catch(() => []) : [];
  tell({ kind: 'text', id, texts: textAsked === id ? texts : [] });
}

function close(job: number): void {
  current = job;
  opened = undefined;
  waiting?.go();
  waiting = undefined;
}

self.onmessage = ({ data }: MessageEvent<ToPreview>): void => {
  switch (data.kind) {
    case 'open':
      return void open(data);
    case 'close':
      return close(data.job);
    case 'plan':
      if (waiting?.job === data.job) waiting.go();
      return;
    case 'draw':
      drawing = data.port;
      return;
    case 'lines':
      return void tellLines(data);
    case 'text':
      return void tellText(data);
    case 'check-config':
      return void checkConfig(data);
  }
};

load().then(
  () => tell({ kind: 'loaded' }),
  (error: unknown) => tell({ kind: 'failed', job: null, trouble: plannerMissing(error) }),
);
