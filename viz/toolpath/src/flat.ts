/**
 * The view where WebGL2 is missing: the topmost layer that is shown, from above, drawn by the canvas's own lines.
 *
 * Does: takes the same requests as the 3D view and carries out those that mean something on a plane; draws a piece at a
 * time, so that requests are heard between. Does not know: the page, WebGL. Units: mm, CSS pixels, vertex and layer indices.
 */
import { type Bed, bedBox, isBed } from './bed';
import type { BoxMm, Vec3 } from './camera';
import { VertexStore } from './chunks';
import { type ColourMode, categoryColour } from './colours';
import { type Layer, LayerList, type VertexRange } from './layers';
import type { View, ViewEvent } from './messages';
import { type HexColour, PALETTES, type Palette, type Theme } from './palette';
import { SHOW_ALL, type Shown } from './shown';
import { sliceOf } from './slice';
import type { CssPx, VertexIndex } from './units';
import { decodeVertex, type Vertex, type VertexHeader, WORDS_PER_VERTEX } from './vertex';
import type { ViewSizePx } from './view';

type Context = CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D;
type Point = readonly [number, number];

/** Segments that are drawn, or looked at, in one go. */
const PIECE = 8192;
/** Of a layer, at most; what is more is left out. */
const SEGMENTS_MAX = 1 << 20;
const PICK_PX: CssPx = 8;
const LINE_PX_MIN = 1;
const MARGIN = 0.9;
const SCALE_MIN = 0.02;
const SCALE_MAX = 2000;
const NOZZLE_PX = 6;

/** What is looked at: the place in the middle, and pixels of a millimetre. */
interface Place {
  readonly atMm: Point;
  readonly scale: number;
}

/** More questions at once mean that nobody hears the answers. */
const SETTLING_MAX = 64;

const nothing = (): void => undefined;

/** How far a point is from the line between two. */
export function distance([x, y]: Point, [ax, ay]: Point, [bx, by]: Point): number {
  const [dx, dy] = [bx - ax, by - ay];
  const square = dx * dx + dy * dy;
  const along = square > 0 ? Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / square, 0), 1) : 0;
  return Math.hypot(x - ax - along * dx, y - ay - along * dy);
}

export class FlatView implements View {
  readonly #canvas: HTMLCanvasElement | OffscreenCanvas;
  readonly #context: Context;
  readonly #tell: (event: ViewEvent) => void;
  #store: VertexStore | null = null;
  #layers = new LayerList();
  #shown: Shown = SHOW_ALL;
  #palette: Palette = PALETTES.light;
  #mode: ColourMode = 'feature';
  #bed: Bed | null = null;
  /** All of it is in view, and is to stay so until the user moves it. */
  #isFitted = false;
  #place: Place = { atMm: [0, 0], scale: 2 };
  #size: ViewSizePx = { width: 1, height: 1, ratio: 1 };
  #nozzle: Vec3 | null = null;
  #follows = false;
  #printed: VertexIndex | null = null;
  #highlight: VertexIndex | null = null;
  #object: number | null = null;
  /** The vertex from which the drawing goes on; null: it is done. */
  #next: VertexIndex | null = null;
  #isWaiting = false;
  #isOver = false;
  /** Questions whether the drawing is done. */
  #settling: number[] = [];

  constructor(
    canvas: HTMLCanvasElement | OffscreenCanvas,
    size: ViewSizePx,
    tell: (event: ViewEvent) => void,
  ) {
    const context = canvas.getContext('2d') as Context | null;
    if (!context) throw new Error('the canvas draws nothing');
    this.#canvas = canvas;
    this.#context = context;
    this.#tell = tell;
    this.resize(size);
  }

  setBed(bed: Bed | null): void {
    this.#bed = bed && isBed(bed) ? bed : null;
    this.#restart();
  }

  begin(header: VertexHeader): void {
    this.#store = new VertexStore(header);
    this.#layers = new LayerList();
    this.#restart();
  }

  append(vertices: Uint32Array): void {
    this.#store?.append(vertices);
  }

  end(): void {
    this.#seeAll();
  }

  clear(): void {
    this.#store = null;
    this.#layers = new LayerList();
    this.#restart();
  }

  setLayers(layers: readonly Layer[]): void {
    this.#layers = new LayerList(layers);
    this.#restart();
  }

  show(shown: Partial<Shown>): void {
    this.#shown = { ...this.#shown, ...shown };
    this.#restart();
  }

  setColour(mode: ColourMode): void {
    this.#mode = mode;
    this.#restart();
  }

  setPrintedUpTo(vertex: VertexIndex | null): void {
    if (vertex === this.#printed) return;
    this.#printed = vertex;
    this.#restart();
  }

  setNozzle(at: Vec3 | null): void {
    this.#nozzle = at?.every(Number.isFinite) ? at : null;
    if (this.#nozzle && this.#follows)
      this.#place = { ...this.#place, atMm: [this.#nozzle[0], this.#nozzle[1]] };
    this.#restart();
  }

  setFollow(follow: boolean): void {
    this.#follows = follow;
    if (follow) this.setNozzle(this.#nozzle);
  }

  setHighlight(vertex: VertexIndex | null): void {
    this.#highlight = vertex;
    this.#restart();
  }

  setHighlightedObject(object: number | null): void {
    this.#object = object;
    this.#restart();
  }

  // What has no meaning on a plane, or needs more than lines.
  readonly appendChannels = nothing;
  readonly setColourRange = nothing;
  readonly setVolume = nothing;
  readonly setMesh = nothing;
  readonly setProjection = nothing;

  setTheme(theme: Theme): void {
    this.#palette = PALETTES[theme];
    this.#restart();
  }

  orbit(dx: CssPx, dy: CssPx): void {
    this.pan(dx, dy);
  }

  pan(dx: CssPx, dy: CssPx): void {
    const { atMm, scale } = this.#place;
    this.#place = { scale, atMm: [atMm[0] - dx / scale, atMm[1] + dy / scale] };
    this.#isFitted = false;
    this.#restart();
  }

  zoom(factor: number, at: readonly [CssPx, CssPx] = [0, 0]): void {
    if (!(factor > 0) || !Number.isFinite(factor)) return;
    const { atMm, scale } = this.#place;
    const next = Math.min(Math.max(scale / factor, SCALE_MIN), SCALE_MAX);
    const shift = 1 / scale - 1 / next;
    this.#place = { scale: next, atMm: [atMm[0] + at[0] * shift, atMm[1] - at[1] * shift] };
    this.#isFitted = false;
    this.#restart();
  }

  fit(): void {
    this.#isFitted = true;
    const box = this.#store?.box() ?? (this.#bed && bedBox(this.#bed));
    if (!box) return;
    const [width, height] = [box.max[0] - box.min[0], box.max[1] - box.min[1]];
    const scale =
      MARGIN * Math.min(this.#size.width / Math.max(width, 1), this.#size.height / Math.max(height, 1));
    const middle = (axis: 0 | 1): number => (box.min[axis] + box.max[axis]) / 2;
    this.#place = { scale: Math.min(Math.max(scale, SCALE_MIN), SCALE_MAX), atMm: [middle(0), middle(1)] };
    this.#restart();
  }

  setCamera(): void {
    this.fit();
  }

  resize(size: ViewSizePx): void {
    this.#size = size;
    this.#canvas.width = Math.max(1, Math.round(size.width * size.ratio));
    this.#canvas.height = Math.max(1, Math.round(size.height * size.ratio));
    this.#seeAll();
  }

  slice(first: VertexIndex, end: VertexIndex, id: number): void {
    const vertices = this.#store ? sliceOf(this.#store, { first, end }) : new Uint32Array();
    const header = this.#store?.header ?? null;
    this.#tell({ type: 'slice', id, slice: { first, header, vertices, channels: new Uint32Array() } });
  }

  settle(id: number): void {
    if (this.#settling.length < SETTLING_MAX) this.#settling.push(id);
    if (this.#next === null) this.#tellSettled();
  }

  /** The segment that is nearest to the point, if it is near. */
  pick(x: CssPx, y: CssPx, id: number): void {
    const point: Point = [x, y];
    let found: VertexIndex | null = null;
    let least = PICK_PX;
    for (const { vertex, from, to, at } of this.#segments(this.#range())) {
      if (!this.#isShown(vertex)) continue;
      const away = distance(point, from, to);
      if (away < least) [least, found] = [away, at];
    }
    this.#tell({ type: 'picked', id, vertex: found });
  }

  picture(id: number): void {
    while (this.#next !== null) this.#drawPiece();
    const canvas = this.#canvas;
    const tell = (blob: Blob | null): void => this.#tell({ type: 'picture', id, blob });
    if ('convertToBlob' in canvas) {
      canvas.convertToBlob({ type: 'image/png' }).then(tell, () => tell(null));
    } else canvas.toBlob(tell, 'image/png');
  }

  dispose(): void {
    this.#isOver = true;
    this.#store = null;
  }

  /** All that there is by now, unless the user has moved it. */
  #seeAll(): void {
    if (this.#isFitted) this.fit();
    this.setFollow(this.#follows);
    this.#restart();
  }

  /** The topmost layer that is shown, or the part of it that is. */
  #range(): VertexRange {
    const { layerTo, vertexFrom, vertexTo } = this.#shown;
    const count = this.#store?.count ?? 0;
    const limit = vertexTo === null ? count : Math.min(vertexTo + 1, count);
    const top = Math.min(layerTo, this.#layers.count - 1, this.#layers.layerOf(Math.max(limit - 1, 0)));
    const whole = this.#layers.range(top, top, count);
    const first = Math.max(whole.first, vertexFrom ?? 0);
    return { first, end: Math.min(whole.end, limit, first + SEGMENTS_MAX) };
  }

  #isShown({ travel, wipe, feature, object, break: isBreak }: Vertex): boolean {
    if (isBreak) return false;
    if (travel) return this.#shown.travel || (wipe && this.#shown.wipes);
    return !this.#shown.hiddenFeatures.includes(feature) && !this.#shown.hiddenObjects.includes(object);
  }

  *#segments({ first, end }: VertexRange): Generator<Segment> {
    const store = this.#store;
    if (!store) return;
    for (let at = first; at < end; at += PIECE) {
      const from = Math.max(at - 1, 0);
      const words = sliceOf(store, { first: from, end: Math.min(at + PIECE, end) });
      let before: Point | null = null;
      for (let index = 0; index * WORDS_PER_VERTEX < words.length; index++) {
        const vertex = decodeVertex(store.header, words, index);
        const to = this.#onScreen(vertex.positionMm);
        if (before && from + index >= first) yield { at: from + index, vertex, from: before, to };
        before = to;
      }
    }
  }

  #onScreen([x, y]: readonly [number, number, number]): Point {
    const { atMm, scale } = this.#place;
    return [this.#size.width / 2 + (x - atMm[0]) * scale, this.#size.height / 2 - (y - atMm[1]) * scale];
  }

  #colourOf({ travel, wipe, feature, tool, object }: Vertex, at: VertexIndex): HexColour {
    const palette = this.#palette;
    if (travel) return wipe ? palette.wipe : palette.travel;
    if (this.#printed !== null && at > this.#printed) return palette.remaining;
    if (this.#object !== null && object !== this.#object) return palette.remaining;
    if (this.#mode === 'tool') return categoryColour('tool', tool) ?? palette.features.other;
    if (this.#mode === 'object') return categoryColour('object', object) ?? palette.features.other;
    return palette.features[feature];
  }

  #restart(): void {
    this.#next = -1;
    if (this.#isWaiting) return;
    this.#isWaiting = true;
    setTimeout(() => this.#continue());
  }

  #continue(): void {
    this.#isWaiting = false;
    if (this.#isOver || this.#next === null) return;
    this.#drawPiece();
    if (this.#next === null) return this.#tellSettled();
    this.#isWaiting = true;
    setTimeout(() => this.#continue());
  }

  #tellSettled(): void {
    for (const id of this.#settling.splice(0)) this.#tell({ type: 'settled', id });
  }

  #drawPiece(): void {
    const range = this.#range();
    const begins = this.#next === -1;
    if (begins) this.#drawBed();
    const first = begins ? range.first : (this.#next ?? range.end);
    const end = Math.min(first + PIECE, range.end);
    const context = this.#context;
    for (const { vertex, from, to, at } of this.#segments({ first, end })) {
      if (!this.#isShown(vertex)) continue;
      this.#line(from, to, this.#colourOf(vertex, at), vertex.travel ? 0 : vertex.widthMm);
    }
    this.#next = end < range.end ? end : null;
    if (this.#next !== null) return;
    this.#drawHighlight();
    if (!this.#nozzle) return;
    const [x, y] = this.#onScreen(this.#nozzle);
    context.fillStyle = this.#palette.nozzle;
    context.beginPath();
    context.arc(x, y, NOZZLE_PX, 0, 2 * Math.PI);
    context.fill();
  }

  #line(from: Point, to: Point, colour: HexColour, widthMm: number): void {
    const context = this.#context;
    context.strokeStyle = colour;
    context.lineWidth = Math.max(LINE_PX_MIN, widthMm * this.#place.scale * MARGIN);
    context.beginPath();
    context.moveTo(...from);
    context.lineTo(...to);
    context.stroke();
  }

  #drawHighlight(): void {
    const at = this.#highlight;
    if (at === null) return;
    for (const { from, to, vertex } of this.#segments({ first: at, end: at + 1 }))
      this.#line(
        from,
        to,
        this.#palette.seam,
        Math.max(vertex.widthMm, (2 * LINE_PX_MIN) / this.#place.scale),
      );
  }

  #drawBed(): void {
    const context = this.#context;
    const { ratio, width, height } = this.#size;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.lineCap = 'round';
    context.fillStyle = this.#palette.background;
    context.fillRect(0, 0, width, height);
    const box: BoxMm | null = this.#bed && bedBox(this.#bed);
    if (!box) return;
    const [left, bottom] = this.#onScreen(box.min);
    const [right, top] = this.#onScreen(box.max);
    context.beginPath();
    if (this.#bed?.isRound) {
      const [x, y] = [(left + right) / 2, (bottom + top) / 2];
      context.ellipse(x, y, (right - left) / 2, (bottom - top) / 2, 0, 0, 2 * Math.PI);
    } else context.rect(left, top, right - left, bottom - top);
    context.fillStyle = this.#palette.bed;
    context.fill();
    context.strokeStyle = this.#palette.bedEdge;
    context.lineWidth = LINE_PX_MIN;
    context.stroke();
  }
}

interface Segment {
  readonly at: VertexIndex;
  readonly vertex: Vertex;
  readonly from: Point;
  readonly to: Point;
}
