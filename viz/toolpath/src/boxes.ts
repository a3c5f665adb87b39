/**
 * Boxes around runs of segments, and around runs of those: what a ray misses need not be looked at.
 *
 * Does: takes the store's vertices as far as they have come, each once. Does not know: rays, what is shown. Units: mm; 24
 * bytes for 64 segments.
 */
import { type ChunkRange, LEAD_TEXELS, type VertexStore } from './chunks';
import { FIELDS, FLAGS, SIZE_STEP_MM, WORDS_PER_VERTEX } from './vertex';

/** Segments in a block, and blocks in a group. */
export const PER_BLOCK = 64;
export const PER_GROUP = 64;
const NUMBERS = 6;
const POSITION = 0xf_ffff;
const HEIGHT = (1 << FIELDS.height.bits) - 1;
/** Where a bead's size is not known. */
export const DEFAULT_WIDTH_MM = 0.45;
export const DEFAULT_HEIGHT_MM = 0.2;

/** Boxes one behind the other: least x, y, z, greatest x, y, z; an empty one is from Infinity to −Infinity. */
class Boxes {
  data = new Float32Array(256 * NUMBERS);

  /** Puts a box there. */
  set(box: number, from: Float64Array): void {
    const at = box * NUMBERS;
    if (at + NUMBERS > this.data.length) {
      const grown = new Float32Array(this.data.length * 2);
      grown.set(this.data);
      this.data = grown;
    }
    this.data.set(from, at);
  }
}

function empty(box: Float64Array): void {
  box.fill(Infinity, 0, 3);
  box.fill(-Infinity, 3, NUMBERS);
}

export class BoxTree {
  readonly blocks = new Boxes();
  readonly groups = new Boxes();
  readonly #store: VertexStore;
  readonly #block = new Float64Array(NUMBERS);
  readonly #group = new Float64Array(NUMBERS);
  #count = 0;

  constructor(store: VertexStore) {
    this.#store = store;
  }

  /** Vertices that have a box. */
  get count(): number {
    return this.#count;
  }

  get groupCount(): number {
    return Math.ceil(this.#count / (PER_BLOCK * PER_GROUP));
  }

  /** Takes what has come since. */
  update(): void {
    const { count } = this.#store;
    if (this.#count === count) return;
    // A block and a group that were not full are done anew.
    let block = Math.floor(this.#count / PER_BLOCK);
    for (let group = Math.floor(block / PER_GROUP); block * PER_BLOCK < count; group++) {
      empty(this.#group);
      this.#include(group * PER_GROUP, block);
      for (; block < (group + 1) * PER_GROUP && block * PER_BLOCK < count; block++) {
        empty(this.#block);
        const end = Math.min((block + 1) * PER_BLOCK, count);
        for (const part of this.#store.split({ first: block * PER_BLOCK, end })) this.#measure(part);
        this.blocks.set(block, this.#block);
        this.#include(block, block + 1);
      }
      this.groups.set(group, this.#group);
    }
    this.#count = count;
  }

  /** Widens the group by blocks that are done. */
  #include(first: number, end: number): void {
    const { data } = this.blocks;
    for (let block = first; block < end; block++) {
      for (let axis = 0; axis < 3; axis++) {
        const [low, high] = [data[block * NUMBERS + axis] ?? 0, data[block * NUMBERS + 3 + axis] ?? 0];
        this.#group[axis] = Math.min(this.#group[axis] ?? 0, low);
        this.#group[axis + 3] = Math.max(this.#group[axis + 3] ?? 0, high);
      }
    }
  }

  /** Widens the block by segments: first in whole steps, for there are millions. */
  #measure({ chunk: { data }, first, count }: ChunkRange): void {
    let [lowX, lowY, lowZ, highX, highY, highZ] = [POSITION, POSITION, POSITION, 0, 0, 0];
    let [width, height] = [0, 0];
    let isEmpty = true;
    const end = (LEAD_TEXELS + first + count) * WORDS_PER_VERTEX;
    // From the vertex before, for a segment begins there.
    for (let base = (LEAD_TEXELS + first - 1) * WORDS_PER_VERTEX; base < end; base += WORDS_PER_VERTEX) {
      const x = data[base] ?? 0;
      const y = data[base + 1] ?? 0;
      const z = data[base + 2] ?? 0;
      if ((z & FLAGS.break) === 0) isEmpty = false;
      lowX = Math.min(lowX, x & POSITION);
      lowY = Math.min(lowY, y & POSITION);
      lowZ = Math.min(lowZ, z & POSITION);
      highX = Math.max(highX, x & POSITION);
      highY = Math.max(highY, y & POSITION);
      highZ = Math.max(highZ, z & POSITION);
      width = Math.max(width, x >>> FIELDS.width.shift);
      height = Math.max(height, (y >>> FIELDS.height.shift) & HEIGHT);
    }
    if (isEmpty) return;
    const { originMm, stepMm } = this.#store.header;
    const half = Math.max(width * SIZE_STEP_MM, DEFAULT_WIDTH_MM) / 2;
    const down = Math.max(height * SIZE_STEP_MM, DEFAULT_HEIGHT_MM);
    const box = this.#block;
    box[0] = Math.min(box[0] ?? 0, originMm[0] + lowX * stepMm - half);
    box[1] = Math.min(box[1] ?? 0, originMm[1] + lowY * stepMm - half);
    box[2] = Math.min(box[2] ?? 0, originMm[2] + lowZ * stepMm - down);
    box[3] = Math.max(box[3] ?? 0, originMm[0] + highX * stepMm + half);
    box[4] = Math.max(box[4] ?? 0, originMm[1] + highY * stepMm + half);
    box[5] = Math.max(box[5] ?? 0, originMm[2] + highZ * stepMm);
  }
}
