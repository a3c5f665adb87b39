// The print that runs, or that ran last: its file, and how far it is. Another file may be looked at meanwhile, so
// nothing here depends on the one that is shown.
import { computed, effect, signal } from '@preact/signals';
import type { Snapshot } from '../machine/protocol';
import type { Layer, Summary } from '../preview/protocol';
import { consent } from './confirm';
import { isPrinting, outcome, port, print, snapshot } from './machine';
import type { LineMarks } from './marks';
import { file, lineMarks, type OpenFile, summary } from './preview';

/** A file as it was when its print was started. */
export interface PrintedFile {
  readonly file: OpenFile;
  readonly summary: Summary;
  readonly marks: LineMarks;
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

/** Starts the print of the file that is shown. */
export async function printShown(): Promise<void> {
  const [open, found] = [file.value, summary.value];
  if (!open || !found) return;
  const before = printed.value;
  printed.value = { file: open, summary: found, marks: lineMarks() };
  const facts = { name: open.name, time: found.time, lines: found.lines };
  if (!(await print(open.blob, facts, consent.value))) printed.value = before;
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
export function progressOf({ summary: plan, marks }: PrintedFile, now: Done, before = 0): Progress {
  const [done, all] = plan.time === null ? [now.line, plan.lines] : [now.elapsed, plan.time];
  const vertex = marks.vertexAt(now.line);
  return {
    share: all > 0 ? Math.min(1, done / all) : 0,
    elapsed: now.elapsed,
    // The plan is for the speed as written; what is left goes at the speed that is set.
    left:
      plan.time === null
        ? null
        : Math.max(0, plan.time - now.elapsed) / Math.max(SPEED_FACTOR_MIN, now.speedFactor),
    layer: vertex === 0 ? 0 : layerOf(plan.layers, vertex),
    layers: plan.layers.length,
    line: now.line,
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
  return job && now && isPrinting.peek() && isShown.peek() ? job.marks.vertexAt(now.line) : null;
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

/** Keeps the tab's title up to date, and what the print began with. */
export function followPrint(): void {
  effect(() => {
    const now = snapshot.value;
    if (now?.job === 'printing' && now.elapsed === 0) filamentBefore.value = now.position?.[3] ?? 0;
  });
  effect(() => {
    const state = isPrinting.value ? (snapshot.value?.job ?? '') : (outcome.value ?? '');
    const title = titleOf(printed.value?.file.name ?? null, progress.value?.share ?? null, state);
    if (document.title !== title) document.title = title;
  });
}
