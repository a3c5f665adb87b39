/**
 * The nozzle's place: a small nozzle whose tip stands at a point, of the same size on the screen wherever it is.
 *
 * It lies over the picture, in front of everything, so that moving it draws neither path nor bed anew. Does not know:
 * where the nozzle is or how that is known. Units: mm, CSS pixels.
 */
import { BufferAttribute, BufferGeometry, FrontSide, Scene } from 'three';
import type { Vec3 } from './camera';
import { Overlay } from './overlay';
import { type HexColour, rgb } from './palette';
import { FLAT_FRAGMENT } from './shaders';
import type { CssPx } from './units';

/** From the tip to the top. */
const HEIGHT_PX: CssPx = 34;
const SIDES = 12;
/** Radius and height of the tip's rim, the shoulder and the top, in parts of the whole height. */
const TIP = [0.05, 0] as const;
const SHOULDER = [0.3, 0.42] as const;
const TOP = [0.3, 1] as const;

/** Light and dark are baked in: the marker turns with nothing. */
const SHADE = { cone: 0.72, side: 0.9, top: 1 } as const;

const VERTEX = /* glsl */ `
precision highp float;
in vec3 position;
in float shade;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uColour;
uniform vec3 uAt;
uniform float uSize;
out vec3 vColour;
void main() {
  vColour = uColour * shade;
  vec4 tip = viewMatrix * vec4(uAt, 1.0);
  // Of one size on the screen: as much larger as it is farther away.
  vec4 corner = viewMatrix * vec4(uAt + position * uSize * max(-tip.z, 0.0), 1.0);
  gl_Position = projectionMatrix * corner;
  // In front of everything, and never cut by the near and far planes.
  gl_Position.z = 0.0;
}
`;

type Ring = readonly [radius: number, height: number];

/** Corners of the triangles and how bright each is, from the tip upwards; outsides run counter-clockwise. */
export function nozzleTriangles(): { readonly corners: number[]; readonly shades: number[] } {
  const corners: number[] = [];
  const shades: number[] = [];
  const at = ([radius, height]: Ring, side: number): Vec3 => {
    const angle = (2 * Math.PI * side) / SIDES;
    return [radius * Math.cos(angle), radius * Math.sin(angle), height];
  };
  const triangle = (a: Vec3, b: Vec3, c: Vec3, shade: number): void => {
    corners.push(...a, ...b, ...c);
    shades.push(shade, shade, shade);
  };
  const wall = (low: Ring, high: Ring, side: number, shade: number): void => {
    const [a, b, c, d] = [at(low, side), at(low, side + 1), at(high, side + 1), at(high, side)];
    triangle(a, b, c, shade);
    triangle(a, c, d, shade);
  };
  for (let side = 0; side < SIDES; side++) {
    const turn = 1 - 0.2 * Math.abs(Math.sin((Math.PI * side) / SIDES));
    wall(TIP, SHOULDER, side, SHADE.cone * turn);
    wall(SHOULDER, TOP, side, SHADE.side * turn);
    triangle([0, 0, TOP[1]], at(TOP, side), at(TOP, side + 1), SHADE.top);
  }
  return { corners, shades };
}

export class NozzleObject {
  readonly scene = new Scene();
  readonly #overlay: Overlay;

  constructor() {
    const { corners, shades } = nozzleTriangles();
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners), 3));
    geometry.setAttribute('shade', new BufferAttribute(new Float32Array(shades), 1));
    this.#overlay = new Overlay(this.scene, geometry, {
      vertexShader: VERTEX,
      fragmentShader: FLAT_FRAGMENT,
      uniforms: { uColour: [0, 0, 0], uAt: [0, 0, 0], uSize: 0 },
      side: FrontSide,
    });
  }

  get isShown(): boolean {
    return this.#overlay.isShown;
  }

  /** Where the tip is; null shows none. */
  set at(place: Vec3 | null) {
    this.#overlay.isShown = place !== null;
    if (place) this.#overlay.set('uAt', [...place]);
  }

  set colour(hex: HexColour) {
    this.#overlay.set('uColour', [...rgb(hex)]);
  }

  /** What a CSS pixel covers a millimetre away. */
  set pixelAngle(angle: number) {
    this.#overlay.set('uSize', HEIGHT_PX * angle);
  }

  release(): void {
    this.#overlay.release();
  }
}
