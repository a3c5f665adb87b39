/**
 * The 3D view of a toolpath: takes a canvas and typed arrays.
 *
 * Does: keeps the vertices, the layers, the camera and what is shown, and has it drawn when something changed.
 * Does not know: the page, files, printers, pointers; all of that arrives through its methods; nor how anything is drawn
 * (drawing.ts). Units: mm, CSS pixels, vertex and layer indices.
 */
import { type Bed, bedBox, isBed } from './bed';
import {
  type CameraPreset,
  type CameraState,
  DEFAULT_CAMERA,
  fit,
  isSameCamera,
  orbit,
  PRESETS,
  type Projection,
  pan,
  rayThrough,
  type Vec3,
  zoom,
} from './camera';
import { type ColourMode, PLANNED_MODES, type ValueRange } from './colours';
import { Content } from './content';
import { Drawing, EMPTY_BOX, type Model } from './drawing';
import { FrameLoop, realmClock } from './frames';
import type { Layer } from './layers';
import { type BedMesh, isMesh } from './mesh';
import type { ViewEvent } from './messages';
import { PALETTES, type Palette, type Theme } from './palette';
import { ALL_PRINTED, type Volume } from './path_uniforms';
import { PictureMaker, type PictureSizePx } from './picture';
import { segmentAt } from './segment';
import { SHOW_ALL, type Shown, validRange } from './shown';
import { sliceOf } from './slice';
import type { CssPx, Ms, VertexIndex } from './units';
import type { VertexHeader } from './vertex';

export interface ViewSizePx {
  readonly width: CssPx;
  readonly height: CssPx;
  /** Device pixels of a CSS pixel. */
  readonly ratio: number;
}

/** Found ranges are told at most this often. */
const RANGES_MS: Ms = 250;

const isPlanned = (mode: ColourMode): boolean => PLANNED_MODES.includes(mode);

/** Whether a layer begins where the one in the same place of another list does. */
const isAt =
  (others: readonly Layer[]) =>
  ({ firstVertex }: Layer, at: number): boolean =>
    others[at]?.firstVertex === firstVertex;

export class ToolpathView {
  readonly #canvas: HTMLCanvasElement | OffscreenCanvas;
  readonly #tell: (event: ViewEvent) => void;
  readonly #model: Model = {
    content: null,
    camera: DEFAULT_CAMERA,
    bedBox: null,
    shown: SHOW_ALL,
    printed: ALL_PRINTED,
    mode: 'feature',
    limits: {},
    object: null,
    volume: null,
  };
  readonly #drawing: Drawing;
  readonly #pictures: PictureMaker;
  readonly #loop: FrameLoop;
  #layers: readonly Layer[] = [];
  #bed: Bed | null = null;
  #mesh: BedMesh | null = null;
  #palette: Palette = PALETTES.light;
  #highlight: VertexIndex | null = null;
  #nozzleMm: Vec3 | null = null;
  #follows = false;
  /** Nobody has moved the camera since it was put to see all: then it goes on doing so. */
  #isFitted = false;
  #rangesTimer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    canvas: HTMLCanvasElement | OffscreenCanvas,
    size: ViewSizePx,
    tell: (event: ViewEvent) => void,
  ) {
    this.#canvas = canvas;
    this.#tell = tell;
    this.#drawing = new Drawing(canvas, this.#model, () => this.#loop.patched());
    this.#pictures = new PictureMaker(this.#drawing, realmClock());
    canvas.addEventListener('webglcontextlost', this.#onLost);
    canvas.addEventListener('webglcontextrestored', this.#onRestored);
    this.#loop = new FrameLoop(this.#drawing, realmClock(), (report) => {
      if (report.kind === 'full') this.#drawing.measured(report.segments, report.totalMs);
      tell({ type: 'frame', report });
    });
    this.setTheme('light');
    this.resize(size);
    this.#drawing.warmUp();
  }

  /** Draws this bed; one without an area, or null, draws none. */
  setBed(bed: Bed | null): void {
    this.#bed = bed && isBed(bed) ? bed : null;
    this.#model.bedBox = this.#bed && bedBox(this.#bed);
    if (this.#bed) this.#drawing.bed.set(this.#bed);
    else this.#drawing.bed.clear();
    this.#drawing.bed.palette = this.#palette;
    this.#loop.moved();
  }

  /** A new file: what was there goes. What is shown of it stays as it was said, for that may come before. */
  begin(header: VertexHeader): void {
    this.#empty();
    this.#model.content = new Content(header);
    this.#model.printed = ALL_PRINTED;
    this.#loop.begins();
  }

  /** The next vertices of the file, four words each; the array is copied. */
  append(vertices: Uint32Array): void {
    const { content } = this.#model;
    if (!content) return;
    content.append(vertices);
    this.#tellRanges();
    this.#loop.grew();
  }

  /** Planner channels of the next vertices that have none yet, four words each; the array is copied. */
  appendChannels(words: Uint32Array): void {
    const { content, mode } = this.#model;
    if (!content) return;
    content.appendChannels(words);
    this.#drawing.uploadChannels();
    this.#tellRanges();
    if (isPlanned(mode)) this.#loop.grew();
  }

  /** The file has no more vertices. */
  end(): void {
    const { content } = this.#model;
    content?.end();
    this.#tellRanges();
    this.#seeAll();
    this.#loop.ended();
    if (content) this.#tell({ type: 'built', vertices: content.store.count });
  }

  /** No file any more. */
  clear(): void {
    const wasThere = this.#model.content !== null;
    this.#empty();
    if (wasThere) this.#loop.moved();
  }

  setLayers(layers: readonly Layer[]): void {
    const same = layers.length === this.#layers.length && layers.every(isAt(this.#layers));
    this.#layers = layers;
    this.#model.content?.setLayers(layers);
    this.#drawing.layerTimes.set(layers);
    this.#tellRanges();
    // Times alone change no picture but that of times.
    if (!same || this.#model.mode === 'layerTime') this.#loop.changed();
  }

  show(shown: Partial<Shown>): void {
    this.#model.shown = { ...this.#model.shown, ...shown };
    this.#pathChanged();
  }

  setColour(mode: ColourMode): void {
    this.#model.mode = mode;
    this.#pathChanged();
  }

  /** The user's own limits of a mode's colours; null: those found in the file. */
  setColourRange(mode: ColourMode, range: ValueRange | null): void {
    const { [mode]: _, ...others } = this.#model.limits;
    const valid = validRange(mode, range);
    this.#model.limits = valid ? { ...others, [mode]: valid } : others;
    if (mode === this.#model.mode) this.#pathChanged();
  }

  /** Vertices before this one are printed, the others still to come; null: no difference is shown. */
  setPrintedUpTo(vertex: VertexIndex | null): void {
    const printed = vertex === null ? ALL_PRINTED : Math.min(Math.max(Math.floor(vertex), 0), ALL_PRINTED);
    if (printed === this.#model.printed) return;
    this.#model.printed = printed;
    this.#loop.patched();
  }

  /** Shows the nozzle with its tip there; null shows none. */
  setNozzle(at: Vec3 | null): void {
    const place = at?.every(Number.isFinite) ? at : null;
    if (place === null && !this.#drawing.nozzle.isShown) return;
    this.#drawing.nozzle.at = place;
    this.#nozzleMm = place;
    this.#loop.overlaid();
    this.#followNozzle();
  }

  /** The camera goes with the nozzle, as long as that is shown. */
  setFollow(follow: boolean): void {
    this.#follows = follow;
    this.#followNozzle();
  }

  /** Marks the segment that ends at this vertex; null marks none. */
  setHighlight(vertex: VertexIndex | null): void {
    if (this.#highlight === vertex) return;
    this.#highlight = vertex;
    const { content } = this.#model;
    this.#drawing.highlight.set(vertex === null || !content ? null : segmentAt(content.store, vertex));
    this.#loop.overlaid();
  }

  /** Lets one object stand out; null: none. */
  setHighlightedObject(object: number | null): void {
    if (this.#model.object === object) return;
    this.#model.object = object;
    this.#pathChanged();
  }

  /** What lies outside gets a warning's tint; null: there are no limits. */
  setVolume(box: Volume | null): void {
    this.#model.volume = box && [...box.min, ...box.max].some(Number.isNaN) ? null : box;
    this.#loop.moved();
  }

  setMesh(mesh: BedMesh | null): void {
    this.#mesh = mesh && isMesh(mesh) ? mesh : null;
    if (this.#mesh) this.#drawing.surface.set(this.#mesh);
    else this.#drawing.surface.clear();
    this.#loop.moved();
  }

  /** What is drawn at a point, from the view's left top. */
  pick(x: CssPx, y: CssPx, id: number): void {
    const { content, camera, shown } = this.#model;
    const ray = rayThrough(camera, this.#drawing.stage.size, x, y);
    const vertex = content?.picker.pick(ray, { ranges: this.#drawing.ranges(), shown }) ?? null;
    this.#tell({ type: 'picked', id, vertex });
  }

  /** A PNG of what is seen, in full detail. */
  picture(id: number, size: PictureSizePx): void {
    void this.#pictures.make(this.#model.camera, size).then((blob) => {
      this.#tell({ type: 'picture', id, blob });
    });
  }

  /** Hands out vertices `first … end − 1`, as far as they are there. */
  slice(first: VertexIndex, end: VertexIndex, id: number): void {
    const { content } = this.#model;
    const range = { first, end };
    const vertices = content ? sliceOf(content.store, range) : new Uint32Array();
    const channels = content ? sliceOf(content.channels, range) : new Uint32Array();
    this.#tell({ type: 'slice', id, slice: { first, header: content?.header ?? null, vertices, channels } });
  }

  /** Tells once all that was asked for up to now is shown in full detail. */
  settle(id: number): void {
    // What is still being found out may change the colours.
    if (this.#rangesTimer !== null) setTimeout(() => this.settle(id), RANGES_MS);
    else this.#loop.onRest(() => this.#tell({ type: 'settled', id }));
  }

  setTheme(theme: Theme): void {
    this.#palette = PALETTES[theme];
    this.#drawing.palette = this.#palette;
    this.#loop.moved();
  }

  orbit(dx: CssPx, dy: CssPx): void {
    this.#move(orbit(this.#model.camera, dx, dy));
  }

  pan(dx: CssPx, dy: CssPx): void {
    this.#move(pan(this.#model.camera, dx, dy, this.#drawing.stage.size));
  }

  /** `factor` below 1 comes nearer; what is under `at` (pixels from the middle, y downwards) stays there. */
  zoom(factor: number, at: readonly [CssPx, CssPx] = [0, 0]): void {
    this.#move(zoom(this.#model.camera, factor, this.#drawing.stage.size, at));
  }

  /** The whole part in view, or the bed when there is none; `direction` also turns the camera. */
  fit(direction?: Pick<CameraState, 'azimuth' | 'elevation'>): void {
    const { camera, content } = this.#model;
    const fitted = this.#cameraOnAll(direction);
    // The empty bed is not drawn again when a file is about to come.
    if (content || !isSameCamera(fitted, camera)) this.#put(fitted);
    this.#isFitted = true;
  }

  /** Looks at the whole part from there. */
  setCamera(preset: CameraPreset): void {
    this.fit(PRESETS[preset]);
  }

  setProjection(projection: Projection): void {
    this.#put({ ...this.#model.camera, projection });
  }

  resize({ width, height, ratio }: ViewSizePx): void {
    this.#drawing.smooth.reset();
    this.#drawing.stage.resize(width, height, ratio);
    this.#seeAll();
    this.#loop.moved();
  }

  dispose(): void {
    this.#loop.pause();
    this.#canvas.removeEventListener('webglcontextlost', this.#onLost);
    this.#canvas.removeEventListener('webglcontextrestored', this.#onRestored);
    this.#empty();
    this.#drawing.dispose();
  }

  readonly #onLost = (): void => {
    this.#loop.pause();
    this.#pictures.end();
    this.#drawing.lost();
    this.#tell({ type: 'contextLost' });
  };

  readonly #onRestored = (): void => {
    if (this.#bed) this.#drawing.bed.set(this.#bed);
    if (this.#mesh) this.#drawing.surface.set(this.#mesh);
    this.#drawing.layerTimes.set(this.#layers);
    this.#drawing.palette = this.#palette;
    this.#drawing.warmUp();
    this.#loop.resume();
    this.#tell({ type: 'contextRestored' });
  };

  /** The user moves it. */
  #move(camera: CameraState): void {
    this.#isFitted = false;
    this.#put(camera);
  }

  #put(camera: CameraState): void {
    this.#model.camera = camera;
    this.#loop.moved();
  }

  #cameraOnAll(direction?: Pick<CameraState, 'azimuth' | 'elevation'>): CameraState {
    const { camera, content, bedBox } = this.#model;
    const box = content?.store.box() ?? bedBox ?? EMPTY_BOX;
    return fit({ ...camera, ...direction }, box, this.#drawing.stage.size);
  }

  /** All that there is by now, unless the user has moved the camera. It is not drawn by this. */
  #seeAll(): void {
    if (!this.#isFitted) return;
    this.#model.camera = this.#cameraOnAll();
    this.#followNozzle();
  }

  /** Without a file there is nothing to be drawn anew: the first picture of the next one need not wait for that. */
  #pathChanged(): void {
    if (this.#model.content) this.#loop.moved();
  }

  #followNozzle(): void {
    const at = this.#nozzleMm;
    const { camera } = this.#model;
    if (!this.#follows || !at) return;
    const [x, y, z] = camera.targetMm;
    if (x !== at[0] || y !== at[1] || z !== at[2]) this.#put({ ...camera, targetMm: at });
  }

  /** Soon, and not oftener than it helps. */
  #tellRanges(): void {
    this.#rangesTimer ??= setTimeout(() => {
      this.#rangesTimer = null;
      const { content, mode } = this.#model;
      if (!content) return;
      this.#tell({ type: 'ranges', ranges: content.ranges, isWhole: content.isWhole });
      // What has come since the last picture may be in colour.
      if (!isPlanned(mode)) return;
      if (content.isWhole) this.#loop.ended();
      else this.#loop.grew();
    }, RANGES_MS);
  }

  #empty(): void {
    if (this.#rangesTimer !== null) clearTimeout(this.#rangesTimer);
    this.#rangesTimer = null;
    this.#pictures.end();
    this.#drawing.empty();
    this.#drawing.highlight.set(null);
    this.#highlight = null;
    this.#layers = [];
    this.#model.content = null;
    this.#model.object = null;
  }
}
