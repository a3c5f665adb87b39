/**
 * A file as the view knows it: vertices, planner channels, layers, the coarse path, the ranges of values.
 *
 * Does not know: drawing, what is shown. Units: vertex and layer indices.
 */
import { TexelStore, VertexStore } from './chunks';
import { Rough } from './coarse';
import type { ColourRanges } from './colours';
import { type Layer, LayerList } from './layers';
import { Picker } from './pick';
import { RangeFinder } from './ranges';
import type { VertexHeader } from './vertex';

export class Content {
  readonly header: VertexHeader;
  readonly store: VertexStore;
  /** As many as have come; never more than the vertices when all is there. */
  readonly channels = new TexelStore(0);
  readonly rough: Rough;
  readonly picker: Picker;
  layers = new LayerList();
  readonly #finder = new RangeFinder();
  /** The vertex whose channels are looked at next. */
  #nextRanged = 0;
  #ended = false;

  constructor(header: VertexHeader) {
    this.header = header;
    this.store = new VertexStore(header);
    this.rough = new Rough(header);
    this.picker = new Picker(this.store);
  }

  append(vertices: Uint32Array): void {
    this.store.append(vertices);
    this.rough.append(vertices);
    // Now, piece by piece: all at once would hold up a frame.
    this.picker.update();
    this.#finder.addVertices(vertices);
  }

  appendChannels(words: Uint32Array): void {
    this.channels.append(words);
    this.#findRanges();
  }

  /** No more vertices come; channels still may. */
  end(): void {
    this.#ended = true;
    this.rough.end();
    this.#findRanges();
  }

  setLayers(layers: readonly Layer[]): void {
    this.layers = new LayerList(layers);
    this.#finder.setLayers(layers);
  }

  get ranges(): ColourRanges {
    return this.#finder.found();
  }

  /** Nothing is missing any more. */
  get isWhole(): boolean {
    return this.#ended && this.channels.count >= this.store.count;
  }

  #findRanges(): void {
    const end = Math.min(this.store.count, this.channels.count);
    for (const { chunk, first, count } of this.store.split({ first: this.#nextRanged, end })) {
      const channels = this.channels.chunkOf(chunk.firstVertex);
      if (!channels) return;
      this.#finder.addChannels(chunk, channels, first, count);
    }
    this.#nextRanged = end;
  }
}
