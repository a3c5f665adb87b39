/**
 * Writes made-up toolpaths: vertices, what a planner would say of them, layers.
 *
 * Units: mm, mm/s.
 */
import { encodeChannels, WORDS_PER_CHANNELS } from '../src/channels';
import type { Layer } from '../src/layers';
import { encodeVertex, type FeatureName, FLAGS, type VertexHeader, WORDS_PER_VERTEX } from '../src/vertex';

export const HEADER: VertexHeader = { originMm: [-20, -20, -1], stepMm: 2 ** -10 };

export interface Made {
  readonly vertices: Uint32Array<ArrayBuffer>;
  readonly channels: Uint32Array<ArrayBuffer>;
  readonly layers: Layer[];
}

export type Point = readonly [x: number, y: number];

/** How the next segments are laid. */
export interface Manner {
  feature: FeatureName;
  widthMm: number;
  heightMm: number;
  tool: number;
  object: number;
  feedMmS: number;
  /** Of the commanded speed, what is reached. */
  reached: number;
  accelMmS2: number;
  nozzleC: number;
  fan: number;
}

const MANNER: Manner = {
  feature: 'outerWall',
  widthMm: 0.45,
  heightMm: 0.2,
  tool: 0,
  object: 0,
  feedMmS: 60,
  reached: 0.8,
  accelMmS2: 3000,
  nozzleC: 210,
  fan: 60,
};

const grown = (words: Uint32Array<ArrayBuffer>): Uint32Array<ArrayBuffer> => {
  const larger = new Uint32Array(words.length * 2);
  larger.set(words);
  return larger;
};

export class Writer {
  readonly layers: Layer[] = [];
  readonly manner: Manner = { ...MANNER };
  z = MANNER.heightMm;
  count = 0;
  #vertices = new Uint32Array(1 << 12);
  #channels = new Uint32Array(1 << 12);
  #at: readonly [number, number, number] = [0, 0, 0];

  layer(timeS: number): void {
    if (this.layers.length > 0) this.z += this.manner.heightMm;
    this.layers.push({ firstVertex: this.layers.length === 0 ? 0 : this.count, zMm: this.z, timeS });
  }

  to(x: number, y: number, flags = 0, events = 0): void {
    if ((this.count + 1) * WORDS_PER_VERTEX > this.#vertices.length) {
      this.#vertices = grown(this.#vertices);
      this.#channels = grown(this.#channels);
    }
    const { feature, widthMm, heightMm, tool, object } = this.manner;
    encodeVertex(HEADER, this.#vertices, this.count, {
      positionMm: [x, y, this.z],
      widthMm,
      heightMm,
      feature,
      tool,
      object,
      layer: Math.max(this.layers.length - 1, 0),
      events,
      flags: flags | (this.count === 0 ? FLAGS.break : 0),
    });
    this.#plan(Math.hypot(x - this.#at[0], y - this.#at[1], this.z - this.#at[2]));
    this.count += 1;
    this.#at = [x, y, this.z];
  }

  #plan(lengthMm: number): void {
    if (lengthMm === 0 || this.count === 0) return;
    const { feedMmS, reached, accelMmS2, nozzleC, fan, widthMm, heightMm } = this.manner;
    const speed = feedMmS * reached;
    encodeChannels(this.#channels, this.count, {
      peakSpeed: feedMmS * Math.min(reached * 1.1, 1),
      meanSpeed: speed,
      accel: accelMmS2,
      feed: feedMmS,
      flow: widthMm * heightMm * speed,
      nozzle: nozzleC,
      fan,
      timeS: lengthMm / speed,
    });
  }

  travel(x: number, y: number): void {
    this.to(this.#at[0], this.#at[1], FLAGS.retract | FLAGS.travel);
    this.to(x, y, FLAGS.travel);
    this.to(x, y, FLAGS.travel | FLAGS.unretract);
  }

  line(points: readonly Point[]): void {
    const first = points[0];
    if (!first) return;
    this.travel(...first);
    for (const [x, y] of points.slice(1)) this.to(x, y);
  }

  loop(points: readonly Point[]): void {
    const first = points[0];
    if (!first) return;
    this.line(points);
    this.to(...first, this.manner.feature === 'outerWall' ? FLAGS.seam : 0);
  }

  made(): Made {
    return {
      vertices: this.#vertices.slice(0, this.count * WORDS_PER_VERTEX),
      channels: this.#channels.slice(0, this.count * WORDS_PER_CHANNELS),
      layers: this.layers,
    };
  }
}

export const square = (x0: number, y0: number, x1: number, y1: number): Point[] => [
  [x0, y0],
  [x1, y0],
  [x1, y1],
  [x0, y1],
];

/** Points on a circle, from an angle to another, in radians. */
export function arc(
  cx: number,
  cy: number,
  radius: number,
  from: number,
  to: number,
  sides: number,
): Point[] {
  return Array.from({ length: sides + 1 }, (_, side) => {
    const angle = from + ((to - from) * side) / sides;
    return [cx + radius * Math.cos(angle), cy + radius * Math.sin(angle)] as const;
  });
}
