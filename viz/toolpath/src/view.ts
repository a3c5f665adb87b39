/**
 * The 3D view of a toolpath: takes a canvas and typed arrays.
 *
 * Does: keeps the vertices, the layers, the camera and what is shown, and draws when something changed.
 * Does not know: the page, files, printers, pointers; all of that arrives through its methods. Units: mm, CSS pixels,
 * vertex and layer indices.
 */
import { Scene } from 'three';
import { type Bed, BedObjects, bedBox, isBed } from './bed';
import {
  type BoxMm,
  type CameraPreset,
  type CameraState,
  DEFAULT_CAMERA,
  fit,
  orbit,
  PRESETS,
  type Projection,
  pan,
  unionOf,
  type Vec3,
  zoom,
} from './camera';
import { VertexStore } from './chunks';
import { Rough } from './coarse';
import type { ColourMode, ColourRanges, ValueRange } from './colours';
import { type Drawn, FrameLoop, type Painter, realmClock } from './frames';
import { type Layer, LayerList, type VertexRange } from './layers';
import type { ViewEvent } from './messages';
import { NozzleObject } from './nozzle';
import { featureMask, PALETTES, type Palette, type Theme } from './palette';
import { ALL_PRINTED, PathObjects } from './path';
import { SHOW_ALL, type Shown, validRange } from './shown';
import { sliceOf } from './slice';
import { pixelAngle, Stage, type Surface } from './stage';
import { type BedMesh, isMesh } from './surface';
import type { CssPx, Ms, VertexIndex } from './units';
import { FLAGS, type VertexHeader } from './vertex';

export interface ViewSizePx {
  readonly width: CssPx;
  readonly height: CssPx;
  /** Device pixels of a CSS pixel. */
  readonly ratio: number;
}

/** Of a picture that is kept. */
export interface PictureSizePx {
  readonly width: number;
  readonly height: number;
}

/** While vertices arrive, the picture follows this often. */
const GROWTH_FRAME_MS: Ms = 200;
/** Where a full picture takes longer, the next ones do without several samples a pixel. */
const SMOOTH_MAX_MS: Ms = 1500;
const EMPTY_BOX: BoxMm = { min: [-50, -50, 0], max: [50, 50, 50] };

/** How far the full picture is. */
interface Progress {
  phase: 'beads' | 'lines' | 'done';
  /** The next vertex of the phase. */
  at: number;
  /** The printed limit that the picture was drawn with. */
  printed: number;
}

export class ToolpathView {
  readonly #canvas: HTMLCanvasElement | OffscreenCanvas;
  readonly #tell: (event: ViewEvent) => void;
  readonly #stage: Stage;
  readonly #fine = new PathObjects('whole');
  /** For pictures in motion. */
  readonly #coarse = new PathObjects('body');
  readonly #bedObjects = new BedObjects();
  readonly #bedScene = new Scene();
  readonly #nozzle = new NozzleObject();
  readonly #loop: FrameLoop;
  #store: VertexStore | null = null;
  #rough: Rough | null = null;
  #layers = new LayerList();
  #bed: Bed | null = null;
  #camera: CameraState = DEFAULT_CAMERA;
  #palette: Palette = PALETTES.light;
  #shown: Shown = SHOW_ALL;
  #printed = ALL_PRINTED;
  #progress: Progress = { phase: 'done', at: 0, printed: ALL_PRINTED };
  #grown: Ms = 0;
  #smooth = true;
  #mode: ColourMode = 'feature';
  #limits: ColourRanges = {};
  #highlight: VertexIndex | null = null;
  #object: number | null = null;
  #volume: BoxMm | null = null;
  #mesh: BedMesh | null = null;
  #nozzleMm: Vec3 | null = null;
  #follows = false;

  constructor(
    canvas: HTMLCanvasElement | OffscreenCanvas,
    size: ViewSizePx,
    tell: (event: ViewEvent) => void,
  ) {
    this.#canvas = canvas;
    this.#tell = tell;
    this.#stage = new Stage(canvas);
    this.#bedScene.add(this.#bedObjects.group);
    this.#bedScene.matrixWorldAutoUpdate = false;
    canvas.addEventListener('webglcontextlost', this.#onLost);
    canvas.addEventListener('webglcontextrestored', this.#onRestored);
    this.#loop = new FrameLoop(this.#painter(), realmClock(), (report) => {
      // Once too slow, it stays so: the next picture of this size is no cheaper.
      if (report.kind === 'full' && report.totalMs > SMOOTH_MAX_MS) this.#smooth = false;
      tell({ type: 'frame', report });
    });
    this.setTheme('light');
    this.resize(size);
  }

  get vertexCount(): number {
    return this.#store?.count ?? 0;
  }

  get camera(): CameraState {
    return this.#camera;
  }

  /** Draws this bed; one without an area, or null, draws none. */
  setBed(bed: Bed | null): void {
    this.#bed = bed && isBed(bed) ? bed : null;
    if (this.#bed) this.#bedObjects.set(this.#bed);
    else this.#bedObjects.clear();
    this.#bedObjects.palette = this.#palette;
    this.#loop.moved();
  }

  /** A new file: what was there goes. */
  begin(header: VertexHeader): void {
    this.#empty();
    this.#store = new VertexStore(header);
    this.#rough = new Rough(header);
    for (const path of [this.#fine, this.#coarse]) path.header = header;
    this.#printed = ALL_PRINTED;
    this.#shown = {
      ...this.#shown,
      layerFrom: 0,
      layerTo: SHOW_ALL.layerTo,
      vertexFrom: null,
      vertexTo: null,
    };
    this.#grown = performance.now();
    this.#loop.moved();
  }

  /** The next vertices of the file, four words each; the array is copied. */
  append(vertices: Uint32Array): void {
    if (!this.#store) return;
    this.#store.append(vertices);
    this.#rough?.append(vertices);
    const now = performance.now();
    if (now - this.#grown < GROWTH_FRAME_MS) return;
    this.#grown = now;
    this.#loop.moved();
  }

  /** Planner channels of the next vertices that have none yet, four words each; the array is copied. */
  appendChannels(_words: Uint32Array): void {
    if (!this.#store) return;
    this.#tell({ type: 'ranges', ranges: {}, isWhole: false });
  }

  /** The file has no more vertices. */
  end(): void {
    this.#rough?.end();
    this.#loop.moved();
  }

  /** No file any more. */
  clear(): void {
    this.#empty();
    this.#loop.moved();
  }

  setLayers(layers: readonly Layer[]): void {
    this.#layers = new LayerList(layers);
    this.#loop.moved();
  }

  show(shown: Partial<Shown>): void {
    this.#shown = { ...this.#shown, ...shown };
    this.#loop.moved();
  }

  setColour(mode: ColourMode): void {
    this.#mode = mode;
    this.#loop.moved();
  }

  /** The user's own limits of a mode's colours; null: those found in the file. */
  setColourRange(mode: ColourMode, range: ValueRange | null): void {
    const { [mode]: _, ...others } = this.#limits;
    const valid = validRange(mode, range);
    this.#limits = valid ? { ...others, [mode]: valid } : others;
    if (mode === this.#mode) this.#loop.moved();
  }

  /** Vertices before this one are printed, the others still to come; null: no difference is shown. */
  setPrintedUpTo(vertex: VertexIndex | null): void {
    const printed = vertex === null ? ALL_PRINTED : Math.min(Math.max(Math.floor(vertex), 0), ALL_PRINTED);
    if (printed === this.#printed) return;
    this.#printed = printed;
    this.#loop.patched();
  }

  /** Shows the nozzle with its tip there; null shows none. */
  setNozzle(at: Vec3 | null): void {
    const place = at?.every(Number.isFinite) ? at : null;
    if (place === null && !this.#nozzle.isShown) return;
    this.#nozzle.at = place;
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
    this.#loop.overlaid();
  }

  /** Lets one object stand out; null: none. */
  setHighlightedObject(object: number | null): void {
    if (this.#object === object) return;
    this.#object = object;
    this.#loop.moved();
  }

  /** What lies outside gets a warning's tint; null: there are no limits. */
  setVolume(box: BoxMm | null): void {
    this.#volume = box && [...box.min, ...box.max].some(Number.isNaN) ? null : box;
    if (this.#store && this.#volume !== box) this.#loop.moved();
  }

  setMesh(mesh: BedMesh | null): void {
    this.#mesh = mesh && isMesh(mesh) ? mesh : null;
    if (this.#mesh !== mesh) this.#loop.moved();
  }

  /** What is drawn at a point, from the view's left top. */
  pick(_x: CssPx, _y: CssPx, id: number): void {
    this.#tell({ type: 'picked', id, vertex: null });
  }

  picture(id: number, _size: PictureSizePx): void {
    this.#tell({ type: 'picture', id, blob: null });
  }

  /** Hands out vertices `first … end − 1`, as far as they are there. */
  slice(first: VertexIndex, end: VertexIndex, id: number): void {
    const vertices = this.#store ? sliceOf(this.#store, { first, end }) : new Uint32Array();
    const channels = new Uint32Array();
    this.#tell({
      type: 'slice',
      id,
      slice: { first, header: this.#store?.header ?? null, vertices, channels },
    });
  }

  setTheme(theme: Theme): void {
    this.#palette = PALETTES[theme];
    for (const path of [this.#fine, this.#coarse]) path.palette = this.#palette;
    this.#bedObjects.palette = this.#palette;
    this.#nozzle.colour = this.#palette.nozzle;
    this.#stage.background = this.#palette.background;
    this.#loop.moved();
  }

  orbit(dx: CssPx, dy: CssPx): void {
    this.#move(orbit(this.#camera, dx, dy));
  }

  pan(dx: CssPx, dy: CssPx): void {
    this.#move(pan(this.#camera, dx, dy, this.#stage.size));
  }

  /** `factor` below 1 comes nearer; what is under `at` (pixels from the middle, y downwards) stays there. */
  zoom(factor: number, at: readonly [CssPx, CssPx] = [0, 0]): void {
    this.#move(zoom(this.#camera, factor, this.#stage.size, at));
  }

  /** The whole part in view, or the bed when there is none; `direction` also turns the camera. */
  fit(direction?: Pick<CameraState, 'azimuth' | 'elevation'>): void {
    const from = { ...this.#camera, ...direction };
    this.#move(fit(from, this.#store?.box() ?? this.#bedBox() ?? EMPTY_BOX, this.#stage.size));
  }

  /** Looks at the whole part from there. */
  setCamera(preset: CameraPreset): void {
    this.fit(PRESETS[preset]);
  }

  setProjection(projection: Projection): void {
    this.#move({ ...this.#camera, projection });
  }

  resize({ width, height, ratio }: ViewSizePx): void {
    this.#smooth = true;
    this.#stage.resize(width, height, ratio);
    this.#loop.moved();
  }

  dispose(): void {
    this.#loop.pause();
    this.#canvas.removeEventListener('webglcontextlost', this.#onLost);
    this.#canvas.removeEventListener('webglcontextrestored', this.#onRestored);
    this.#empty();
    this.#bedObjects.clear();
    this.#nozzle.release();
    this.#stage.dispose();
  }

  readonly #onLost = (): void => {
    this.#loop.pause();
    // What was on the GPU is gone; what belongs to it here goes too and is made anew from the store.
    this.#fine.clear();
    this.#coarse.clear();
    this.#bedObjects.clear();
    this.#nozzle.release();
    this.#stage.lost();
    this.#tell({ type: 'contextLost' });
  };

  readonly #onRestored = (): void => {
    if (this.#bed) this.#bedObjects.set(this.#bed);
    this.#bedObjects.palette = this.#palette;
    this.#stage.background = this.#palette.background;
    this.#loop.resume();
    this.#tell({ type: 'contextRestored' });
  };

  #move(camera: CameraState): void {
    this.#camera = camera;
    this.#loop.moved();
  }

  #followNozzle(): void {
    const at = this.#nozzleMm;
    if (!this.#follows || !at) return;
    const [x, y, z] = this.#camera.targetMm;
    if (x !== at[0] || y !== at[1] || z !== at[2]) this.#move({ ...this.#camera, targetMm: at });
  }

  #bedBox(): BoxMm | null {
    return this.#bed && bedBox(this.#bed);
  }

  #range(): VertexRange {
    const { layerFrom, layerTo, vertexTo } = this.#shown;
    const whole = this.#layers.range(layerFrom, Math.min(layerTo, this.#layers.count - 1), this.vertexCount);
    const end = vertexTo === null ? whole.end : Math.min(whole.end, vertexTo + 1);
    return { first: whole.first, end: Math.max(end, whole.first) };
  }

  #empty(): void {
    this.#fine.clear();
    this.#coarse.clear();
    this.#store = null;
    this.#rough = null;
    this.#layers = new LayerList();
  }

  /** Sets the camera, clears and draws the bed. */
  #prepare(surface: Surface): void {
    const box = unionOf(this.#bedBox(), this.#store?.boxOfAll() ?? null);
    this.#stage.look(this.#camera, box ?? EMPTY_BOX);
    const angle = pixelAngle(this.#camera, this.#stage.size);
    for (const path of [this.#fine, this.#coarse])
      path.setPixels(angle / this.#stage.ratio, this.#stage.ratio);
    this.#nozzle.pixelAngle = angle;
    this.#stage.clear(surface);
    this.#stage.draw(surface, this.#bedScene);
  }

  /** Brings the full path's textures and uniforms up to date. */
  #prepareFine(): void {
    const { retractions, seams, hiddenFeatures } = this.#shown;
    this.#fine.sync(this.#store?.chunks ?? []);
    this.#fine.features = featureMask(hiddenFeatures);
    this.#fine.markers = (retractions ? FLAGS.retract | FLAGS.unretract : 0) | (seams ? FLAGS.seam : 0);
    this.#fine.printed = this.#printed;
  }

  #beads(surface: Surface, range: VertexRange): void {
    const parts = this.#store?.split(range) ?? [];
    if (parts.length === 0) return;
    this.#fine.showBeads(parts.map((part) => ({ range: part, stride: 1 })));
    this.#stage.draw(surface, this.#fine.scene);
  }

  #lines(surface: Surface, range: VertexRange): void {
    const { travel, retractions, seams } = this.#shown;
    const parts = this.#store?.split(range) ?? [];
    if (parts.length === 0) return;
    this.#fine.showLines(parts, { travels: travel, markers: retractions || seams });
    this.#stage.draw(surface, this.#fine.scene);
  }

  /** What lies over the picture. */
  #overlay(): void {
    if (this.#nozzle.isShown) this.#stage.draw('canvas', this.#nozzle.scene);
  }

  #present(): void {
    this.#stage.present();
    this.#overlay();
  }

  #linesShown(): boolean {
    const { travel, retractions, seams } = this.#shown;
    return travel || retractions || seams;
  }

  #painter(): Painter {
    return {
      fullSegments: () => {
        const { first, end } = this.#range();
        return (end - first) * (this.#linesShown() ? 2 : 1);
      },
      drawQuick: (budget) => this.#drawQuick(budget),
      drawSlice: (budget, restart) => this.#drawSlice(budget, restart),
      patch: () => this.#patch(),
      overlay: () => this.#present(),
      fence: () => this.#stage.fence(),
    };
  }

  #drawQuick(budget: number): number {
    this.#prepare('canvas');
    const segments = this.#rough ? this.#drawRough(this.#rough, budget) : 0;
    this.#overlay();
    return segments;
  }

  #drawRough(rough: Rough, budget: number): number {
    const range = this.#range();
    const { ranges, layerStep, stride } = rough.reduced(range, this.#layers, budget);
    const parts = ranges.flatMap((part) => rough.store.split(part));
    const segments = ranges.reduce((sum, { first, end }) => sum + end - first, 0) / stride;
    this.#coarse.sync(rough.store.chunks);
    this.#coarse.features = featureMask(this.#shown.hiddenFeatures);
    this.#coarse.printed = this.#printed === ALL_PRINTED ? ALL_PRINTED : rough.coarseOf(this.#printed);
    this.#coarse.heightScale = layerStep;
    if (parts.length > 0) {
      this.#coarse.showBeads(parts.map((part) => ({ range: part, stride })));
      this.#stage.draw('canvas', this.#coarse.scene);
    }
    if (this.#linesShown() && range.end - range.first < budget) {
      this.#prepareFine();
      this.#lines('canvas', range);
    }
    return segments;
  }

  #drawSlice(budget: number, restart: boolean): Drawn {
    const range = this.#range();
    if (restart) {
      this.#stage.smooth = this.#smooth;
      this.#prepareFine();
      this.#prepare('picture');
      this.#progress = { phase: 'beads', at: range.first, printed: this.#printed };
    }
    return this.#continue(this.#progress, range, budget);
  }

  #continue(progress: Progress, range: VertexRange, budget: number): Drawn {
    let left = Math.max(budget, 1);
    let segments = 0;
    this.#fine.printed = progress.printed;
    while (left > 0 && progress.phase !== 'done') {
      const part = { first: progress.at, end: Math.min(progress.at + left, range.end) };
      const count = Math.max(part.end - part.first, 0);
      if (progress.phase === 'beads') this.#beads('picture', part);
      else this.#lines('picture', part);
      segments += count;
      left -= Math.max(count, 1);
      progress.at = part.end;
      if (progress.at < range.end) continue;
      progress.phase = progress.phase === 'beads' && this.#linesShown() ? 'lines' : 'done';
      progress.at = range.first;
    }
    const complete = progress.phase === 'done';
    if (complete) this.#present();
    if (complete && progress.printed !== this.#printed) this.#loop.patched();
    return { segments, complete };
  }

  /** Draws what was printed since the full picture over it: same places, same depths, other colours. */
  #patch(): boolean {
    const from = this.#progress.printed;
    const to = this.#printed;
    if (to === ALL_PRINTED || from === ALL_PRINTED || to < from) return false;
    const range = this.#range();
    const part = { first: Math.max(from, range.first), end: Math.min(to, range.end) };
    this.#fine.printed = to;
    if (part.end > part.first) this.#beads('picture', part);
    this.#progress.printed = to;
    this.#present();
    return true;
  }
}
