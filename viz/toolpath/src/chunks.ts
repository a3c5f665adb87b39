/**
 * The vertices of a file, and what the planner says of them, in pieces that each fit one texture; the boxes around them.
 *
 * Does: takes texels as they come and keeps them in rows; splits a range of vertices among the pieces. Each piece repeats the two vertices before it and the one after, because a bead's ends need its neighbours.
 * Does not know: textures, drawing. Units: vertex indices; mm in the boxes.
 */
import type { BoxMm } from './camera';
import type { VertexRange } from './layers';
import type { VertexIndex } from './units';
import { FLAGS, featureNumber, type VertexHeader, WORDS_PER_VERTEX } from './vertex';

/** Texels in a row: what every WebGL2 offers. */
export const TEXELS_PER_ROW = 2048;
/** Rows of a full piece: 1 MiB. */
export const ROWS_PER_CHUNK = 32;
const TEXELS_PER_CHUNK = TEXELS_PER_ROW * ROWS_PER_CHUNK;
/** Texels before a piece's own: two vertices of the piece before it. */
export const LEAD_TEXELS = 2;
const TRAIL_TEXELS = 1;
/** Vertices that a piece has of its own. */
export const VERTICES_PER_CHUNK = TEXELS_PER_CHUNK - LEAD_TEXELS - TRAIL_TEXELS;

/** One texture's worth. */
export interface Chunk {
  /** The file's index of the first vertex of its own, which lies at texel {@link LEAD_TEXELS}. */
  readonly firstVertex: number;
  /** Whole rows of texels. */
  data: Uint32Array<ArrayBuffer>;
  rows: number;
  /** Vertices of its own. */
  count: number;
  /** Counts changes of `data`, so that an owner of a copy sees that it is old. */
  version: number;
}

/** A part of a chunk: own vertices `first … first + count − 1`, counted from the chunk's first. */
export interface ChunkRange {
  readonly chunk: Chunk;
  readonly first: number;
  readonly count: number;
}

const POSITION_MASK = 0xf_ffff;
const NO_PLACE = POSITION_MASK + 1;
const NOT_LAID = FLAGS.travel | FLAGS.break;
/** What is not part of the printed thing. */
const BESIDE_THE_PART =
  (1 << featureNumber('skirt')) | (1 << featureNumber('custom')) | (1 << featureNumber('primeTower'));

/** A box in steps, grown vertex by vertex. */
class StepBox {
  // Whole numbers beyond any place, not infinities: that is quicker, and each of millions of vertices comes by three times.
  #lowX = NO_PLACE;
  #lowY = NO_PLACE;
  #lowZ = NO_PLACE;
  #highX = -1;
  #highY = -1;
  #highZ = -1;

  add(x: number, y: number, z: number): void {
    if (x < this.#lowX) this.#lowX = x;
    if (y < this.#lowY) this.#lowY = y;
    if (z < this.#lowZ) this.#lowZ = z;
    if (x > this.#highX) this.#highX = x;
    if (y > this.#highY) this.#highY = y;
    if (z > this.#highZ) this.#highZ = z;
  }

  inMm(header: VertexHeader): BoxMm | null {
    if (this.#lowX > this.#highX) return null;
    const mm = (steps: number, axis: 0 | 1 | 2): number => header.originMm[axis] + steps * header.stepMm;
    return {
      min: [mm(this.#lowX, 0), mm(this.#lowY, 1), mm(this.#lowZ, 2)],
      max: [mm(this.#highX, 0), mm(this.#highY, 1), mm(this.#highZ, 2)],
    };
  }
}

/** Four words a vertex, in order, in chunks. */
export class TexelStore {
  readonly chunks: Chunk[] = [];
  readonly #blank: number;
  #count = 0;

  /** `blank`: the third word of a texel without a vertex; the others are 0. */
  constructor(blank: number) {
    this.#blank = blank;
  }

  get count(): number {
    return this.#count;
  }

  /** Adds texels; a rest of less than one is left out. */
  append(words: Uint32Array): void {
    const total = Math.floor(words.length / WORDS_PER_VERTEX);
    let taken = 0;
    while (taken < total) {
      const chunk = this.#open();
      const free = VERTICES_PER_CHUNK - chunk.count;
      const count = Math.min(free, total - taken);
      const part = words.subarray(taken * WORDS_PER_VERTEX, (taken + count) * WORDS_PER_VERTEX);
      write(chunk, chunk.count, part, this.#blank);
      const before = this.chunks.at(-2);
      if (before && chunk.count === 0)
        write(before, before.count, part.subarray(0, TRAIL_TEXELS * WORDS_PER_VERTEX), this.#blank);
      chunk.count += count;
      taken += count;
      this.#count += count;
    }
  }

  /** The chunk that a vertex is its own in, if it is there. */
  chunkOf(vertex: VertexIndex): Chunk | undefined {
    return this.chunks[Math.floor(vertex / VERTICES_PER_CHUNK)];
  }

  /** Where a range of vertices lies. */
  split(range: VertexRange): ChunkRange[] {
    const parts: ChunkRange[] = [];
    const start = Math.max(Math.floor(range.first / VERTICES_PER_CHUNK), 0);
    for (let at = start; at < this.chunks.length; at++) {
      const chunk = this.chunks[at];
      if (!chunk || chunk.firstVertex >= range.end) break;
      const first = Math.max(range.first - chunk.firstVertex, 0);
      const end = Math.min(range.end - chunk.firstVertex, chunk.count);
      if (end > first) parts.push({ chunk, first, count: end - first });
    }
    return parts;
  }

  /** The chunk with room for at least one vertex. */
  #open(): Chunk {
    const last = this.chunks.at(-1);
    if (last && last.count < VERTICES_PER_CHUNK) return last;
    const chunk: Chunk = {
      firstVertex: this.#count,
      data: new Uint32Array(TEXELS_PER_ROW * WORDS_PER_VERTEX),
      rows: 1,
      count: 0,
      version: 0,
    };
    if (last) {
      const from = last.count * WORDS_PER_VERTEX;
      chunk.data.set(last.data.subarray(from, from + LEAD_TEXELS * WORDS_PER_VERTEX));
    } else {
      for (let texel = 0; texel < LEAD_TEXELS; texel++)
        chunk.data[texel * WORDS_PER_VERTEX + 2] = this.#blank;
    }
    this.chunks.push(chunk);
    return chunk;
  }
}

/** The vertices of a file. */
export class VertexStore extends TexelStore {
  readonly header: VertexHeader;
  readonly #partBox = new StepBox();
  readonly #laidBox = new StepBox();
  readonly #wholeBox = new StepBox();

  constructor(header: VertexHeader) {
    // What is no vertex must not look like a neighbour.
    super(FLAGS.break);
    this.header = header;
  }

  /** The box of all that is laid down; of the part alone if there is one. */
  box(): BoxMm | null {
    return this.#partBox.inMm(this.header) ?? this.#laidBox.inMm(this.header);
  }

  /** The box of everything laid down, skirt and prime line too. */
  boxOfAll(): BoxMm | null {
    return this.#laidBox.inMm(this.header);
  }

  /** The box of all places, travels too. */
  boxOfPlaces(): BoxMm | null {
    return this.#wholeBox.inMm(this.header);
  }

  override append(words: Uint32Array): void {
    this.#measure(words, Math.floor(words.length / WORDS_PER_VERTEX));
    super.append(words);
  }

  #measure(words: Uint32Array, total: number): void {
    for (let at = 0; at < total * WORDS_PER_VERTEX; at += WORDS_PER_VERTEX) {
      const kind = words[at + 2] ?? 0;
      const x = (words[at] ?? 0) & POSITION_MASK;
      const y = (words[at + 1] ?? 0) & POSITION_MASK;
      const z = kind & POSITION_MASK;
      this.#wholeBox.add(x, y, z);
      if (kind & NOT_LAID) continue;
      this.#laidBox.add(x, y, z);
      if (((BESIDE_THE_PART >>> ((kind >>> 20) & 31)) & 1) === 0) this.#partBox.add(x, y, z);
    }
  }
}

/** Puts vertices behind the `at` that the chunk has of its own, and grows it by doubling its rows. */
function write(chunk: Chunk, at: number, words: Uint32Array, blank: number): void {
  const texels = LEAD_TEXELS + at + words.length / WORDS_PER_VERTEX + TRAIL_TEXELS;
  const needed = Math.min(Math.ceil(texels / TEXELS_PER_ROW), ROWS_PER_CHUNK);
  if (needed > chunk.rows) {
    chunk.rows = Math.min(Math.max(needed, chunk.rows * 2), ROWS_PER_CHUNK);
    const grown = new Uint32Array(chunk.rows * TEXELS_PER_ROW * WORDS_PER_VERTEX);
    grown.set(chunk.data);
    chunk.data = grown;
  }
  chunk.data.set(words, (LEAD_TEXELS + at) * WORDS_PER_VERTEX);
  // The texel behind the last one, until that one comes.
  const behind = (LEAD_TEXELS + at) * WORDS_PER_VERTEX + words.length;
  if (behind < chunk.data.length) chunk.data[behind + 2] = blank;
  chunk.version += 1;
}
