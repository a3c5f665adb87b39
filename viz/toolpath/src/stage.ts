/**
 * The renderer, its hidden full picture and the camera in three.js terms.
 *
 * Does: owns the WebGL context and the buffers of the view's size. Does not know: what is in the scene, when to draw.
 * Units: CSS pixels times the pixel ratio; mm.
 */
import {
  BufferGeometry,
  Color,
  GLSL3,
  LinearFilter,
  LinearSRGBColorSpace,
  Matrix4,
  Mesh,
  type Object3D,
  OrthographicCamera,
  PerspectiveCamera,
  RawShaderMaterial,
  Scene,
  type Texture,
  UnsignedByteType,
  WebGLRenderer,
  WebGLRenderTarget,
} from 'three';
import {
  type BoxMm,
  type CameraState,
  clipPlanes,
  eyeFrame,
  FIELD_OF_VIEW,
  mmPerPx,
  type ViewSize,
} from './camera';
import type { HexColour } from './palette';
import { rgb } from './palette';
import { COPY_FRAGMENT, COPY_VERTEX } from './shaders';

/** Samples of a pixel in the full picture. */
const SAMPLES = 4;
/** A larger drawing buffer than this is no sharper to an eye and slow everywhere. */
const BUFFER_SIDE_MAX = 4096;

/** Where to draw. */
export type Surface = 'canvas' | 'picture' | WebGLRenderTarget;

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly #perspective = new PerspectiveCamera();
  readonly #orthographic = new OrthographicCamera();
  #camera: PerspectiveCamera | OrthographicCamera = this.#perspective;
  readonly #picture: WebGLRenderTarget;
  readonly #copy: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #copyScene = new Scene();
  #size: ViewSize = { width: 1, height: 1 };
  #ratio = 1;

  constructor(canvas: HTMLCanvasElement | OffscreenCanvas) {
    // The full picture has its own samples; quick ones on the canvas go without.
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: false,
      alpha: false,
      powerPreference: 'high-performance',
    });
    this.renderer.autoClear = false;
    this.renderer.sortObjects = false;
    // Colours are given and written as sRGB.
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.#picture = new WebGLRenderTarget(1, 1, {
      samples: SAMPLES,
      type: UnsignedByteType,
      minFilter: LinearFilter,
      magFilter: LinearFilter,
      generateMipmaps: false,
    });
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: COPY_VERTEX,
      fragmentShader: COPY_FRAGMENT,
      uniforms: { uPicture: { value: this.#picture.texture } },
      depthTest: false,
      depthWrite: false,
    });
    this.#copy = new Mesh(new BufferGeometry(), material);
    this.#copy.geometry.setDrawRange(0, 3);
    this.#copy.frustumCulled = false;
    this.#copyScene.add(this.#copy);
    for (const camera of [this.#perspective, this.#orthographic]) camera.matrixAutoUpdate = false;
  }

  get size(): ViewSize {
    return this.#size;
  }

  get textureSideMax(): number {
    return this.renderer.capabilities.maxTextureSize;
  }

  get isLost(): boolean {
    return this.renderer.getContext().isContextLost();
  }

  get ratio(): number {
    return this.#ratio;
  }

  resize(width: number, height: number, ratio: number): void {
    const side = Math.max(width, height, 1);
    this.#size = { width: Math.max(width, 1), height: Math.max(height, 1) };
    this.#ratio = Math.min(Math.max(ratio, 0.25), BUFFER_SIDE_MAX / side);
    this.renderer.setPixelRatio(this.#ratio);
    this.renderer.setSize(this.#size.width, this.#size.height, false);
    this.#picture.setSize(
      Math.floor(this.#size.width * this.#ratio),
      Math.floor(this.#size.height * this.#ratio),
    );
  }

  set background(colour: HexColour) {
    const [r, g, b] = rgb(colour);
    this.renderer.setClearColor(new Color().setRGB(r, g, b, LinearSRGBColorSpace), 1);
  }

  /** Sets the camera for a surface of this size; the view's own where it is left out. */
  look(camera: CameraState, around: BoxMm, size: ViewSize = this.#size): void {
    const { nearMm, farMm } = clipPlanes(camera, around);
    this.#camera = camera.projection === 'perspective' ? this.#perspective : this.#orthographic;
    if (camera.projection === 'perspective') {
      this.#perspective.fov = (FIELD_OF_VIEW * 180) / Math.PI;
      this.#perspective.aspect = size.width / size.height;
    } else {
      const half = (mmPerPx(camera, size) * size.height) / 2;
      const halfWidth = (half * size.width) / size.height;
      Object.assign(this.#orthographic, { left: -halfWidth, right: halfWidth, top: half, bottom: -half });
    }
    this.#camera.near = nearMm;
    this.#camera.far = farMm;
    this.#camera.updateProjectionMatrix();
    this.#camera.matrix.copy(placeOf(camera));
    this.#camera.matrixWorldNeedsUpdate = true;
  }

  clear(surface: Surface): void {
    this.#aim(surface);
    this.renderer.clear();
  }

  draw(surface: Surface, scene: Object3D): void {
    this.#aim(surface);
    this.renderer.render(scene, this.#camera);
  }

  /** With or without several samples a pixel in the full picture; what was in it is lost when that changes. */
  get smooth(): boolean {
    return this.#picture.samples > 0;
  }

  set smooth(smooth: boolean) {
    const samples = smooth ? SAMPLES : 0;
    if (this.#picture.samples === samples) return;
    this.#picture.samples = samples;
    this.#picture.dispose();
  }

  /** The context is lost: lets go of its buffers, which come anew when they are next used. */
  lost(): void {
    this.#picture.dispose();
  }

  /** Brings a texture to the GPU before it is drawn from. */
  upload(texture: Texture): void {
    if (!this.isLost) this.renderer.initTexture(texture);
  }

  /** Shows the full picture. */
  present(): void {
    this.#aim('canvas');
    this.renderer.render(this.#copyScene, this.#camera);
  }

  /** A question whether the GPU has done what it was told up to now. */
  fence(): () => boolean {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    if (!sync) return () => true;
    return () => {
      const done = gl.isContextLost() || gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED;
      if (done) gl.deleteSync(sync);
      return done;
    };
  }

  dispose(): void {
    this.#picture.dispose();
    this.#copy.geometry.dispose();
    this.#copy.material.dispose();
    this.renderer.dispose();
  }

  #aim(surface: Surface): void {
    this.renderer.setRenderTarget(
      surface === 'canvas' ? null : surface === 'picture' ? this.#picture : surface,
    );
  }
}

/** The eye's axes and place. */
function placeOf(camera: CameraState): Matrix4 {
  const { eyeMm, right, up, forward } = eyeFrame(camera);
  const rows = [0, 1, 2].flatMap((axis) => [
    right[axis] ?? 0,
    up[axis] ?? 0,
    -(forward[axis] ?? 0),
    eyeMm[axis] ?? 0,
  ]);
  return new Matrix4().set(...(rows as Row3), 0, 0, 0, 1);
}

type Row3 = [number, number, number, number, number, number, number, number, number, number, number, number];
