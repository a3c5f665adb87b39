/**
 * How long each layer takes, as a small texture that the shader looks up by the layer's number.
 *
 * Units: s; 0 where it is not known.
 */
import { DataTexture, FloatType, NearestFilter, RedFormat } from 'three';
import { LAYER_TIMES_PER_ROW } from './colour_shader';
import type { Layer } from './layers';

/** What every WebGL2 offers: 4 million layers. */
const ROWS_MAX = 2048;

/** One float a layer, in whole rows; at least one row. */
export function layerTimes(layers: readonly Layer[]): Float32Array<ArrayBuffer> {
  const rows = Math.min(Math.max(Math.ceil(layers.length / LAYER_TIMES_PER_ROW), 1), ROWS_MAX);
  const times = new Float32Array(rows * LAYER_TIMES_PER_ROW);
  for (const [at, { timeS }] of layers.entries()) {
    if (at >= times.length) break;
    times[at] = timeS !== undefined && timeS > 0 && timeS < Infinity ? timeS : 0;
  }
  return times;
}

export class LayerTimes {
  texture: DataTexture | null = null;
  count = 0;

  set(layers: readonly Layer[]): void {
    this.clear();
    const times = layerTimes(layers);
    const texture = new DataTexture(
      times,
      LAYER_TIMES_PER_ROW,
      times.length / LAYER_TIMES_PER_ROW,
      RedFormat,
      FloatType,
    );
    texture.minFilter = NearestFilter;
    texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    this.texture = texture;
    this.count = Math.min(layers.length, times.length);
  }

  clear(): void {
    this.texture?.dispose();
    this.texture = null;
    this.count = 0;
  }
}
