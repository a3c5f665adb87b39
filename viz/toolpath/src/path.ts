/**
 * The toolpath as three.js objects: for each chunk of vertices one texture and a mesh of beads, lines of travels and
 * points of markers that pull from it.
 *
 * Does: uploads, uniforms, and which ranges the next rendering draws. Does not know: camera, frames, when to draw.
 */
import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  DoubleSide,
  GLSL3,
  type IUniform,
  LineSegments,
  Mesh,
  NearestFilter,
  type Object3D,
  Points,
  RawShaderMaterial,
  RGBAIntegerFormat,
  Scene,
  UnsignedIntType,
} from 'three';
import { type Chunk, type ChunkRange, TEXELS_PER_ROW, VERTICES_PER_CHUNK } from './chunks';
import { featureTable, type Palette, rgb } from './palette';
import {
  BEAD_FRAGMENT,
  BEAD_VERTEX,
  FLAT_FRAGMENT,
  MARKER_VERTEX,
  POINTS_PER_BEAD,
  TRAVEL_VERTEX,
} from './shaders';
import type { VertexHeader } from './vertex';

/** A vertex that no file reaches: everything is printed. */
export const ALL_PRINTED = 0xffff_ffff;

/** Two strips of the facing half: left outline to nearest point, nearest point to right outline. */
const BODY = [0, 5, 1, 1, 5, 6, 1, 6, 2, 2, 6, 7];
/** Four triangles from each end's outline to its tip. */
const CAPS = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4, 5, 6, 9, 6, 7, 9, 7, 8, 9, 8, 5, 9];

/** Bodies alone, or with the caps. */
export type BeadShape = 'body' | 'whole';
const SHAPES: Readonly<Record<BeadShape, readonly number[]>> = { body: BODY, whole: [...BODY, ...CAPS] };

export interface PathPart {
  readonly range: ChunkRange;
  /** One of so many segments. */
  readonly stride: number;
}

type Uniforms = Record<string, IUniform>;

/** Three.js objects of one chunk. */
interface Drawn {
  readonly chunk: Chunk;
  texture: DataTexture;
  version: number;
  readonly sampler: IUniform<DataTexture>;
  readonly beads: Mesh<BufferGeometry, RawShaderMaterial[]>;
  readonly travels: LineSegments<BufferGeometry, RawShaderMaterial>;
  readonly markers: Points<BufferGeometry, RawShaderMaterial>;
}

/** Corner numbers of the beads of a whole chunk, shared by all. */
function beadIndex(pattern: readonly number[]): BufferAttribute {
  const index = new Uint32Array(VERTICES_PER_CHUNK * pattern.length);
  let at = 0;
  for (let bead = 0; bead < VERTICES_PER_CHUNK; bead++) {
    for (const corner of pattern) index[at++] = bead * POINTS_PER_BEAD + corner;
  }
  return new BufferAttribute(index, 1);
}

function textureOf(chunk: Chunk): DataTexture {
  const texture = new DataTexture(chunk.data, TEXELS_PER_ROW, chunk.rows, RGBAIntegerFormat, UnsignedIntType);
  texture.internalFormat = 'RGBA32UI';
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.generateMipmaps = false;
  texture.needsUpdate = true;
  return texture;
}

export class PathObjects {
  readonly scene = new Scene();
  readonly #pattern: readonly number[];
  readonly #defines: Record<string, number>;
  readonly #drawn: Drawn[] = [];
  readonly #shared: Uniforms = {
    uOrigin: { value: [0, 0, 0] },
    uStep: { value: 2 ** -10 },
    uPrinted: { value: ALL_PRINTED },
    uFeatures: { value: ALL_PRINTED },
    uStride: { value: 1 },
    uHeightScale: { value: 1 },
    uBedZ: { value: 0 },
    uPixelAngle: { value: 0 },
    uDefaultSize: { value: [0.45, 0.2] },
    uPalette: { value: new Float32Array(0) },
    uMarkers: { value: 0 },
    uMarkerPx: { value: 6 },
    ...Object.fromEntries(
      ['uRemaining', 'uTravel', 'uWipe', 'uRetract', 'uUnretract', 'uSeam'].map((name) => [
        name,
        { value: [0, 0, 0] },
      ]),
    ),
  };
  #index: BufferAttribute | null = null;

  constructor(shape: BeadShape) {
    this.#pattern = SHAPES[shape];
    this.#defines = shape === 'body' ? { LIT_AT_CORNERS: 1 } : {};
    this.scene.matrixWorldAutoUpdate = false;
  }

  set header(header: VertexHeader) {
    this.#set('uOrigin', [...header.originMm]);
    this.#set('uStep', header.stepMm);
  }

  set palette(palette: Palette) {
    this.#set('uPalette', featureTable(palette));
    this.#set('uRemaining', rgb(palette.remaining));
    this.#set('uTravel', rgb(palette.travel));
    this.#set('uWipe', rgb(palette.wipe));
    this.#set('uRetract', rgb(palette.retract));
    this.#set('uUnretract', rgb(palette.unretract));
    this.#set('uSeam', rgb(palette.seam));
  }

  /** Bit `n`: beads of feature `n` are shown. */
  set features(mask: number) {
    this.#set('uFeatures', mask);
  }

  /** The flags whose vertices are marked. */
  set markers(flags: number) {
    this.#set('uMarkers', flags);
  }

  /** The first vertex that is not printed, or {@link ALL_PRINTED}. */
  set printed(vertex: number) {
    this.#set('uPrinted', vertex);
  }

  set heightScale(scale: number) {
    this.#set('uHeightScale', scale);
  }

  /** Pixels of the drawing buffer: what one covers a millimetre away, and how many make a CSS pixel. */
  setPixels(angle: number, ratio: number): void {
    this.#set('uPixelAngle', angle);
    this.#set('uMarkerPx', 6 * ratio);
  }

  /** Brings textures up to date with the store's chunks. */
  sync(chunks: readonly Chunk[]): void {
    for (const [at, chunk] of chunks.entries()) {
      const drawn = this.#drawn[at];
      if (!drawn) this.#drawn.push(this.#create(chunk));
      else if (drawn.version !== chunk.version) refresh(drawn);
    }
  }

  /** Beads of these parts are drawn next, and nothing else. */
  showBeads(parts: readonly PathPart[]): void {
    this.#hideAll();
    for (const { range, stride } of parts) {
      const drawn = this.#of(range.chunk);
      if (!drawn) continue;
      const perBead = this.#pattern.length;
      const first = Math.ceil(range.first / stride);
      const end = Math.ceil((range.first + range.count) / stride);
      drawn.beads.visible = true;
      drawn.beads.geometry.addGroup(first * perBead, (end - first) * perBead, 0);
    }
    this.#set('uStride', parts[0]?.stride ?? 1);
  }

  /** Travels and markers of these ranges are drawn next, and nothing else. */
  showLines(
    ranges: readonly ChunkRange[],
    what: { readonly travels: boolean; readonly markers: boolean },
  ): void {
    this.#hideAll();
    for (const range of ranges) {
      const drawn = this.#of(range.chunk);
      if (!drawn) continue;
      drawn.travels.visible = what.travels;
      drawn.travels.geometry.setDrawRange(range.first * 2, range.count * 2);
      drawn.markers.visible = what.markers;
      drawn.markers.geometry.setDrawRange(range.first, range.count);
    }
  }

  /** Takes all chunks away; shared parts stay. */
  clear(): void {
    for (const drawn of this.#drawn) this.#release(drawn);
    this.#drawn.length = 0;
  }

  #set(name: string, value: unknown): void {
    const uniform = this.#shared[name];
    if (uniform) uniform.value = value;
  }

  #of(chunk: Chunk): Drawn | undefined {
    return this.#drawn[Math.floor(chunk.firstVertex / VERTICES_PER_CHUNK)];
  }

  #hideAll(): void {
    for (const { beads, travels, markers } of this.#drawn) {
      for (const object of [beads, travels, markers]) object.visible = false;
      beads.geometry.clearGroups();
    }
  }

  #create(chunk: Chunk): Drawn {
    this.#index ??= beadIndex(this.#pattern);
    const texture = textureOf(chunk);
    const sampler = { value: texture };
    const uniforms: Uniforms = { ...this.#shared, uVertices: sampler, uBase: { value: chunk.firstVertex } };
    const material = (vertexShader: string, fragmentShader: string): RawShaderMaterial => {
      const made = new RawShaderMaterial({
        glslVersion: GLSL3,
        vertexShader,
        fragmentShader,
        side: DoubleSide,
        defines: this.#defines,
      });
      // Assigned, not given to the constructor, which would copy: the shared ones must stay shared.
      made.uniforms = uniforms;
      return made;
    };
    const geometry = new BufferGeometry().setIndex(this.#index);
    return {
      chunk,
      texture,
      sampler,
      version: chunk.version,
      beads: this.#add(new Mesh(geometry, [material(BEAD_VERTEX, BEAD_FRAGMENT)])),
      travels: this.#add(new LineSegments(new BufferGeometry(), material(TRAVEL_VERTEX, FLAT_FRAGMENT))),
      markers: this.#add(new Points(new BufferGeometry(), material(MARKER_VERTEX, FLAT_FRAGMENT))),
    };
  }

  #add<T extends Object3D>(object: T): T {
    object.frustumCulled = false;
    object.matrixAutoUpdate = false;
    object.visible = false;
    this.scene.add(object);
    return object;
  }

  #release({ texture, beads, travels, markers }: Drawn): void {
    texture.dispose();
    this.scene.remove(beads, travels, markers);
    // The index is shared with the chunks to come.
    beads.geometry.setIndex(null).dispose();
    for (const material of beads.material) material.dispose();
    for (const object of [travels, markers]) {
      object.geometry.dispose();
      object.material.dispose();
    }
  }
}

function refresh(drawn: Drawn): void {
  const { chunk, texture } = drawn;
  if (texture.image.data === chunk.data) {
    texture.needsUpdate = true;
  } else {
    texture.dispose();
    drawn.texture = textureOf(chunk);
    drawn.sampler.value = drawn.texture;
  }
  drawn.version = chunk.version;
}
