/**
 * The least and greatest value of each colour mode, found while the data come.
 *
 * Looks at segments that lay filament, but not at those of the file's own start and end code, whose odd beads would
 * leave the part all one colour. Every vertex is looked at once for what it says itself and once for its channels. Does not
 * know: drawing. Units: each mode's own.
 */
import { CHANNELS } from './channels';
import { type Chunk, LEAD_TEXELS } from './chunks';
import type { ColourMode, ColourRanges, ValueRange } from './colours';
import type { Layer } from './layers';
import { FIELDS, FLAGS, featureNumber, SIZE_STEP_MM, WORDS_PER_VERTEX } from './vertex';

const NOT_LAID = FLAGS.travel | FLAGS.break;
const CUSTOM = featureNumber('custom');

class Span {
  min = Infinity;
  max = -Infinity;

  add(value: number): void {
    if (value < this.min) this.min = value;
    if (value > this.max) this.max = value;
  }

  scaled(unit: number): ValueRange | null {
    return this.min <= this.max ? [this.min * unit, this.max * unit] : null;
  }
}

/** True for a segment whose values count; `kind` is its vertex's third word. */
const counts = (kind: number): boolean =>
  (kind & NOT_LAID) === 0 && ((kind >>> FIELDS.feature.shift) & 31) !== CUSTOM;

export class RangeFinder {
  readonly #height = new Span();
  readonly #width = new Span();
  readonly #tool = new Span();
  readonly #object = new Span();
  readonly #feed = new Span();
  readonly #speed = new Span();
  readonly #accel = new Span();
  readonly #flowAsked = new Span();
  readonly #flow = new Span();
  readonly #nozzle = new Span();
  readonly #fan = new Span();
  #layerTime = new Span();

  // Each of these looks at millions: bits are taken by number here (docs/vertex.md), not by the name of a field.

  /** New vertices, four words each. */
  addVertices(words: Uint32Array): void {
    const end = words.length - (words.length % WORDS_PER_VERTEX);
    let [sizes, rest] = [0, 0];
    for (let base = 0; base < end; base += WORDS_PER_VERTEX) {
      if (!counts(words[base + 2] ?? 0)) continue;
      const width = ((words[base] ?? 0) >>> 20) & 0x3ff;
      const height = ((words[base + 1] ?? 0) >>> 20) & 0x1ff;
      const now = (width << 9) | height;
      if (now !== sizes) {
        sizes = now;
        // 0: not known.
        if (width > 0) this.#width.add(width);
        if (height > 0) this.#height.add(height);
      }
      // Tool and object seldom change.
      const whose = (words[base + 3] ?? 0) >>> 20;
      if (whose === rest && this.#tool.max >= 0) continue;
      rest = whose;
      this.#tool.add(whose & 0xf);
      this.#object.add(whose >>> 4);
    }
  }

  /** The channels of vertices `first … first + count − 1` of a chunk, counted from its first. */
  addChannels(vertices: Chunk, channels: Chunk, first: number, count: number): void {
    const words = channels.data;
    const end = (LEAD_TEXELS + first + count) * WORDS_PER_VERTEX;
    for (let base = (LEAD_TEXELS + first) * WORDS_PER_VERTEX; base < end; base += WORDS_PER_VERTEX) {
      // Without a time the planner knows nothing of it.
      if (words[base + 3] === 0 || !counts(vertices.data[base + 2] ?? 0)) continue;
      const speed = (words[base] ?? 0) >>> 16;
      const [dynamics, set] = [words[base + 1] ?? 0, words[base + 2] ?? 0];
      const feed = dynamics >>> 16;
      const flow = set & 0xffff;
      this.#feed.add(feed);
      this.#speed.add(speed);
      this.#accel.add(dynamics & 0xffff);
      this.#nozzle.add((set >>> 16) & 0x1ff);
      this.#fan.add(set >>> 25);
      if (flow === 0 || speed === 0) continue;
      this.#flow.add(flow);
      this.#flowAsked.add((flow * feed) / speed);
    }
  }

  /** All the layers, in place of those before. */
  setLayers(layers: readonly Layer[]): void {
    this.#layerTime = new Span();
    for (const { timeS } of layers) {
      if (timeS !== undefined && timeS > 0 && timeS < Infinity) this.#layerTime.add(timeS);
    }
  }

  found(): ColourRanges {
    const spans: readonly (readonly [ColourMode, Span, number])[] = [
      ['height', this.#height, SIZE_STEP_MM],
      ['width', this.#width, SIZE_STEP_MM],
      ['feed', this.#feed, CHANNELS.feed.unit],
      ['speed', this.#speed, CHANNELS.meanSpeed.unit],
      ['accel', this.#accel, CHANNELS.accel.unit],
      ['flowAsked', this.#flowAsked, CHANNELS.flow.unit],
      ['flow', this.#flow, CHANNELS.flow.unit],
      ['temperature', this.#nozzle, 1],
      ['fan', this.#fan, 1],
      ['layerTime', this.#layerTime, 1],
      ['tool', this.#tool, 1],
      ['object', this.#object, 1],
    ];
    const ranges: ColourRanges = {};
    for (const [mode, span, unit] of spans) {
      const range = span.scaled(unit);
      if (range) ranges[mode] = range;
    }
    return ranges;
  }
}
