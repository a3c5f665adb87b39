/**
 * What the path is pulled from on the GPU: for each chunk of vertices a texture, one of its channels, and lists of segments.
 *
 * Does: uploads what has changed, each texel as seldom as its chunk is looked at. Does not know: what is drawn of it.
 */
import {
  DataTexture,
  NearestFilter,
  type PixelFormat,
  type PixelFormatGPU,
  RedIntegerFormat,
  RGBAIntegerFormat,
  UnsignedIntType,
} from 'three';
import { type Chunk, TEXELS_PER_ROW } from './chunks';
import type { SegmentChunk } from './segments';
import { WORDS_PER_VERTEX } from './vertex';

function wordsOf(
  data: Uint32Array<ArrayBuffer>,
  width: number,
  format: PixelFormat,
  internal: PixelFormatGPU,
): DataTexture {
  const rows = data.length / width / (format === RedIntegerFormat ? 1 : WORDS_PER_VERTEX);
  const texture = new DataTexture(data, width, rows, format, UnsignedIntType);
  texture.internalFormat = internal;
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.generateMipmaps = false;
  texture.unpackAlignment = 4;
  texture.needsUpdate = true;
  return texture;
}

const texelsOf = (data: Uint32Array<ArrayBuffer>, width = TEXELS_PER_ROW): DataTexture =>
  wordsOf(data, width, RGBAIntegerFormat, 'RGBA32UI');
const listOf = (data: Uint32Array<ArrayBuffer>, width = TEXELS_PER_ROW): DataTexture =>
  wordsOf(data, width, RedIntegerFormat, 'R32UI');

/** Where a chunk has none of them. */
export const NO_TEXELS = texelsOf(new Uint32Array(WORDS_PER_VERTEX), 1);
export const NO_SEGMENTS = listOf(new Uint32Array(1), 1);

/** Something that grows, and its texture. */
class Copy<T extends { readonly data: Uint32Array<ArrayBuffer>; readonly count: number }> {
  readonly #make: (data: Uint32Array<ArrayBuffer>) => DataTexture;
  #texture: DataTexture | null = null;
  #count = -1;
  #version = -1;

  constructor(make: (data: Uint32Array<ArrayBuffer>) => DataTexture) {
    this.#make = make;
  }

  /** The texture with all that is there. `version`: what else than the count tells of a change. */
  of({ data, count }: T, version = 0): DataTexture {
    if (this.#texture?.image.data === data) {
      if (count !== this.#count || version !== this.#version) this.#texture.needsUpdate = true;
    } else {
      this.#texture?.dispose();
      this.#texture = this.#make(data);
    }
    this.#count = count;
    this.#version = version;
    return this.#texture;
  }

  release(): void {
    this.#texture?.dispose();
    this.#texture = null;
  }
}

/** Textures of things in a row, of which only the last ones change. */
class Copies<T extends { readonly data: Uint32Array<ArrayBuffer>; readonly count: number }> {
  readonly #copies: Copy<T>[] = [];
  readonly #make: (data: Uint32Array<ArrayBuffer>) => DataTexture;

  constructor(make: (data: Uint32Array<ArrayBuffer>) => DataTexture) {
    this.#make = make;
  }

  of(at: number, thing: T, version?: number): DataTexture {
    while (this.#copies.length <= at) this.#copies.push(new Copy(this.#make));
    return (this.#copies[at] as Copy<T>).of(thing, version);
  }

  clear(): void {
    for (const copy of this.#copies) copy.release();
    this.#copies.length = 0;
  }
}

/** Vertices and channels of a file, shared by all that is drawn of it. */
export class PathTextures {
  readonly #vertices = new Copies<Chunk>(texelsOf);
  readonly #channels = new Copies<Chunk>(texelsOf);

  vertices(at: number, chunk: Chunk): DataTexture {
    return this.#vertices.of(at, chunk, chunk.version);
  }

  channels(at: number, chunk: Chunk): DataTexture {
    return this.#channels.of(at, chunk, chunk.version);
  }

  /** Lets go of all; what is asked for again comes anew. */
  clear(): void {
    this.#vertices.clear();
    this.#channels.clear();
  }
}

/** Lists of segments of a file. */
export class ListTextures {
  readonly #lists = new Copies<SegmentChunk>(listOf);

  segments(at: number, chunk: SegmentChunk): DataTexture {
    return this.#lists.of(at, chunk);
  }

  clear(): void {
    this.#lists.clear();
  }
}
