// Plays the file's moves in the view, by the times that the planner gives them: up to a vertex more and more. Where no
// times are known, a layer's time is spread over its moves, or each takes the same.
import { signal } from '@preact/signals';
import type { Slice } from '@stepcast/toolpath';
import { outline } from './preview';
import { layerOf } from './print';
import { cursor, layerFrom, layerTo, movesOf, moveTo, showUpTo, topMoves } from './view';
import { verticesOf } from './view_answers';

/** Seconds of the print in one of the wall's. */
export const SPEEDS = [1, 5, 20, 100, 500] as const;
export const playSpeed = signal<number>(20);
export const isPlaying = signal(false);

/** The picture follows this often, in ms. */
const STEP_MS = 50;
/** A page that was hidden or busy goes on from where it was, in s. */
const STEP_MAX_S = 0.25;
/** Moves whose times are fetched at once. */
const WINDOW = 16_384;
/** A move's time where nothing says it, in s. */
const MOVE_S = 0.05;
const WORDS = 4;
const TIME_WORD = 3;

/** When each move of a stretch ends, in s from its beginning. */
export class Timeline {
  readonly first: number;
  readonly #ends: Float64Array;

  /** `times` of the moves from vertex `first` on. */
  constructor(first: number, times: ArrayLike<number>) {
    this.first = first;
    this.#ends = new Float64Array(times.length);
    let sum = 0;
    for (let at = 0; at < times.length; at += 1) {
      const time = times[at] ?? 0;
      sum += time > 0 && Number.isFinite(time) ? time : 0;
      this.#ends[at] = sum;
    }
  }

  get last(): number {
    return this.first + this.#ends.length - 1;
  }

  get length(): number {
    return this.#ends.at(-1) ?? 0;
  }

  /** When the move to this vertex is made. */
  timeAt(vertex: number): number {
    return this.#ends[Math.min(Math.max(vertex - this.first, 0), this.#ends.length - 1)] ?? 0;
  }

  /** The last vertex that is reached at this time. */
  vertexAt(time: number): number {
    let [low, high] = [0, this.#ends.length];
    while (low < high) {
      const middle = (low + high) >>> 1;
      if ((this.#ends[middle] ?? 0) <= time) low = middle + 1;
      else high = middle;
    }
    return this.first + Math.max(low - 1, 0);
  }
}

/** The times of a slice's moves; where the planner has none, each takes `otherwise`. */
export function timesOf({ vertices, channels }: Slice, otherwise: number): Float64Array {
  const count = vertices.length / WORDS;
  const floats = new Float32Array(channels.slice().buffer);
  const times = new Float64Array(count).fill(otherwise);
  if (channels.length < vertices.length) return times;
  for (let at = 0; at < count; at += 1) times[at] = floats[at * WORDS + TIME_WORD] ?? 0;
  return times;
}

/** What a move of this layer takes on average. */
function meanTime(vertex: number): number {
  const plan = outline.peek();
  if (!plan) return MOVE_S;
  const layer = Math.max(0, layerOf(plan.layers, vertex) - 1);
  const { first, last } = movesOf(plan, layer);
  const time = plan.layers[layer]?.time ?? 0;
  return time > 0 ? time / (last - first + 1) : MOVE_S;
}

let timeline: Timeline | null = null;
let at = 0;
let timer: ReturnType<typeof setInterval> | undefined;
let isFetching = false;
let before = 0;
/** What was shown last: where another is, somebody moved the slider. */
let last = 0;

/** The last vertex that is shown. */
function shown(): number {
  return moveTo.peek() ?? topMoves.peek()?.last ?? 0;
}

/** Fetches the times from this vertex on. */
async function fetchFrom(vertex: number): Promise<void> {
  isFetching = true;
  const plan = outline.peek();
  const slice = await verticesOf(vertex, vertex + WINDOW);
  isFetching = false;
  if (!isPlaying.peek() || plan !== outline.peek()) return;
  if (!slice) return stop();
  // The view's worker is behind the one that reads the file: the next step asks again.
  if (slice.vertices.length === 0) return;
  timeline = new Timeline(vertex, timesOf(slice, meanTime(vertex)));
  at = timeline.timeAt(vertex);
  if (vertex !== shown()) showPlayed(vertex);
  last = shown();
  before = performance.now();
}

function showPlayed(vertex: number): void {
  showUpTo(vertex);
  cursor.value = { vertex, line: null, by: 'moves' };
}

function step(): void {
  const plan = outline.peek();
  if (!plan) return stop();
  if (isFetching) return;
  const now = performance.now();
  const passed = Math.min((now - before) / 1000, STEP_MAX_S) * playSpeed.peek();
  before = now;
  const from = shown();
  if (!timeline || from < timeline.first || from > timeline.last) return void fetchFrom(from);
  if (from !== last) at = timeline.timeAt(from);
  at += passed;
  const vertex = timeline.vertexAt(at);
  if (vertex !== from) showPlayed(vertex);
  last = shown();
  if (vertex >= plan.vertices - 1) return stop();
  if (at >= timeline.length) void fetchFrom(Math.min(timeline.last + 1, plan.vertices - 1));
}

export function stop(): void {
  clearInterval(timer);
  timer = undefined;
  timeline = null;
  isPlaying.value = false;
}

/** Plays on from what is shown; from the beginning where that is everything. */
export function play(): void {
  const moves = topMoves.peek();
  const plan = outline.peek();
  if (!plan || !moves || timer !== undefined) return;
  const isAll = layerTo.peek() === null;
  const start = isAll ? movesOf(plan, layerFrom.peek()).first : moves.first;
  showPlayed(moveTo.peek() ?? start);
  last = shown();
  isPlaying.value = true;
  timeline = null;
  before = performance.now();
  timer = setInterval(step, STEP_MS);
}

export const toggle = (): void => (isPlaying.peek() ? stop() : play());
