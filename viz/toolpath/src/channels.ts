/**
 * The bit layout of the planner's channels: four u32 words a vertex, one RGBA32UI texel (docs/vertex.md, "Planner channels").
 *
 * Does: packing and unpacking, and one texel for several segments. Does not know: where they come from, how they are
 * drawn. Units: mm/s, mm/s², mm³/s, °C, percent, s.
 */

/** u32 words of a vertex's channels. */
export const WORDS_PER_CHANNELS = 4;

/** Where the fields lie: word, lowest bit, number of bits, and the unit's size. */
export const CHANNELS = {
  peakSpeed: { word: 0, shift: 0, bits: 16, unit: 1 / 32 },
  meanSpeed: { word: 0, shift: 16, bits: 16, unit: 1 / 32 },
  accel: { word: 1, shift: 0, bits: 16, unit: 2 },
  feed: { word: 1, shift: 16, bits: 16, unit: 1 / 32 },
  flow: { word: 2, shift: 0, bits: 16, unit: 1 / 512 },
  nozzle: { word: 2, shift: 16, bits: 9, unit: 1 },
  fan: { word: 2, shift: 25, bits: 7, unit: 1 },
} as const;

export type ChannelName = keyof typeof CHANNELS;
/** What the planner knows of one segment; `timeS` is a float of its own. */
export type Channels = Readonly<Record<ChannelName, number>> & { readonly timeS: number };

const NAMES = Object.keys(CHANNELS) as ChannelName[];

/** One channel of four words, in whole units. */
export function channelUnits(words: Uint32Array, base: number, name: ChannelName): number {
  const { word, shift, bits } = CHANNELS[name];
  return ((words[base + word] ?? 0) >>> shift) & ((1 << bits) - 1);
}

/** The last word is the time; 0 means that the planner knows nothing of the segment. */
export const isPlanned = (words: Uint32Array, base: number): boolean => (words[base + 3] ?? 0) !== 0;

/** What the words of the vertex at `index` say, or null where the planner knows nothing. */
export function decodeChannels(words: Uint32Array, index: number): Channels | null {
  const base = index * WORDS_PER_CHANNELS;
  if (base + 3 >= words.length || !isPlanned(words, base)) return null;
  const values = NAMES.map((name) => [name, channelUnits(words, base, name) * CHANNELS[name].unit]);
  const timeS = new Float32Array(words.slice(base + 3, base + 4).buffer)[0] ?? 0;
  return { ...(Object.fromEntries(values) as Record<ChannelName, number>), timeS };
}

const place = (name: ChannelName, value: number): number => {
  const { shift, bits, unit } = CHANNELS[name];
  return (Math.min(Math.max(Math.round(value / unit), 0), (1 << bits) - 1) << shift) >>> 0;
};

/** Writes the channels of the vertex at `index`; values out of range saturate. For tests and demonstrations. */
export function encodeChannels(words: Uint32Array, index: number, input: Partial<Channels>): void {
  const base = index * WORDS_PER_CHANNELS;
  words.fill(0, base, base + WORDS_PER_CHANNELS);
  for (const name of NAMES) {
    const at = base + CHANNELS[name].word;
    words[at] = (words[at] ?? 0) | place(name, input[name] ?? 0);
  }
  new Float32Array(words.buffer, words.byteOffset + (base + 3) * 4, 1)[0] = input.timeS ?? 0;
}

/** Several segments as one: times add up, peaks stay, averages are by time, what is set is as at the end. */
export class ChannelSum {
  #peak = 0;
  #accel = 0;
  #speedTime = 0;
  #flowTime = 0;
  #time = 0;
  #newestDynamics = 0;
  #newestSet = 0;
  readonly #float = new Float32Array(1);
  readonly #bits = new Uint32Array(this.#float.buffer);

  add(words: Uint32Array, base: number): void {
    const [speeds, dynamics, set] = [words[base] ?? 0, words[base + 1] ?? 0, words[base + 2] ?? 0];
    this.#bits[0] = words[base + 3] ?? 0;
    this.#newestDynamics = dynamics;
    this.#newestSet = set;
    const time = this.#float[0] ?? 0;
    if (!(time > 0 && time < Infinity)) return;
    this.#time += time;
    this.#speedTime += time * (speeds >>> 16);
    this.#flowTime += time * (set & 0xffff);
    this.#peak = Math.max(this.#peak, speeds & 0xffff);
    this.#accel = Math.max(this.#accel, dynamics & 0xffff);
  }

  /** Writes the sum's four words and begins anew. */
  take(out: Uint32Array, base: number): void {
    const time = Math.max(this.#time, Number.MIN_VALUE);
    out[base] = this.#peak | (Math.round(this.#speedTime / time) << 16);
    out[base + 1] = this.#accel | (this.#newestDynamics & 0xffff_0000);
    out[base + 2] = Math.round(this.#flowTime / time) | (this.#newestSet & 0xffff_0000);
    this.#float[0] = this.#time;
    out[base + 3] = this.#bits[0] ?? 0;
    this.#peak = 0;
    this.#accel = 0;
    this.#speedTime = 0;
    this.#flowTime = 0;
    this.#time = 0;
    this.#newestDynamics = 0;
    this.#newestSet = 0;
  }
}
