/**
 * One thing that lies over the picture, in front of everything: moving it draws neither path nor bed anew.
 *
 * Does not know: what it is. Uniforms are its shaders' own.
 */
import { type BufferGeometry, GLSL3, Mesh, RawShaderMaterial, type Scene, type Side } from 'three';

export interface OverlayShaders {
  readonly vertexShader: string;
  readonly fragmentShader: string;
  /** With what they are before they are set. */
  readonly uniforms: Readonly<Record<string, number | number[]>>;
  readonly side: Side;
}

export class Overlay {
  readonly #mesh: Mesh<BufferGeometry, RawShaderMaterial>;

  /** Not shown at first. */
  constructor(scene: Scene, geometry: BufferGeometry, { uniforms, ...shaders }: OverlayShaders) {
    const values = Object.entries(uniforms).map(([name, value]) => [name, { value }]);
    const material = new RawShaderMaterial({
      ...shaders,
      glslVersion: GLSL3,
      uniforms: Object.fromEntries(values),
      depthTest: false,
      depthWrite: false,
    });
    this.#mesh = new Mesh(geometry, material);
    this.#mesh.frustumCulled = false;
    this.#mesh.matrixAutoUpdate = false;
    this.#mesh.visible = false;
    scene.add(this.#mesh);
    scene.matrixWorldAutoUpdate = false;
  }

  get isShown(): boolean {
    return this.#mesh.visible;
  }

  set isShown(isShown: boolean) {
    this.#mesh.visible = isShown;
  }

  set(uniform: string, value: number | number[]): void {
    const { [uniform]: there } = this.#mesh.material.uniforms;
    if (there) there.value = value;
  }

  /** Lets go of what is on the GPU; it comes anew when it is next drawn. */
  release(): void {
    this.#mesh.geometry.dispose();
    this.#mesh.material.dispose();
  }
}
