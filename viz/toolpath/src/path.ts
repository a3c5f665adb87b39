/**
 * The toolpath as three.js objects: for each chunk of vertices a mesh of beads, lines of travels and points of markers that pull
 * from its textures.
 *
 * Does: objects, uniforms, and which ranges the next rendering draws. Does not know: camera, frames, when to draw.
 */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLSL3,
  LineSegments,
  Mesh,
  type Object3D,
  Points,
  RawShaderMaterial,
  Scene,
} from 'three';
import { type Chunk, type ChunkRange, VERTICES_PER_CHUNK } from './chunks';
import { PathUniforms, type Uniforms } from './path_uniforms';
import type { SegmentList, SegmentRange } from './segments';
import {
  BEAD_FRAGMENT,
  BEAD_VERTEX,
  FLAT_FRAGMENT,
  MARKER_FRAGMENT,
  MARKER_VERTEX,
  POINTS_PER_BEAD,
  TRAVEL_VERTEX,
} from './shaders';
import { ListTextures, NO_SEGMENTS, NO_TEXELS, type PathTextures } from './textures';

/** Two strips of the facing half: left outline to nearest point, nearest point to right outline. */
const BODY = [0, 5, 1, 1, 5, 6, 1, 6, 2, 2, 6, 7];
/** Four triangles from each end's outline to its tip. */
const CAPS = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4, 5, 6, 9, 6, 7, 9, 7, 8, 9, 8, 5, 9];

/** Beads of a list of segments, bodies alone; or of all segments, with caps, and lines and markers. */
export type PathKind = 'listed' | 'whole';
const SHAPES: Readonly<Record<PathKind, readonly number[]>> = { listed: BODY, whole: [...BODY, ...CAPS] };

/** Beads that are drawn: of a chunk, some in a row. */
export interface BeadRange {
  readonly chunk: number;
  readonly first: number;
  readonly count: number;
}

export const beadsOf = ({ chunk, first, count }: ChunkRange): BeadRange => ({
  chunk: Math.floor(chunk.firstVertex / VERTICES_PER_CHUNK),
  first,
  count,
});
export const listedBeadsOf = ({ chunk, first, count }: SegmentRange): BeadRange => ({
  chunk: chunk.index,
  first,
  count,
});

/** Three.js objects of one chunk. */
interface Drawn {
  readonly uniforms: Uniforms;
  readonly beads: Mesh<BufferGeometry, RawShaderMaterial[]>;
  readonly travels: LineSegments<BufferGeometry, RawShaderMaterial>;
  readonly markers: Points<BufferGeometry, RawShaderMaterial>;
}

const indices = new Map<readonly number[], BufferAttribute>();

/** Corner numbers of the beads of a whole chunk, shared by all. */
function beadIndex(pattern: readonly number[]): BufferAttribute {
  const known = indices.get(pattern);
  if (known) return known;
  const index = new Uint32Array(VERTICES_PER_CHUNK * pattern.length);
  let at = 0;
  for (let bead = 0; bead < VERTICES_PER_CHUNK; bead++) {
    for (const corner of pattern) index[at++] = bead * POINTS_PER_BEAD + corner;
  }
  const made = new BufferAttribute(index, 1);
  indices.set(pattern, made);
  return made;
}

export class PathObjects {
  readonly scene = new Scene();
  readonly uniforms = new PathUniforms();
  readonly #textures: PathTextures;
  readonly #lists: ListTextures | null;
  readonly #pattern: readonly number[];
  readonly #defines: Record<string, number>;
  readonly #drawn: Drawn[] = [];
  /** Objects without a chunk: as long as there are any, the shaders stay compiled. */
  #spare: Drawn | null = null;

  constructor(kind: PathKind, textures: PathTextures) {
    this.#pattern = SHAPES[kind];
    this.#defines = kind === 'listed' ? { LISTED: 1 } : {};
    this.#lists = kind === 'listed' ? new ListTextures() : null;
    this.#textures = textures;
    this.scene.matrixWorldAutoUpdate = false;
  }

  /** Brings textures up to date with the stores' chunks, and the list's. */
  sync(vertices: readonly Chunk[], channels: readonly Chunk[], list: SegmentList | null = null): void {
    for (const [at, chunk] of vertices.entries()) {
      let drawn = this.#drawn[at];
      if (!drawn) {
        drawn = this.#objectsOf(chunk);
        this.#drawn.push(drawn);
      }
      put(drawn.uniforms, 'uVertices', this.#textures.vertices(at, chunk));
      const known = channels[at];
      if (known) {
        put(drawn.uniforms, 'uChannels', this.#textures.channels(at, known));
        put(drawn.uniforms, 'uChannelCount', known.count);
      }
      const listed = list?.chunks[at];
      if (listed && this.#lists) {
        put(drawn.uniforms, 'uSegments', this.#lists.segments(at, listed));
        put(drawn.uniforms, 'uSegmentCount', listed.count);
      }
    }
  }

  /** Beads of these parts are drawn next, one of so many, and nothing else. */
  showBeads(parts: readonly BeadRange[], stride = 1): void {
    this.#hideAll();
    for (const { chunk, first: from, count } of parts) {
      const drawn = this.#drawn[chunk];
      if (!drawn) continue;
      const perBead = this.#pattern.length;
      const first = Math.ceil(from / stride);
      const end = Math.ceil((from + count) / stride);
      drawn.beads.visible = true;
      drawn.beads.geometry.addGroup(first * perBead, (end - first) * perBead, 0);
    }
    this.uniforms.set('uStride', stride);
  }

  /** Travels and markers of these ranges are drawn next, and nothing else. */
  showLines(
    ranges: readonly ChunkRange[],
    what: { readonly travels: boolean; readonly markers: boolean },
  ): void {
    this.#hideAll();
    for (const range of ranges) {
      const drawn = this.#drawn[beadsOf(range).chunk];
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
    this.#lists?.clear();
  }

  /** Takes everything away that was on the GPU. */
  release(): void {
    this.clear();
    if (this.#spare) this.#release(this.#spare);
    this.#spare = null;
  }

  #hideAll(): void {
    for (const drawn of this.#drawn) hide(drawn);
  }

  #objectsOf(chunk: Chunk): Drawn {
    const drawn = this.#spare ?? this.#create();
    this.#spare = null;
    put(drawn.uniforms, 'uBase', chunk.firstVertex);
    return drawn;
  }

  #create(): Drawn {
    const uniforms: Uniforms = {
      ...this.uniforms.all,
      uVertices: { value: NO_TEXELS },
      uChannels: { value: NO_TEXELS },
      uChannelCount: { value: 0 },
      uSegments: { value: NO_SEGMENTS },
      uSegmentCount: { value: 0 },
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
    const geometry = new BufferGeometry().setIndex(beadIndex(this.#pattern));
    return {
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
  put(drawn.uniforms, 'uVertices', NO_TEXELS);
  put(drawn.uniforms, 'uChannels', NO_TEXELS);
  put(drawn.uniforms, 'uChannelCount', 0);
  put(drawn.uniforms, 'uSegments', NO_SEGMENTS);
  put(drawn.uniforms, 'uSegmentCount', 0);
}

function put(uniforms: Uniforms, name: string, value: unknown): void {
  const uniform = uniforms[name];
  if (uniform) uniform.value = value;
}
