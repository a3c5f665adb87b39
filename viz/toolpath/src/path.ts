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
import { PathUniforms, type Uniforms } from './path_uniforms';
import {
  BEAD_FRAGMENT,
  BEAD_VERTEX,
  FLAT_FRAGMENT,
  MARKER_FRAGMENT,
  MARKER_VERTEX,
  POINTS_PER_BEAD,
  TRAVEL_VERTEX,
} from './shaders';
import { WORDS_PER_VERTEX } from './vertex';

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

/** A chunk on the GPU. */
interface Copy {
  readonly chunk: Chunk;
  texture: DataTexture;
  version: number;
}

/** Three.js objects of one chunk. */
interface Drawn {
  vertices: Copy | null;
  channels: Copy | null;
  readonly uniforms: Uniforms;
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

function texelsOf(data: Uint32Array<ArrayBuffer>, width: number, rows: number): DataTexture {
  const texture = new DataTexture(data, width, rows, RGBAIntegerFormat, UnsignedIntType);
  texture.internalFormat = 'RGBA32UI';
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.generateMipmaps = false;
  texture.needsUpdate = true;
  return texture;
}

const copyOf = (chunk: Chunk): Copy => ({
  chunk,
  texture: texelsOf(chunk.data, TEXELS_PER_ROW, chunk.rows),
  version: chunk.version,
});

/** Where a chunk has no channels yet. */
const NOTHING = texelsOf(new Uint32Array(WORDS_PER_VERTEX), 1, 1);

export class PathObjects {
  readonly scene = new Scene();
  readonly uniforms = new PathUniforms();
  readonly #pattern: readonly number[];
  readonly #defines: Record<string, number>;
  readonly #drawn: Drawn[] = [];
  /** Objects without a chunk: as long as there are any, the shaders stay compiled. */
  #spare: Drawn | null = null;
  #index: BufferAttribute | null = null;

  constructor(shape: BeadShape) {
    this.#pattern = SHAPES[shape];
    this.#defines = shape === 'body' ? { LIT_AT_CORNERS: 1 } : {};
    this.scene.matrixWorldAutoUpdate = false;
  }

  /** Brings textures up to date with the stores' chunks. */
  sync(vertices: readonly Chunk[], channels: readonly Chunk[]): void {
    for (const [at, chunk] of vertices.entries()) {
      const drawn = this.#drawn[at];
      if (!drawn) this.#drawn.push(this.#objectsOf(chunk));
      else if (drawn.vertices && refresh(drawn.vertices)) {
        put(drawn.uniforms, 'uVertices', drawn.vertices.texture);
      }
    }
    for (const [at, chunk] of channels.entries()) {
      const drawn = this.#drawn[at];
      if (!drawn || drawn.channels?.version === chunk.version) continue;
      if (drawn.channels) refresh(drawn.channels);
      else drawn.channels = copyOf(chunk);
      put(drawn.uniforms, 'uChannels', drawn.channels.texture);
      put(drawn.uniforms, 'uChannelCount', chunk.count);
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
    this.uniforms.set('uStride', parts[0]?.stride ?? 1);
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

  /** What is drawn next cannot be seen, but takes every shader. */
  showNothing(): void {
    if (this.#drawn.length > 0) return;
    this.#spare ??= this.#create();
    const { beads, travels, markers } = this.#spare;
    beads.visible = true;
    beads.geometry.addGroup(0, this.#pattern.length, 0);
    travels.visible = true;
    travels.geometry.setDrawRange(0, 2);
    markers.visible = true;
    markers.geometry.setDrawRange(0, 1);
  }

  /** Nothing is drawn next. */
  hide(): void {
    this.#hideAll();
    if (this.#spare) hide(this.#spare);
  }

  /** Takes all chunks away; shared parts and compiled shaders stay. */
  clear(): void {
    for (const drawn of this.#drawn) {
      letGo(drawn);
      if (this.#spare) this.#release(drawn);
      else this.#spare = drawn;
    }
    this.#drawn.length = 0;
  }

  /** Takes everything away that was on the GPU. */
  release(): void {
    this.clear();
    if (this.#spare) this.#release(this.#spare);
    this.#spare = null;
  }

  #of(chunk: Chunk): Drawn | undefined {
    return this.#drawn[Math.floor(chunk.firstVertex / VERTICES_PER_CHUNK)];
  }

  #hideAll(): void {
    for (const drawn of this.#drawn) hide(drawn);
  }

  #objectsOf(chunk: Chunk): Drawn {
    const drawn = this.#spare ?? this.#create();
    this.#spare = null;
    drawn.vertices = copyOf(chunk);
    put(drawn.uniforms, 'uVertices', drawn.vertices.texture);
    put(drawn.uniforms, 'uBase', chunk.firstVertex);
    return drawn;
  }

  #create(): Drawn {
    this.#index ??= beadIndex(this.#pattern);
    const uniforms: Uniforms = {
      ...this.uniforms.all,
      uVertices: { value: NOTHING },
      uChannels: { value: NOTHING },
      uChannelCount: { value: 0 },
      uBase: { value: 0 },
    };
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
      vertices: null,
      channels: null,
      uniforms,
      beads: this.#add(new Mesh(geometry, [material(BEAD_VERTEX, BEAD_FRAGMENT)])),
      travels: this.#add(new LineSegments(new BufferGeometry(), material(TRAVEL_VERTEX, FLAT_FRAGMENT))),
      markers: this.#add(new Points(new BufferGeometry(), material(MARKER_VERTEX, MARKER_FRAGMENT))),
    };
  }

  #add<T extends Object3D>(object: T): T {
    object.frustumCulled = false;
    object.matrixAutoUpdate = false;
    object.visible = false;
    this.scene.add(object);
    return object;
  }

  #release({ beads, travels, markers }: Drawn): void {
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

function hide({ beads, travels, markers }: Drawn): void {
  for (const object of [beads, travels, markers]) object.visible = false;
  beads.geometry.clearGroups();
}

/** A chunk's textures go, the objects stay. */
function letGo(drawn: Drawn): void {
  hide(drawn);
  drawn.vertices?.texture.dispose();
  drawn.channels?.texture.dispose();
  drawn.vertices = null;
  drawn.channels = null;
  put(drawn.uniforms, 'uVertices', NOTHING);
  put(drawn.uniforms, 'uChannels', NOTHING);
  put(drawn.uniforms, 'uChannelCount', 0);
}

function put(uniforms: Uniforms, name: string, value: unknown): void {
  const uniform = uniforms[name];
  if (uniform) uniform.value = value;
}

/** Brings a copy up to date; true if it has another texture now. */
function refresh(copy: Copy): boolean {
  const { chunk, texture } = copy;
  if (copy.version === chunk.version) return false;
  copy.version = chunk.version;
  if (texture.image.data === chunk.data) {
    texture.needsUpdate = true;
    return false;
  }
  texture.dispose();
  copy.texture = texelsOf(chunk.data, TEXELS_PER_ROW, chunk.rows);
  return true;
}
