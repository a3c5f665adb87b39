// A print that begins in the middle of its file: at a layer or a line that the user chose, or where one was interrupted.
// Where that is, and what has to be known of the machine before it may go on. Asks for nothing and moves nothing by itself.
import { computed, effect, signal } from '@preact/signals';
import type { KeptPrint } from '../machine/protocol';
import type { Layer, MachineAxis, Summary } from '../preview/protocol';
import { type Mm, mm, type Seconds, seconds } from '../units';
import { connection, job, outcome, snapshot } from './machine';

/** A line of a file, as the place where a print begins. */
export interface Place {
  readonly line: number;
  /** Counted from 1; 0 before the first. */
  readonly layer: number;
  readonly layers: number;
  /** The layer's height; null before the first layer. */
  readonly z: Mm | null;
  /** What has been printed by then reaches up to here. */
  readonly top: Mm;
  /** Print time before it, as far as layers tell. */
  readonly before: Seconds;
}

/** The print that is being begun, until it goes on or is over. */
export interface Starting {
  readonly place: Place;
  /** The interrupted print that it goes on with. */
  readonly lost: KeptPrint | null;
}

/** How much higher than the part the head goes before it homes X and Y; a part that has come loose stands up. */
const CLEARANCE_MM = 5;

/** The layer of a line, counted from 1; 0 before the first. */
export function layerOfLine(layers: readonly Layer[], line: number): number {
  // Layers without extrusion have no line, and stand at the end alone.
  let [low, high] = [0, layers.length];
  while (low < high) {
    const middle = (low + high) >>> 1;
    const first = layers[middle]?.line ?? 0;
    if (first > 0 && first <= line) low = middle + 1;
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

/** The line with which a print of a layer (counted from 1) begins; the file's first where nothing is extruded in it. */
export const lineOfLayer = ({ layers }: Pick<Summary, 'layers'>, layer: number): number =>
  Math.max(1, layers[layer - 1]?.line ?? 1);

/** The line with which an interrupted print is gone on with, as far as is known; null where it had printed nothing. */
export function lineAfter({ line, startLine, facts }: KeptPrint): number | null {
  // Where it had not got further than where it was to begin, it begins there again.
  const next = line > 0 ? line + 1 : startLine;
  return next === null ? null : Math.min(next, facts.lines);
}

/** How far up Z has to go before X and Y are homed: the head may be beside the part, or on it. */
export function liftBefore(z: number, top: number, axis: MachineAxis): Mm {
  return mm(Math.max(0, Math.min(Math.max(z, top) + CLEARANCE_MM, axis.max) - z));
}

export const starting = signal<Starting | null>(null);
/** The user says that the part is where it was. */
export const isPartThere = signal(false);

/** Why the print that is begun cannot go on yet; null where it can, or none is begun. */
export const startObstacle = computed<string | null>(() => {
  if (!starting.value || job.value !== 'paused') return null;
  const [x, y, z] = snapshot.value?.homed ?? [false, false, false];
  if (!z) return 'Say first where Z is.';
  if (!x || !y) return 'Home X and Y first.';
  return isPartThere.value ? null : 'Look first whether the part is where it was.';
});

/** Forgets what is being begun as soon as it goes on, or is over. */
export function followStart(): void {
  let isWaiting = false;
  effect(() => {
    const [begun, state] = [starting.value, job.value];
    const isOver = outcome.value !== null || connection.value === 'closed';
    if (!begun) {
      isWaiting = false;
      return;
    }
    if (state === 'paused') isWaiting = true;
    else if (isWaiting || isOver) starting.value = null;
  });
}

/** A print is begun in the middle of its file. */
export function begin(place: Place, lost: KeptPrint | null): void {
  isPartThere.value = false;
  starting.value = { place, lost };
}
