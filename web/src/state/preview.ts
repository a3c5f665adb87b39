// The file that is shown and may be printed: its reading, what was found in it, what the user has confirmed.
// The other end is the preview worker, which never disturbs a running print.
import { computed, effect, signal } from '@preact/signals';
import type { Trouble } from '../machine/protocol';
import { workerDied } from '../machine/troubles';
import type { ConfigReport, FromPreview, Summary, ToPreview, VertexHeader } from '../preview/protocol';
import { LineMarks } from './marks';
import { activeProfile } from './profiles';

export interface OpenFile {
  readonly name: string;
  readonly blob: Blob;
}

/** Takes the geometry as it comes; the 3D view, or nobody. */
export interface GeometrySink {
  begin(header: VertexHeader): void;
  append(vertices: Uint32Array<ArrayBuffer>): void;
  finish(summary: Summary): void;
  clear(): void;
}

export const file = signal<OpenFile | null>(null);
/** 0 … 1 while the file is being read; null otherwise. */
export const reading = signal<number | null>(null);
export const summary = signal<Summary | null>(null);
export const failure = signal<Trouble | null>(null);
export const confirmed = signal<ReadonlySet<number>>(new Set());
export const previewLoaded = signal(false);

export const unconfirmed = computed(() =>
  (summary.value?.blocking ?? []).filter((remark) => !confirmed.value.has(remark.line)),
);

let worker: Worker | undefined;
let job = 0;
let sink: GeometrySink | undefined;
let configId = 0;
let marks = new LineMarks();
const configs = new Map<number, (report: ConfigReport) => void>();

export function startPreview(): void {
  worker = new Worker(new URL('../preview/worker.ts', import.meta.url), { type: 'module', name: 'preview' });
  worker.onmessage = ({ data }: MessageEvent<FromPreview>) => take(data);
  worker.onerror = (event) => {
    reading.value = null;
    failure.value = workerDied(event.message);
  };
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
}

function read(config: string): void {
  const open = file.peek();
  if (!open) return;
  job += 1;
  reading.value = 0;
  summary.value = null;
  failure.value = null;
  confirmed.value = new Set();
  marks = new LineMarks();
  sink?.clear();
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
  failure.value = null;
  sink?.clear();
}

export function confirmLine(line: number, yes: boolean): void {
  const lines = new Set(confirmed.value);
  if (yes) lines.add(line);
  else lines.delete(line);
  confirmed.value = lines;
}

/** Reads a printer.cfg and says what is wrong with it, by line. */
export function checkConfig(text: string): Promise<ConfigReport> {
  configId += 1;
  const id = configId;
  return new Promise((resolve) => {
    configs.set(id, resolve);
    send({ kind: 'check-config', id, text });
  });
}

function take(message: FromPreview): void {
  if (message.kind === 'loaded') {
    previewLoaded.value = true;
    return;
  }
  if (message.kind === 'config') {
    configs.get(message.id)?.(message.report);
    configs.delete(message.id);
    return;
  }
  // What is still on its way from a file that was put away.
  if (message.job !== null && message.job !== job) return;
  switch (message.kind) {
    case 'begun':
      sink?.begin(message.header);
      break;
    case 'vertices':
      sink?.append(message.vertices);
      break;
    case 'marks':
      marks.append(message.marks);
      break;
    case 'progress':
      reading.value = Math.min(1, message.bytes / Math.max(1, file.value?.blob.size ?? 1));
      break;
    case 'summary':
      reading.value = null;
      summary.value = message.summary;
      sink?.finish(message.summary);
      break;
    case 'failed':
      reading.value = null;
      failure.value = message.trouble;
      break;
  }
}
