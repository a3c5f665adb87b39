/**
 * The bit layout of a vertex: four u32 words, one RGBA32UI texel (docs/vertex.md is its definition).
 *
 * Does: packing and unpacking, and the numbers that the shader needs. Does not know: where vertices come from, how they
 * are drawn. Units: mm; a position's step is the header's.
 */
import type { Mm, VertexIndex } from './units';

/** u32 words of one vertex. */
export const WORDS_PER_VERTEX = 4;

/** Where the fields lie: word, lowest bit, number of bits. */
export const FIELDS = {
  x: { word: 0, shift: 0, bits: 20 },
  width: { word: 0, shift: 20, bits: 10 },
  y: { word: 1, shift: 0, bits: 20 },
  height: { word: 1, shift: 20, bits: 9 },
  z: { word: 2, shift: 0, bits: 20 },
  feature: { word: 2, shift: 20, bits: 5 },
  layer: { word: 3, shift: 0, bits: 20 },
  tool: { word: 3, shift: 20, bits: 4 },
  /** 0: none; 255: one beyond those that are told apart. */
  object: { word: 3, shift: 24, bits: 8 },
} as const;

export type FieldName = keyof typeof FIELDS;

/** Bits of word 2. */
export const FLAGS = {
  travel: 1 << 25,
  break: 1 << 26,
  retract: 1 << 27,
  unretract: 1 << 28,
  seam: 1 << 29,
  wipe: 1 << 30,
  pause: 2 ** 31,
} as const;

/** Bits of word 1: what happens where the segment ends. */
export const EVENTS = {
  toolChange: 1 << 29,
  /** A pause for it; `FLAGS.pause` is set too. */
  filamentChange: 1 << 30,
} as const;

/** Millimetres of one unit of `width` and `height`. */
export const SIZE_STEP_MM = 0.004;

/** What a bead is for; the index is the number in the vertex, in the order of the planner's own list. */
export const FEATURES = [
  'innerWall',
  'outerWall',
  'overhangWall',
  'infill',
  'solidInfill',
  'topSurface',
  'bottomSurface',
  'ironing',
  'bridge',
  'gapFill',
  'skirt',
  'support',
  'supportInterface',
  'primeTower',
  'raft',
  'custom',
  'other',
] as const;

export type FeatureName = (typeof FEATURES)[number];

/** Numbers that a vertex's five bits can hold; those without a name are drawn as `other`. */
export const FEATURE_COUNT_MAX = 32;

/** What a file's positions are counted from and in. */
export interface VertexHeader {
  /** The place of (0, 0, 0). */
  readonly originMm: readonly [Mm, Mm, Mm];
  /** Length of one step, a power of two. */
  readonly stepMm: Mm;
}

/** One vertex, taken apart. */
export interface Vertex {
  readonly positionMm: readonly [Mm, Mm, Mm];
  /** 0: unknown. */
  readonly widthMm: Mm;
  /** 0: unknown. */
  readonly heightMm: Mm;
  readonly feature: FeatureName;
  readonly layer: number;
  readonly tool: number;
  /** 0: belongs to none; 255: to one beyond the 254 that are told apart. */
  readonly object: number;
  readonly travel: boolean;
  readonly break: boolean;
  readonly retract: boolean;
  readonly unretract: boolean;
  readonly seam: boolean;
  readonly wipe: boolean;
  readonly pause: boolean;
  readonly toolChange: boolean;
  readonly filamentChange: boolean;
}

/** The value of one field of the vertex at `index`; 0 beyond the end. */
export function field(words: Uint32Array, index: number, name: FieldName): number {
  const { word, shift, bits } = FIELDS[name];
  const value = words[index * WORDS_PER_VERTEX + word] ?? 0;
  return (value >>> shift) & ((1 << bits) - 1);
}

/** True if the vertex at `index` has any of the flags. */
export function hasFlag(words: Uint32Array, index: number, flags: number): boolean {
  return ((words[index * WORDS_PER_VERTEX + 2] ?? 0) & flags) !== 0;
}

/** True if any of the events happens at the vertex at `index`. */
export function hasEvent(words: Uint32Array, index: number, events: number): boolean {
  return ((words[index * WORDS_PER_VERTEX + 1] ?? 0) & events) !== 0;
}

export function featureName(feature: number): FeatureName {
  return FEATURES[feature] ?? 'other';
}

/** The feature's number in a vertex. */
export function featureNumber(name: FeatureName): number {
  return FEATURES.indexOf(name);
}

/** The place of the vertex at `index`. */
export function positionMm(header: VertexHeader, words: Uint32Array, index: number): [Mm, Mm, Mm] {
  const at = (name: 'x' | 'y' | 'z', axis: 0 | 1 | 2): Mm =>
    (header.originMm[axis] + field(words, index, name) * header.stepMm) as Mm;
  return [at('x', 0), at('y', 1), at('z', 2)];
}

/** The vertex at `index`, taken apart. */
export function decodeVertex(header: VertexHeader, words: Uint32Array, index: VertexIndex | number): Vertex {
  return {
    positionMm: positionMm(header, words, index),
    widthMm: (field(words, index, 'width') * SIZE_STEP_MM) as Mm,
    heightMm: (field(words, index, 'height') * SIZE_STEP_MM) as Mm,
    feature: featureName(field(words, index, 'feature')),
    layer: field(words, index, 'layer'),
    tool: field(words, index, 'tool'),
    object: field(words, index, 'object'),
    travel: hasFlag(words, index, FLAGS.travel),
    break: hasFlag(words, index, FLAGS.break),
    retract: hasFlag(words, index, FLAGS.retract),
    unretract: hasFlag(words, index, FLAGS.unretract),
    seam: hasFlag(words, index, FLAGS.seam),
    wipe: hasFlag(words, index, FLAGS.wipe),
    pause: hasFlag(words, index, FLAGS.pause),
    toolChange: hasEvent(words, index, EVENTS.toolChange),
    filamentChange: hasEvent(words, index, EVENTS.filamentChange),
  };
}

/** What {@link encodeVertex} takes; what is left out is 0 or false. */
export interface VertexInput {
  readonly positionMm: readonly [number, number, number];
  readonly widthMm?: number;
  readonly heightMm?: number;
  readonly feature?: FeatureName;
  readonly layer?: number;
  readonly tool?: number;
  readonly object?: number;
  /** Any of {@link FLAGS}, or-ed. */
  readonly flags?: number;
  /** Any of {@link EVENTS}, or-ed. */
  readonly events?: number;
}

const place = (name: FieldName, value: number): number => {
  const { shift, bits } = FIELDS[name];
  return (Math.min(Math.max(Math.round(value), 0), (1 << bits) - 1) << shift) >>> 0;
};

/** Writes one vertex at `index`; values out of range saturate. For tests and demonstrations: files are packed in Rust. */
export function encodeVertex(
  header: VertexHeader,
  words: Uint32Array,
  index: number,
  input: VertexInput,
): void {
  const steps = (axis: 0 | 1 | 2): number => (input.positionMm[axis] - header.originMm[axis]) / header.stepMm;
  const size = (mm: number | undefined): number => (mm ?? 0) / SIZE_STEP_MM;
  const feature = featureNumber(input.feature ?? 'other');
  const base = index * WORDS_PER_VERTEX;
  words[base] = place('x', steps(0)) | place('width', size(input.widthMm));
  words[base + 1] = place('y', steps(1)) | place('height', size(input.heightMm)) | (input.events ?? 0);
  words[base + 2] = place('z', steps(2)) | place('feature', feature) | (input.flags ?? 0);
  words[base + 3] =
    place('layer', input.layer ?? 0) | place('tool', input.tool ?? 0) | place('object', input.object ?? 0);
}
