// The print that runs, or that ran last: its file, and how far it is. Another file may be looked at meanwhile, so
// nothing here depends on the one that is shown.
import { computed, effect, signal } from '@preact/signals';
import type { Interruption, KeptPrint, Snapshot } from '../machine/protocol';
import type { Layer, Summary } from '../preview/protocol';
import { consent } from './confirm';
import { isPrinting, outcome, port, print, snapshot, wish } from './machine';
import type { LineMarks } from './marks';
import { file, lineMarks, type OpenFile, summary } from './preview';
import { begin, type Place } from './start';

/** A file as it was when its print was started. */
export interface PrintedFile {
  readonly file: OpenFile;
  readonly summary: Summary;
  readonly marks: LineMarks;
  /** Where it began, where that was not the beginning. */
  readonly from: Place | null;
}

export interface Progress {
  /** How much of the print is done, by time where the plan is known, else by lines; 0 … 1. */
  readonly share: number;
  /** In s of the plan. */
  readonly elapsed: number;
  /** In s at the speed that is set; null where the plan does not know. */
  readonly left: number | null;
  /** Counted from 1; 0 before the first. */
  readonly layer: number;
  readonly layers: number;
  readonly line: number;
  /** Filament pushed so far, in mm; null while that is not known. */
  readonly filament: number | null;
}

/** A heater this far below its target is still heating up, in K. */
export const HEATING_BELOW_K = 3;
/** The slowest that the plan's rest is reckoned with. */
const SPEED_FACTOR_MIN = 0.1;

export const printed = signal<PrintedFile | null>(null);
/** How much filament the machine had pushed when the print began, in mm. */
const filamentBefore = signal(0);
/** Whether the file that is shown is the one that is, or was, printed. */
export const isShown = computed(() => printed.value !== null && printed.value.file.blob === file.value?.blob);

/** The last line that is known to be made of the file that was printed last, and is shown; 0 for none. */
const lastLine = signal(0);
export const reached = computed(() => (isShown.value && outcome.value !== 'done' ? lastLine.value : 0));

/**
 * Starts the print of the file that is shown: from its beginning or from a place in it, as one of its own or in the place
 * of one that was interrupted `at` some place. True where it is begun.
 */
export async function printShown(
  from: Place | null = null,
  lost: KeptPrint | null = null,
  at: Interruption | null = null,
): Promise<boolean> {
  const [open, found] = [file.value, summary.value];
  if (!open || !found) return false;
  const before = printed.value;
  printed.value = { file: open, summary: found, marks: lineMarks(), from };
  const facts = { name: open.name, time: found.time, lines: found.lines };
  const start = { confirmedLines: consent.value, line: from?.line ?? null, transform: at?.transform ?? null };
  const isBegun = await print(open.blob, facts, start, lost?.id ?? null);
  if (!isBegun) printed.value = before;
  else if (from) begin(from, at);
  // As they were when it was interrupted.
  if (isBegun && at && at.speedFactor !== 1) await wish({ kind: 'speed-factor', value: at.speedFactor });
  if (isBegun && at && at.flowFactor !== 1) await wish({ kind: 'flow-factor', value: at.flowFactor });
  return isBegun;
}

/** The layer in which a vertex lies, counted from 1; 0 before the first. */
export function layerOf(layers: readonly Layer[], vertex: number): number {
  let [low, high] = [0, layers.length];
  while (low < high) {
    const middle = (low + high) >>> 1;
    if ((layers[middle]?.first ?? 0) <= vertex) low = middle + 1;
    else high = middle;
  }
  return low;
}

type Done = Pick<Snapshot, 'line' | 'elapsed' | 'speedFactor' | 'position'>;

/** How far a print is. */
export function progressOf({ summary: plan, marks, from }: PrintedFile, now: Done, before = 0): Progress {
  // What was made before the print began in the middle of its file counts as done.
  const line = Math.max(now.line, (from?.line ?? 1) - 1);
  const planned = (from?.before ?? 0) + now.elapsed;
  const [done, all] = plan.time === null ? [line, plan.lines] : [planned, plan.time];
  const vertex = marks.vertexAt(line);
  return {
    share: all > 0 ? Math.min(1, done / all) : 0,
    elapsed: now.elapsed,
    // The plan is for the speed as written; what is left goes at the speed that is set.
    left:
      plan.time === null
        ? null
        : Math.max(0, plan.time - planned) / Math.max(SPEED_FACTOR_MIN, now.speedFactor),
    layer: vertex === 0 ? 0 : layerOf(plan.layers, vertex),
    layers: plan.layers.length,
    line,
    filament: now.position && Math.max(0, now.position[3] - before),
  };
}

/** Of the print that runs; null while none does, or where it was not started from here. */
export const progress = computed<Progress | null>(() => {
  const [job, now] = [printed.value, snapshot.value];
  return job && now && isPrinting.value ? progressOf(job, now, filamentBefore.value) : null;
});

/** In how many s of the wall's clock the print ends: a virtual printer's seconds may be shorter. */
export const finishesIn = computed<number | null>(() => {
  const left = progress.value?.left ?? null;
  if (left === null) return null;
  return port.value?.kind === 'virtual' ? left / Math.max(1, port.value.speed) : left;
});

/** What a running print waits for, where it is a heater. */
export const heatingUp = computed(() => {
  const now = snapshot.value;
  if (now?.job !== 'printing' || now.queued !== null) return null;
  return now.heaters.find(({ temperature, target }) => target - temperature > HEATING_BELOW_K) ?? null;
});

/** The last vertex that has been printed of the file that is shown; null where that is not being printed. */
export function printedVertex(): number | null {
  const [job, now] = [printed.peek(), snapshot.peek()];
  return job && now && isPrinting.peek() && isShown.peek()
    ? job.marks.vertexAt(Math.max(now.line, (job.from?.line ?? 1) - 1))
    : null;
}

const WAITING = { paused: 'Paused', held: 'Held' } as const;
const TITLES = { done: 'Done', cancelled: 'Cancelled', stopped: 'Stopped' } as const;

/** The tab's title: what a glance at the row of tabs should say. */
export function titleOf(name: string | null, share: number | null, state: string): string {
  if (share !== null && name !== null) {
    const word = Object.entries(WAITING).find(([kind]) => kind === state)?.[1];
    const percent = `${Math.floor(share * 100)} %`;
    return `${word ? `${word}, ${percent}` : percent} – ${name} – Stepcast`;
  }
  const word = Object.entries(TITLES).find(([kind]) => kind === state)?.[1];
  return word && name !== null ? `${word} – ${name} – Stepcast` : 'Stepcast';
}

/** Remembers how far a print has got. */
function followLine(): void {
  let last: PrintedFile | null = null;
  effect(() => {
    if (printed.value !== last) lastLine.value = 0;
    last = printed.value;
    if (isPrinting.value) lastLine.value = Math.max(snapshot.value?.line ?? 0, (last?.from?.line ?? 1) - 1);
  });
}

/** Keeps the tab's title up to date, and what the print began with. */
export function followPrint(): void {
  followLine();
  effect(() => {
    const now = snapshot.value;
    // One that begins in the middle of its file is paused at first.
    const begins = now?.job === 'printing' || (now?.job === 'paused' && Boolean(printed.value?.from));
    if (begins && now.elapsed === 0) filamentBefore.value = now.position?.[3] ?? 0;
  });
  effect(() => {
    const state = isPrinting.value ? (snapshot.value?.job ?? '') : (outcome.value ?? '');
    const title = titleOf(printed.value?.file.name ?? null, progress.value?.share ?? null, state);
    if (document.title !== title) document.title = title;
  });
}
