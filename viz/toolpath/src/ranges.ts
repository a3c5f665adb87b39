/**
 * The least and greatest value of each colour mode, found while the data come.
 *
 * Looks at segments that lay filament, but not at those of the file's own start and end code, whose odd beads would
 * leave the part all one colour. Every vertex is looked at once for what it says itself and once for its channels. Does not
 * know: drawing. Units: each mode's own.
 */
import { CHANNELS, channelUnits, isPlanned } from './channels';
import { type Chunk, LEAD_TEXELS } from './chunks';
import type { ColourMode, ColourRanges, ValueRange } from './colours';
import type { Layer } from './layers';
import { FIELDS, FLAGS, featureNumber, field, SIZE_STEP_MM, WORDS_PER_VERTEX } from './vertex';

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

/** True for a segment whose values count. */
function counts(words: Uint32Array, base: number): boolean {
  const kind = words[base + 2] ?? 0;
  return (kind & NOT_LAID) === 0 && ((kind >>> FIELDS.feature.shift) & 31) !== CUSTOM;
}

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

  /** New vertices, four words each. */
  addVertices(words: Uint32Array): void {
    const count = Math.floor(words.length / WORDS_PER_VERTEX);
    for (let at = 0; at < count; at++) {
      if (!counts(words, at * WORDS_PER_VERTEX)) continue;
      const [height, width] = [field(words, at, 'height'), field(words, at, 'width')];
      // 0: not known.
      if (height > 0) this.#height.add(height);
      if (width > 0) this.#width.add(width);
      this.#tool.add(field(words, at, 'tool'));
      this.#object.add(field(words, at, 'object'));
    }
  }

  /** The channels of vertices `first … first + count − 1` of a chunk, counted from its first. */
  addChannels(vertices: Chunk, channels: Chunk, first: number, count: number): void {
    const words = channels.data;
    for (let at = LEAD_TEXELS + first; at < LEAD_TEXELS + first + count; at++) {
      const base = at * WORDS_PER_VERTEX;
      if (!counts(vertices.data, base) || !isPlanned(words, base)) continue;
      const [feed, speed] = [channelUnits(words, base, 'feed'), channelUnits(words, base, 'meanSpeed')];
      const flow = channelUnits(words, base, 'flow');
      this.#feed.add(feed);
      this.#speed.add(speed);
      this.#accel.add(channelUnits(words, base, 'accel'));
      this.#nozzle.add(channelUnits(words, base, 'nozzle'));
      this.#fan.add(channelUnits(words, base, 'fan'));
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
