/**
 * Draws what the view shows: quick pictures from the coarse path, the full one in slices, and what lies over them.
 *
 * Does: owns what is on the GPU and brings it up to date from the view's state. Does not know: when to draw (frames.ts), how
 * the state changes (view.ts). Units: vertex indices, mm.
 */
import { Scene } from 'three';
import { BedObjects } from './bed';
import { type BoxMm, type CameraState, finestPx, pixelAngle, unionOf, type ViewSize } from './camera';
import { type RoughList, TOLERANCE_MM } from './coarse';
import type { ColourMode, ColourRanges } from './colours';
import type { Content } from './content';
import { SmoothChoice } from './detail';
import type { Drawn, Painter } from './frames';
import { HighlightObject } from './highlight';
import { LayerTimes } from './layer_times';
import { cut, lengthOf, type VertexRange } from './layers';
import { NozzleObject } from './nozzle';
import { featureMask, type Palette } from './palette';
import { beadsOf, listedBeadsOf, PathObjects } from './path';
import { ALL_PRINTED, type Volume } from './path_uniforms';
import { type Shown, shownRanges } from './shown';
import { Stage, type Surface } from './stage';
import { SurfaceObject } from './surface';
import { PathTextures } from './textures';
import type { Ms } from './units';
import { FLAGS } from './vertex';

export const EMPTY_BOX: BoxMm = { min: [-50, -50, 0], max: [50, 50, 50] };

/** What there is to be drawn; the view changes it. */
export interface Model {
  content: Content | null;
  camera: CameraState;
  bedBox: BoxMm | null;
  shown: Shown;
  /** The first vertex that is not printed. */
  printed: number;
  mode: ColourMode;
  /** The user's own. */
  limits: ColourRanges;
  object: number | null;
  volume: Volume | null;
}

/** A part of a full picture: items in order, drawn in pieces. */
interface Pass {
  readonly ranges: readonly VertexRange[];
  readonly draw: (surface: Surface, part: VertexRange) => void;
}

/**
 * Where a pixel covers more than this, a full picture is drawn from the coarse path, which is nowhere so far off: nobody sees
 * the difference, but large files take a third of the time.
 */
const FINE_PX_MM = 1.5 * TOLERANCE_MM;

/** How far a full picture is. */
export interface Progress {
  readonly surface: Surface;
  readonly camera: CameraState;
  /** CSS pixels, and pixels of the surface for each. */
  readonly size: ViewSize;
  readonly ratio: number;
  readonly ranges: readonly VertexRange[];
  readonly passes: readonly Pass[];
  /** The one that is under way; behind the last, the picture is complete. */
  pass: number;
  /** Items of its ranges that are done. */
  at: number;
  /** The printed limit that the picture was drawn with. */
  printed: number;
}

export class Drawing implements Painter {
  readonly stage: Stage;
  readonly bed = new BedObjects();
  readonly surface = new SurfaceObject();
  readonly nozzle = new NozzleObject();
  readonly highlight = new HighlightObject();
  readonly layerTimes = new LayerTimes();
  /** Whether the full picture has several samples a pixel. */
  readonly smooth = new SmoothChoice();
  readonly #model: Readonly<Model>;
  readonly #textures = new PathTextures();
  readonly #fine = new PathObjects('whole', this.#textures);
  /** For pictures in motion: outer walls, and all the rest. */
  readonly #coarse = {
    outer: new PathObjects('listed', this.#textures),
    inner: new PathObjects('listed', this.#textures),
  };
  readonly #paths = [this.#fine, this.#coarse.outer, this.#coarse.inner];
  readonly #bedScene = new Scene();
  /** Chunks of channels that are on the GPU. */
  #uploaded = 0;
  #progress: Progress | null = null;
  readonly #onStale: () => void;

  /** `onStale`: a full picture is done, but more was printed meanwhile. */
  constructor(canvas: HTMLCanvasElement | OffscreenCanvas, model: Readonly<Model>, onStale: () => void) {
    this.stage = new Stage(canvas);
    this.#model = model;
    this.#onStale = onStale;
    this.#bedScene.add(this.bed.group, this.surface.group);
    this.#bedScene.matrixWorldAutoUpdate = false;
  }

  /** Has the shaders compiled before they are needed: the first picture of a file need not wait for them. */
  warmUp(): void {
    for (const path of this.#paths) {
      path.showNothing();
      for (const surface of ['canvas', 'picture'] as const) this.stage.draw(surface, path.scene);
      path.hide();
    }
    // Out of sight: the picture is cleared before it is begun.
    this.highlight.set({ from: [0, 0, 0], to: [0, 0, 0], widthMm: 0, heightMm: 0 });
    this.stage.draw('picture', this.highlight.scene);
    this.highlight.set(null);
  }

  set palette(palette: Palette) {
    for (const path of this.#paths) path.uniforms.palette = palette;
    this.bed.palette = palette;
    this.surface.palette = palette;
    this.highlight.palette = palette;
    this.nozzle.colour = palette.nozzle;
    this.stage.background = palette.background;
  }

  /** A file's chunks go. */
  empty(): void {
    for (const path of this.#paths) path.clear();
    this.#textures.clear();
    this.#uploaded = 0;
    this.layerTimes.clear();
    this.#progress = null;
  }

  /** The context is lost: what was on the GPU is gone; what belongs to it here goes too and comes anew from the model. */
  lost(): void {
    for (const path of this.#paths) path.release();
    this.#textures.clear();
    this.#uploaded = 0;
    this.layerTimes.clear();
    this.bed.clear();
    this.surface.release();
    this.nozzle.release();
    this.highlight.release();
    this.stage.lost();
    this.#progress = null;
  }

  dispose(): void {
    this.empty();
    for (const path of this.#paths) path.release();
    this.bed.clear();
    this.surface.clear();
    this.nozzle.release();
    this.highlight.release();
    this.stage.dispose();
  }

  fullSegments(): number {
    const { camera } = this.#model;
    const passes = this.#passes(this.ranges(), this.#isFine(camera, this.stage.size, this.stage.ratio));
    return passes.reduce((sum, { ranges }) => sum + lengthOf(ranges), 0);
  }

  drawQuick(budget: number): number {
    const { camera } = this.#model;
    this.#look(camera, this.stage.size, this.stage.ratio);
    this.#clear('canvas');
    const segments = this.#drawRough(budget);
    this.#overlay();
    return segments;
  }

  drawSlice(budget: number, restart: boolean): Drawn {
    if (restart || !this.#progress) {
      this.stage.smooth = this.smooth.isWorth(this.fullSegments());
      this.#progress = this.begin('picture', this.#model.camera, this.stage.size, this.stage.ratio);
    }
    const progress = this.#progress;
    const drawn = this.goOn(progress, budget);
    if (drawn.complete) this.overlay();
    if (drawn.complete && progress.printed !== this.#model.printed) this.#onStale();
    return drawn;
  }

  /** The full picture of so many segments took so long. */
  measured(segments: number, elapsedMs: Ms): void {
    this.smooth.measured(this.stage.smooth, segments, elapsedMs);
  }

  /** Draws what was printed since the full picture over it: same places, same depths, other colours. */
  patch(): boolean {
    const progress = this.#progress;
    const to = this.#model.printed;
    if (!progress || to === ALL_PRINTED || progress.printed === ALL_PRINTED || to < progress.printed)
      return false;
    this.#look(progress.camera, progress.size, progress.ratio);
    const printed = progress.ranges.flatMap(({ first, end }): VertexRange[] => {
      const now = { first: Math.max(progress.printed, first), end: Math.min(to, end) };
      return now.end > now.first ? [now] : [];
    });
    for (const path of this.#paths) {
      path.uniforms.printed = to;
      path.uniforms.heightScale = 1;
    }
    // Of the same beads as the picture, and of nothing that lies over them.
    const isFine = this.#isFine(progress.camera, progress.size, progress.ratio);
    const [beads, others] = this.#passes(printed, isFine);
    for (const pass of isFine ? [beads] : [beads, others]) {
      for (const range of pass?.ranges ?? []) pass?.draw('picture', range);
    }
    progress.printed = to;
    this.overlay();
    return true;
  }

  overlay(): void {
    const { camera } = this.#progress ?? this.#model;
    this.#look(camera, this.stage.size, this.stage.ratio);
    this.stage.present();
    this.#overlay();
  }

  fence(): () => boolean {
    return this.stage.fence();
  }

  ranges(): VertexRange[] {
    const { content, shown } = this.#model;
    return content ? shownRanges(shown, content.layers, content.store.count) : [];
  }

  /** Begins a full picture: clears, and draws the bed. */
  begin(surface: Surface, camera: CameraState, size: ViewSize, ratio: number): Progress {
    const { content, printed } = this.#model;
    this.#look(camera, size, ratio);
    this.#clear(surface);
    if (content) {
      const { store, channels, rough } = content;
      this.#fine.sync(store.chunks, channels.chunks);
      this.#coarse.outer.sync(store.chunks, channels.chunks, rough.outer.segments);
      this.#coarse.inner.sync(store.chunks, channels.chunks, rough.inner.segments);
    }
    const ranges = this.ranges();
    const passes = this.#passes(ranges, this.#isFine(camera, size, ratio));
    return { surface, camera, size, ratio, ranges, passes, pass: 0, at: 0, printed };
  }

  /** Goes on with a full picture by about so many segments. */
  goOn(progress: Progress, budget: number): Drawn {
    const { surface, passes } = progress;
    this.#look(progress.camera, progress.size, progress.ratio);
    for (const path of this.#paths) {
      this.#apply(path);
      path.uniforms.printed = progress.printed;
      path.uniforms.heightScale = 1;
    }
    let left = Math.max(budget, 1);
    let segments = 0;
    for (let pass = passes[progress.pass]; pass && left > 0; pass = passes[progress.pass]) {
      const total = lengthOf(pass.ranges);
      const count = Math.min(left, total - progress.at);
      for (const part of cut(pass.ranges, progress.at, count)) pass.draw(surface, part);
      segments += count;
      left -= Math.max(count, 1);
      progress.at += count;
      if (progress.at < total) continue;
      progress.pass += 1;
      progress.at = 0;
    }
    return { segments, complete: progress.pass >= passes.length };
  }

  /** Whether a pixel is so small that it takes the path as it is. */
  #isFine(camera: CameraState, size: ViewSize, ratio: number): boolean {
    const box = this.#model.content?.store.boxOfAll();
    return !box || finestPx(camera, size, ratio, box) < FINE_PX_MM;
  }

  /** What a full picture of these vertices is made of. */
  #passes(ranges: readonly VertexRange[], isFine: boolean): Pass[] {
    const { content } = this.#model;
    const passes: Pass[] = [];
    if (!content) return passes;
    const { outer, inner } = content.rough;
    if (isFine) passes.push({ ranges, draw: (surface, part) => this.#beads(surface, part) });
    else
      passes.push(
        this.#listed(this.#coarse.outer, outer, ranges),
        this.#listed(this.#coarse.inner, inner, ranges),
      );
    if (this.#linesShown()) passes.push({ ranges, draw: (surface, part) => this.#lines(surface, part) });
    return passes;
  }

  #listed(path: PathObjects, { segments }: RoughList, ranges: readonly VertexRange[]): Pass {
    return {
      ranges: ranges.map((range) => segments.within(range)),
      draw: (surface, part) => {
        path.showBeads(segments.split(part).map(listedBeadsOf));
        this.stage.draw(surface, path.scene);
      },
    };
  }

  /** Brings channels to the GPU whose chunk is whole: one by one as they come, for all at once would hold up a picture. */
  uploadChannels(): void {
    const { chunks } = this.#model.content?.channels ?? { chunks: [] };
    for (; this.#uploaded < chunks.length - 1; this.#uploaded++) {
      const chunk = chunks[this.#uploaded];
      if (chunk) this.stage.upload(this.#textures.channels(this.#uploaded, chunk));
    }
  }

  /** Sets the camera and what depends on it. */
  #look(camera: CameraState, size: ViewSize, ratio: number): void {
    const { bedBox, content } = this.#model;
    const box = unionOf(unionOf(bedBox, content?.store.boxOfPlaces() ?? null), this.surface.box);
    this.stage.look(camera, box ?? EMPTY_BOX, size);
    const angle = pixelAngle(camera, size);
    for (const { uniforms } of this.#paths) uniforms.setPixels(angle / ratio, ratio);
    this.nozzle.pixelAngle = angle;
    this.highlight.view = size;
  }

  #clear(surface: Surface): void {
    this.stage.clear(surface);
    this.stage.draw(surface, this.#bedScene);
  }

  /** Brings a path's uniforms up to date. */
  #apply({ uniforms }: PathObjects): void {
    const { content, shown, mode, limits, object, volume } = this.#model;
    if (content) uniforms.header = content.header;
    uniforms.features = featureMask(shown.hiddenFeatures);
    uniforms.hiddenObjects = shown.hiddenObjects;
    uniforms.object = object;
    uniforms.volume = volume;
    uniforms.setColour(mode, limits[mode] ?? content?.ranges[mode] ?? null);
    uniforms.set('uLayerTimes', this.layerTimes.texture);
    uniforms.set('uLayerCount', this.layerTimes.count);
    uniforms.setLines(shown.travel, shown.wipes);
    uniforms.setMarkers(
      (shown.retractions ? FLAGS.retract | FLAGS.unretract : 0) |
        (shown.seams ? FLAGS.seam : 0) |
        (shown.pauses ? FLAGS.pause : 0),
      shown.toolChanges,
    );
  }

  #beads(surface: Surface, range: VertexRange): void {
    const parts = this.#model.content?.store.split(range) ?? [];
    if (parts.length === 0) return;
    this.#fine.showBeads(parts.map(beadsOf));
    this.stage.draw(surface, this.#fine.scene);
  }

  #lines(surface: Surface, range: VertexRange): void {
    const { travel, wipes } = this.#model.shown;
    const parts = this.#model.content?.store.split(range) ?? [];
    if (parts.length === 0) return;
    this.#fine.showLines(parts, { travels: travel || wipes, markers: this.#markersShown() });
    this.stage.draw(surface, this.#fine.scene);
  }

  #markersShown(): boolean {
    const { retractions, seams, toolChanges, pauses } = this.#model.shown;
    return retractions || seams || toolChanges || pauses;
  }

  #linesShown(): boolean {
    const { travel, wipes } = this.#model.shown;
    return travel || wipes || this.#markersShown();
  }

  /** What lies over the picture. */
  #overlay(): void {
    if (this.highlight.isShown) this.stage.draw('canvas', this.highlight.scene);
    if (this.nozzle.isShown) this.stage.draw('canvas', this.nozzle.scene);
  }

  #drawRough(budget: number): number {
    const { content } = this.#model;
    if (!content) return 0;
    const { rough } = content;
    const ranges = this.ranges();
    const [forOuter, forInner] = rough.shares(ranges, budget);
    let segments = this.#drawListed(this.#coarse.outer, rough.outer, ranges, forOuter);
    segments += this.#drawListed(this.#coarse.inner, rough.inner, ranges, forInner);
    if (this.#linesShown() && lengthOf(ranges) < budget) {
      this.#fine.sync(content.store.chunks, content.channels.chunks);
      this.#apply(this.#fine);
      for (const range of ranges) this.#lines('canvas', range);
    }
    return segments;
  }
  /** Draws about so many segments of a list; returns how many. */
  #drawListed(path: PathObjects, list: RoughList, ranges: readonly VertexRange[], budget: number): number {
    const { content, printed } = this.#model;
    const total = list.total(ranges);
    if (!content || total === 0 || budget < 1) return 0;
    path.sync(content.store.chunks, content.channels.chunks, list.segments);
    this.#apply(path);
    path.uniforms.printed = printed;
    let segments = 0;
    for (const range of ranges) {
      const share = (budget * list.total([range])) / total;
      const reduced = list.reduced(range, content.layers, Math.max(share, 1));
      const parts = reduced.ranges.flatMap((part) => list.segments.split(part));
      if (parts.length === 0) continue;
      path.uniforms.heightScale = reduced.layerStep;
      path.showBeads(parts.map(listedBeadsOf), reduced.stride);
      this.stage.draw('canvas', path.scene);
      segments += Math.round(lengthOf(reduced.ranges) / reduced.stride);
    }
    return segments;
  }
}
