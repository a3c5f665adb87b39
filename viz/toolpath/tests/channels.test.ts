import { describe, expect, test } from 'vitest';
import { CHANNELS, decodeChannels, encodeChannels } from '../src/channels';
import { Content } from '../src/content';
import { layerTimes } from '../src/layer_times';
import { encodeVertex, FLAGS } from '../src/vertex';

const HEADER = { originMm: [0, 0, 0], stepMm: 2 ** -10 } as const;

describe('the bits of channels', () => {
  test('what is written is read again', () => {
    const words = new Uint32Array(8);
    const input = {
      peakSpeed: 120.5,
      meanSpeed: 99.25,
      accel: 5000,
      feed: 150,
      flow: 12.125,
      nozzle: 215,
      fan: 80,
      timeS: 0.25,
    };
    encodeChannels(words, 1, input);
    expect(decodeChannels(words, 1)).toEqual(input);
    expect(decodeChannels(words, 0)).toBeNull();
    expect(decodeChannels(words, 2)).toBeNull();
    // docs/vertex.md: mean speed above the peak's 16 bits, feed above acceleration, fan above nozzle above flow.
    expect(words[4]).toBe(((99.25 * 32) << 16) | (120.5 * 32));
    expect(words[5]).toBe(((150 * 32) << 16) | 2500);
    expect(words[6]).toBe(((80 << 25) | (215 << 16) | (12.125 * 512)) >>> 0);
  });

  test('values out of range saturate and leave their neighbours alone', () => {
    const words = new Uint32Array(4);
    encodeChannels(words, 0, { flow: 1e9, fan: 1e9, nozzle: -5, timeS: 1 });
    expect(decodeChannels(words, 0)).toMatchObject({ fan: 127, nozzle: 0, flow: 65535 / 512, feed: 0 });
    expect(Object.keys(CHANNELS)).toHaveLength(7);
  });
});

/** A straight line of so many segments, and each one's mean speed. */
function line(count: number): { vertices: Uint32Array; channels: Uint32Array } {
  const vertices = new Uint32Array(count * 4);
  const channels = new Uint32Array(count * 4);
  for (let at = 0; at < count; at++) {
    encodeVertex(HEADER, vertices, at, {
      positionMm: [(at % 1000) / 2, Math.floor(at / 1000), 0.2],
      widthMm: 0.4,
      heightMm: 0.2,
      feature: at === 5 ? 'custom' : 'outerWall',
      tool: at > 10 ? 2 : 1,
      flags: at === 0 ? FLAGS.break : at === 7 ? FLAGS.travel : 0,
    });
    if (at === 0) continue;
    const speed = at === 5 || at === 7 ? 900 : 10 + (at % 90);
    encodeChannels(channels, at, { meanSpeed: speed, feed: 2 * speed, flow: 1, nozzle: 200, timeS: 0.01 });
  }
  return { vertices, channels };
}

describe('channels of a file', () => {
  test('ranges are those of what is laid, however the data arrive', () => {
    const { vertices, channels } = line(2000);
    for (const piece of [1, 7, 333, 2000]) {
      const content = new Content(HEADER);
      for (let at = 0; at < 2000; at += piece) {
        content.append(vertices.slice(at * 4, (at + piece) * 4));
        // One piece behind.
        if (at >= piece) content.appendChannels(channels.slice((at - piece) * 4, at * 4));
      }
      content.end();
      expect(content.isWhole).toBe(false);
      content.appendChannels(channels.slice(content.channels.count * 4));
      expect(content.isWhole).toBe(true);
      const { speed, feed, flow, flowAsked, width, tool, temperature, layerTime } = content.ranges;
      expect(speed).toEqual([10, 99]);
      expect(feed).toEqual([20, 198]);
      expect(flow).toEqual([1, 1]);
      expect(flowAsked).toEqual([2, 2]);
      expect(width?.[0]).toBeCloseTo(0.4, 9);
      expect(tool).toEqual([1, 2]);
      expect(temperature).toEqual([200, 200]);
      expect(layerTime).toBeUndefined();
    }
  });

  test('times of layers, one float each in whole rows', () => {
    const layers = [1.5, undefined, -3, Number.POSITIVE_INFINITY, 8].map((timeS, at) => ({
      firstVertex: at,
      zMm: at,
      ...(timeS === undefined ? {} : { timeS }),
    }));
    const times = layerTimes(layers);
    expect([...times.subarray(0, 6)]).toEqual([1.5, 0, 0, 0, 8, 0]);
    expect(times.length % 2048).toBe(0);
    const content = new Content(HEADER);
    content.setLayers(layers);
    expect(content.ranges.layerTime).toEqual([1.5, 8]);
  });
});
