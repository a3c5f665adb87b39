// A print that begins in the middle of its file: at a layer or a line that the user chose, or where one was interrupted.
// Where that is, and what has to be known of the machine before it may go on. Asks for nothing and moves nothing by itself.
import { computed, effect, signal } from '@preact/signals';
import type { Interruption, KeptPrint } from '../machine/protocol';
import type { Layer, Summary } from '../preview/protocol';
import { type Mm, mm, type Seconds, seconds } from '../units';
import { connection, job, outcome, snapshot } from './machine';

/** A line of a file, as the place where a print begins. */
export interface Place {
  readonly line: number;
  /** Counted from 1; 0 where the file has none. */
  readonly layer: number;
  readonly layers: number;
  /** The layer's height; null where the file has none. */
  readonly z: Mm | null;
  /** What has been printed by then reaches up to here. */
  readonly top: Mm;
  /** Print time before it, as far as layers tell. */
  readonly before: Seconds;
}

/** The print that is being begun, until it goes on or is over. */
export interface Starting {
  readonly place: Place;
  /** Where the interrupted print was that it goes on with; null where it goes on with none, or that is not known. */
  readonly at: Interruption | null;
}

/** The layer of a line, counted from 1; 0 where there are none. What comes before the first layer belongs to it. */
export function layerOfLine(layers: readonly Layer[], line: number): number {
  let [low, high] = [0, layers.length];
  while (low < high) {
    const middle = (low + high) >>> 1;
    if ((layers[middle]?.line ?? 0) <= line) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** A line as a place in a file. */
export function placeOf({ layers }: Pick<Summary, 'layers'>, line: number): Place {
  const number = layerOfLine(layers, line);
  const layer = layers[number - 1];
  const next = layers[number];
  const isFirst = layer?.line === line;
  let [top, before] = [0, 0];
  // The layer itself stands where the line is in its middle.
  for (const below of layers.slice(0, isFirst ? number - 1 : number)) top = Math.max(top, below.z);
  for (const below of layers.slice(0, Math.max(0, number - 1))) before += below.time;
  if (layer && next && next.line > layer.line)
    before += (layer.time * (line - layer.line)) / (next.line - layer.line);
  return {
    line,
    layer: number,
    layers: layers.length,
    z: layer?.z ?? null,
    top: mm(top),
    before: seconds(before),
  };
}

/** The line with which a print of a layer (counted from 1) begins. */
export const lineOfLayer = ({ layers }: Pick<Summary, 'layers'>, layer: number): number =>
  Math.max(1, layers[layer - 1]?.line ?? 1);

/** The line with which an interrupted print is gone on with; null where it had printed nothing. */
export function lineAfter(
  { line, startLine, facts }: KeptPrint,
  at: Interruption | null = null,
): number | null {
  // Where it had not got further than where it was to begin, it begins there again.
  const next = at?.startLine ?? (line > 0 ? line + 1 : startLine);
  return next === null ? null : Math.min(next, facts.lines);
}

/** Of places that are `pitch` apart, `base` among them, the one that is nearest to where Z was measured. */
export const nearestPlace = (base: number, pitch: number, measured: number): Mm =>
  mm(base + Math.round((measured - base) / pitch) * pitch);

export const starting = signal<Starting | null>(null);
/** Added to what Z is taken for it gives one of the places where its motor can stand; null where those are not known. */
const placeOffset = signal<number | null>(null);

/** One of the places where Z's motor can stand now; null where nothing is known of them. `known` is what Z is taken for. */
export function placeNear(at: Interruption | null, known: number | null): number | null {
  if (!at || !(at.zPitch > 0)) return null;
  if (known === null) return at.zPlaces[0] ?? null;
  return placeOffset.value === null ? null : known + placeOffset.value;
}

/** The user says where Z stands, where it was taken to stand at `known` before. The places themselves stay where they are. */
export function noteZ({ at }: Starting, known: number | null, said: number): void {
  const place = placeNear(at, known);
  placeOffset.value = place === null ? null : place - said;
}

/** The same with heights over the bed where the head is: journal and motor know nothing of the bed that is made up for. */
export const overBed = (at: Interruption | null, lift: number): Interruption | null =>
  at && {
    ...at,
    zRange: at.zRange && [mm(at.zRange[0] - lift), mm(at.zRange[1] - lift)],
    zPlaces: at.zPlaces.map((place) => mm(place - lift)),
  };

/** The user says that the part is where it was. */
export const isPartThere = signal(false);

/** A print waits for the user before its first line. */
export const isToBegin = computed(() => job.value === 'paused' && snapshot.value?.start != null);

/** Why the print that is begun cannot go on yet; null where it can, or none is begun. */
export const startObstacle = computed<string | null>(() => {
  if (!isToBegin.value) return null;
  if (!snapshot.value?.homed[2]) return 'Say first where Z stands.';
  return isPartThere.value ? null : 'Look first whether the part is where it was.';
});

/** Forgets what is being begun as soon as it goes on, or is over. */
export function followStart(): void {
  let isWaiting = false;
  effect(() => {
    const begun = starting.value;
    const isOver = outcome.value !== null || connection.value === 'closed';
    if (!begun) {
      isWaiting = false;
      return;
    }
    if (isToBegin.value) isWaiting = true;
    else if (isWaiting || isOver) starting.value = null;
  });
}

/** A print is begun in the middle of its file. */
export function begin(place: Place, at: Interruption | null): void {
  isPartThere.value = false;
  placeOffset.value = null;
  starting.value = { place, at };
}
