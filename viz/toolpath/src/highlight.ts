/**
 * The mark of one segment: a bar over the picture, as wide as the bead and never thinner than a few pixels.
 *
 * It lies in front of everything, so that moving it draws nothing anew. Does not know: which segment, or why. Units: mm,
 * CSS pixels.
 */
import { BufferAttribute, BufferGeometry, DoubleSide, Scene } from 'three';
import type { Vec3 } from './camera';
import { Overlay } from './overlay';
import { type Palette, rgb } from './palette';
import type { Mm } from './units';

const VERTEX = /* glsl */ `
precision highp float;
/** Along from 0 to 1, across from −1 to 1. */
in vec2 corner;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uFrom;
uniform vec3 uTo;
uniform float uWidth;
/** Pixels of the view. */
uniform vec2 uView;
out float vAcross;

const float THINNEST_PX = 5.0;

void main() {
  vec4 a = viewMatrix * vec4(uFrom, 1.0);
  vec4 b = viewMatrix * vec4(uTo, 1.0);
  // With perspective, what is behind the eye is cut off before it is projected.
  if (projectionMatrix[3][3] == 0.0) {
    float near = -0.01;
    if (a.z > near && b.z < near) a = mix(a, b, (a.z - near) / (a.z - b.z));
    else if (b.z > near && a.z < near) b = mix(b, a, (b.z - near) / (b.z - a.z));
  }
  vec4 ca = projectionMatrix * a;
  vec4 cb = projectionMatrix * b;
  vec2 way = (cb.xy / cb.w - ca.xy / ca.w) * uView;
  way = length(way) > 1e-3 ? normalize(way) : vec2(1.0, 0.0);
  bool atEnd = corner.x > 0.5;
  vec4 here = atEnd ? cb : ca;
  // Half of the bead's width in pixels: the projection's scale over the distance.
  float halfPx = max(0.25 * uWidth * projectionMatrix[1][1] / here.w * uView.y, 0.5 * THINNEST_PX);
  vec2 offset = vec2(-way.y, way.x) * corner.y * halfPx + way * (atEnd ? halfPx : -halfPx);
  gl_Position = here + vec4(2.0 * offset / uView * here.w, 0.0, 0.0);
  gl_Position.z = 0.0;
  vAcross = corner.y;
}
`;

const FRAGMENT = /* glsl */ `
precision highp float;
in float vAcross;
uniform vec3 uColour;
uniform vec3 uEdge;
out vec4 colour;
void main() { colour = vec4(abs(vAcross) > 0.7 ? uEdge : uColour, 1.0); }
`;

export class HighlightObject {
  readonly scene = new Scene();
  readonly #overlay: Overlay;

  constructor() {
    const geometry = new BufferGeometry();
    const corners = new Float32Array([0, -1, 1, -1, 1, 1, 0, -1, 1, 1, 0, 1]);
    geometry.setAttribute('corner', new BufferAttribute(corners, 2));
    // Three.js counts the corners of an attribute named position; here there is none.
    geometry.setDrawRange(0, 6);
    this.#overlay = new Overlay(this.scene, geometry, {
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: {
        uFrom: [0, 0, 0],
        uTo: [0, 0, 0],
        uWidth: 0,
        uView: [1, 1],
        uColour: [0, 0, 0],
        uEdge: [0, 0, 0],
      },
      side: DoubleSide,
    });
  }

  get isShown(): boolean {
    return this.#overlay.isShown;
  }

  /** The segment's ends and its bead's width and height; null shows none. */
  set(
    segment: { readonly from: Vec3; readonly to: Vec3; readonly widthMm: Mm; readonly heightMm: Mm } | null,
  ): void {
    this.#overlay.isShown = segment !== null;
    if (!segment) return;
    const middle = ([x, y, z]: Vec3): number[] => [x, y, z - segment.heightMm / 2];
    this.#overlay.set('uFrom', middle(segment.from));
    this.#overlay.set('uTo', middle(segment.to));
    this.#overlay.set('uWidth', segment.widthMm);
  }

  set palette(palette: Palette) {
    this.#overlay.set('uColour', [...rgb(palette.highlight)]);
    this.#overlay.set('uEdge', [...rgb(palette.background)]);
  }

  set view(size: { readonly width: number; readonly height: number }) {
    this.#overlay.set('uView', [size.width, size.height]);
  }

  release(): void {
    this.#overlay.release();
  }
}
