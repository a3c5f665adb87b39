/**
 * The bit layout of the planner's channels: four u32 words a vertex, one RGBA32UI texel (docs/vertex.md, "Planner channels").
 *
 * Does: packing and unpacking. Does not know: where they come from, how they are
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
