/**
 * The bed's mesh as a surface on the plate: differences of height many times as large as they are, coloured from low to high.
 *
 * Its lowest point lies on the plate, so that the plate hides none of it.
 * Does not know: how it was measured. Units: mm, in the machine's coordinates.
 */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLSL3,
  Group,
  LineSegments,
  Mesh,
  RawShaderMaterial,
} from 'three';
import type { BoxMm } from './camera';
import { RAMPS, rampAt } from './colours';
import { type BedMesh, exaggerationOf, heightRange } from './mesh';
import { type Palette, rgb } from './palette';
import { FLAT_FRAGMENT, FLAT_VERTEX } from './shaders';

/** Places and colours of the points, and the corners of triangles and of the lines between neighbours. */
export function meshCorners(mesh: BedMesh): {
  readonly places: Float32Array<ArrayBuffer>;
  readonly colours: Float32Array<ArrayBuffer>;
  readonly triangles: number[];
  readonly lines: number[];
} {
  const { columns, rows, originMm, stepMm, heightsMm } = mesh;
  const [min, max] = heightRange(mesh);
  const times = exaggerationOf(mesh);
  const places = new Float32Array(columns * rows * 3);
  const colours = new Float32Array(columns * rows * 3);
  const triangles: number[] = [];
  const lines: number[] = [];
  for (let point = 0; point < columns * rows; point++) {
    const [column, row] = [point % columns, Math.floor(point / columns)];
    const height = heightsMm[point] ?? 0;
    places.set(
      [originMm[0] + column * stepMm[0], originMm[1] + row * stepMm[1], (height - min) * times],
      point * 3,
    );
    colours.set(rampAt(RAMPS.light, max > min ? (height - min) / (max - min) : 0.5), point * 3);
    const [right, behind] = [point + 1, point + columns];
    if (column + 1 < columns) lines.push(point, right);
    if (row + 1 < rows) lines.push(point, behind);
    if (column + 1 < columns && row + 1 < rows)
      triangles.push(point, right, behind + 1, point, behind + 1, behind);
  }
  return { places, colours, triangles, lines };
}

const COLOURED_VERTEX = /* glsl */ `
precision highp float;
in vec3 position;
in vec3 shade;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
out vec3 vColour;
void main() {
  vColour = shade;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}
`;

/** Lets the plate be seen through it. */
const SURFACE_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vColour;
out vec4 colour;
void main() { colour = vec4(vColour, 0.72); }
`;

export class SurfaceObject {
  readonly group = new Group();
  /** The space that it takes as drawn. */
  box: BoxMm | null = null;
  readonly #surface = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: COLOURED_VERTEX,
    fragmentShader: SURFACE_FRAGMENT,
    side: DoubleSide,
    transparent: true,
    depthWrite: false,
  });
  readonly #lines = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: FLAT_VERTEX,
    fragmentShader: FLAT_FRAGMENT,
    uniforms: { uColour: { value: [0, 0, 0] } },
    depthWrite: false,
  });

  set(mesh: BedMesh): void {
    this.clear();
    const { places, colours, triangles, lines } = meshCorners(mesh);
    const position = new BufferAttribute(places, 3);
    const surface = new BufferGeometry().setIndex(triangles);
    surface.setAttribute('position', position).setAttribute('shade', new BufferAttribute(colours, 3));
    const wires = new BufferGeometry().setIndex(lines).setAttribute('position', position);
    for (const object of [new Mesh(surface, this.#surface), new LineSegments(wires, this.#lines)]) {
      object.frustumCulled = false;
      object.matrixAutoUpdate = false;
      this.group.add(object);
    }
    const times = exaggerationOf(mesh);
    const [low, high] = heightRange(mesh);
    const [x, y] = mesh.originMm;
    this.box = {
      min: [x, y, 0],
      max: [
        x + (mesh.columns - 1) * mesh.stepMm[0],
        y + (mesh.rows - 1) * mesh.stepMm[1],
        (high - low) * times,
      ],
    };
  }

  set palette(palette: Palette) {
    const uniform = this.#lines.uniforms['uColour'];
    if (uniform) uniform.value = rgb(palette.bedEdge);
  }

  clear(): void {
    this.release();
    this.group.clear();
    this.box = null;
  }

  /** Lets go of what is on the GPU; it comes anew when it is next drawn. */
  release(): void {
    for (const object of this.group.children as (Mesh | LineSegments)[]) object.geometry.dispose();
    this.#surface.dispose();
    this.#lines.dispose();
  }
}
