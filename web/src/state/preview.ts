// The file that is shown and may be printed: its reading, what was found in it, what the user has confirmed.
// The other end is the preview worker, which never disturbs a running print.
import { batch, effect, signal } from '@preact/signals';
import type { Trouble } from '../machine/protocol';
import { previewDied } from '../machine/troubles';
import type { ConfigReport, FromPreview, Summary, Thumbnail, ToPreview } from '../preview/protocol';
import { afterPictures } from '../tasks';
import { note } from './log';
import { LineMarks } from './marks';
import { activeProfile } from './profiles';

export interface OpenFile {
  readonly name: string;
  readonly blob: Blob;
}

/** Takes the geometry as it comes; the 3D view, or nobody. */
export interface GeometrySink {
  /** Here it comes from, straight from the worker that makes it. */
  source(port: MessagePort): void;
  /** What comes of jobs before this one is not wanted any more. */
  discard(before: number): void;
}

export const file = signal<OpenFile | null>(null);
/** 0 … 1 while the file is being read; null otherwise. */
export const reading = signal<number | null>(null);
/** Once the planner has gone through the file too. */
export const summary = signal<Summary | null>(null);
/**
 * What is in the file, for the view: at hand as soon as its geometry is, then without times and without what the machine
 * cannot do; from then on, what `summary` says.
 */
export const outline = signal<Summary | null>(null);
export const failure = signal<Trouble | null>(null);
/** Its text takes a while to come: it is packed, and too large to be kept unpacked. */
export const isTextSlow = signal(false);
/** Lines that have been read of it so far. */
export const linesRead = signal(0);
/** The pictures of the print that are in it; a handful at most. */
export const thumbnails = signal<readonly Thumbnail[]>([]);
export const confirmed = signal<ReadonlySet<number>>(new Set());

/** What belongs to an outline is on the page after so many pictures. */
const OUTLINE_PICTURES = 5;

/** A worker that stops this often without having read anything in between is not started again. */
const DEATHS_MAX = 3;

let worker: Worker | undefined;
let deaths = 0;
let lastDeath: Trouble | undefined;
let job = 0;
let sink: GeometrySink | undefined;
/** The geometry's end for a sink that is not there yet. */
let source: MessagePort | undefined;
let configId = 0;
let marks = new LineMarks();
interface WaitingCheck {
  readonly text: string;
  readonly settle: (report: ConfigReport) => void;
  /** A worker stopped before it was done. */
  isRepeated: boolean;
}
const configs = new Map<number, WaitingCheck>();
interface Question {
  readonly id: number;
  readonly settle: (texts: readonly string[]) => void;
}
/** The last question for lines of a file, and for the text of the open one; those before it are not answered. */
let lookingAt: Question | undefined;
let readingAt: Question | undefined;

function startWorker(): void {
  const started = new Worker(new URL('../preview/worker.ts', import.meta.url), {
    type: 'module',
    name: 'preview',
  });
  started.onmessage = ({ data }: MessageEvent<FromPreview>) => {
    if (worker === started) take(data);
  };
  started.onerror = (event) => {
    event.preventDefault();
    // Where its script cannot be loaded, there is no message.
    if (worker === started) died(event.message || 'its script could not be loaded');
  };
  worker = started;
  const { port1, port2 } = new MessageChannel();
  started.postMessage({ kind: 'draw', port: port1 } satisfies ToPreview, [port1]);
  source = port2;
  connect();
}

function connect(): void {
  if (!sink || !source) return;
  sink.source(source);
  source = undefined;
}

/** What was being read is given up, what was being checked cannot be said. */
function died(message: string): void {
  worker?.terminate();
  worker = undefined;
  deaths += 1;
  lastDeath = previewDied(message);
  note('error', lastDeath.happened);
  // What was read before holds on.
  if (reading.value !== null) {
    reading.value = null;
    failure.value = lastDeath;
  }
  for (const question of [lookingAt, readingAt]) question?.settle([]);
  lookingAt = undefined;
  readingAt = undefined;
  if (deaths <= DEATHS_MAX) startWorker();
  for (const [id, check] of configs) {
    if (check.isRepeated || !worker) {
      configs.delete(id);
      check.settle(unchecked());
    } else {
      check.isRepeated = true;
      send({ kind: 'check-config', id, text: check.text });
    }
  }
}

const unchecked = (): ConfigReport => ({
  remarks: [{ line: 0, severity: 'error', text: lastDeath?.happened ?? '' }],
  machine: null,
});

export function startPreview(): void {
  startWorker();
  let config: string | undefined;
  // Another machine: what was found in the file holds no longer.
  effect(() => {
    const now = activeProfile.value.config;
    if (config !== undefined && config !== now && file.peek()) read(now);
    config = now;
  });
}

const send = (message: ToPreview): void => worker?.postMessage(message);

/** The marks of the file that is shown; a file read later has others of its own. */
export const lineMarks = (): LineMarks => marks;

export function setSink(taker: GeometrySink): void {
  sink = taker;
  connect();
}

function read(config: string): void {
  const open = file.peek();
  if (!open) return;
  job += 1;
  reading.value = 0;
  summary.value = null;
  outline.value = null;
  failure.value = null;
  confirmed.value = new Set();
  marks = new LineMarks();
  linesRead.value = 0;
  isTextSlow.value = false;
  thumbnails.value = [];
  sink?.discard(job);
  if (!worker && lastDeath) {
    reading.value = null;
    failure.value = lastDeath;
    return;
  }
  send({ kind: 'open', job, file: open.blob, name: open.name, config });
}

/** Shows a file in place of the one before. */
export function openFile(blob: Blob, name: string): void {
  file.value = { name, blob };
  read(activeProfile.peek().config);
}

export function closeFile(): void {
  job += 1;
  file.value = null;
  reading.value = null;
  summary.value = null;
  outline.value = null;
  failure.value = null;
  linesRead.value = 0;
  isTextSlow.value = false;
  thumbnails.value = [];
  sink?.discard(job);
  send({ kind: 'close', job });
}

/** Reads a printer.cfg and says what is wrong with it, by line. */
export function checkConfig(text: string): Promise<ConfigReport> {
  configId += 1;
  const id = configId;
  return new Promise((resolve) => {
    if (!worker && lastDeath) return resolve(unchecked());
    configs.set(id, { text, settle: resolve, isRepeated: false });
    send({ kind: 'check-config', id, text });
  });
}

/** Lines of a file, `first` to `last`; none where they cannot be read, or others were asked for meanwhile. */
export function linesOf(blob: Blob, first: number, last: number): Promise<readonly string[]> {
  lookingAt?.settle([]);
  configId += 1;
  const id = configId;
  return new Promise((settle) => {
    if (!worker) return settle([]);
    lookingAt = { id, settle };
    send({ kind: 'lines', id, file: blob, first, last });
  });
}

/** Lines of the file that is shown; none where they cannot be read, or others were asked for meanwhile. */
export function textOf(first: number, last: number): Promise<readonly string[]> {
  readingAt?.settle([]);
  configId += 1;
  const id = configId;
  return new Promise((settle) => {
    if (!worker || !file.peek()) return settle([]);
    readingAt = { id, settle };
    send({ kind: 'text', id, job, first, last });
  });
}

function take(message: FromPreview): void {
  if (message.kind === 'loaded') return;
  if (message.kind === 'text') {
    if (readingAt?.id !== message.id) return;
    readingAt.settle(message.texts);
    readingAt = undefined;
    return;
  }
  if (message.kind === 'lines') {
    if (lookingAt?.id !== message.id) return;
    lookingAt.settle(message.texts);
    lookingAt = undefined;
    return;
  }
  if (message.kind === 'config') {
    configs.get(message.id)?.settle(message.report);
    configs.delete(message.id);
    return;
  }
  // What is still on its way from a file that was put away.
  if (message.job !== null && message.job !== job) return;
  switch (message.kind) {
    case 'places':
      for (const more of message.marks) marks.append(more);
      for (const more of message.steps) marks.appendSteps(more);
      break;
    case 'slow-text':
      isTextSlow.value = true;
      break;
    case 'thumbnails':
      thumbnails.value = [...thumbnails.value, ...message.thumbnails];
      break;
    case 'progress':
      batch(() => {
        reading.value = Math.min(1, message.share);
        linesRead.value = message.lines;
      });
      break;
    case 'outline':
      batch(() => {
        linesRead.value = message.outline.lines;
        outline.value = message.outline;
      });
      afterPictures(OUTLINE_PICTURES, () => send({ kind: 'plan', job: message.job }));
      break;
    case 'summary':
      deaths = 0;
      batch(() => {
        reading.value = null;
        linesRead.value = message.summary.lines;
        outline.value = message.summary;
        summary.value = message.summary;
      });
      break;
    case 'failed':
      reading.value = null;
      failure.value = message.trouble;
      break;
  }
}
