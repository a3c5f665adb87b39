import { describe, expect, test } from 'vitest';
import { gridLines, isBed } from '../src/bed';
import { featureMask, featureTable, PALETTES, rgb } from '../src/palette';
import { FEATURES, featureNumber } from '../src/vertex';

/** WCAG's relative luminance. */
function luminance(colour: readonly [number, number, number]): number {
  const [r, g, b] = colour.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * (r ?? 0) + 0.7152 * (g ?? 0) + 0.0722 * (b ?? 0);
}

describe('palettes', () => {
  test('colours are taken apart', () => {
    expect(rgb('#ff8000')).toEqual([1, 128 / 255, 0]);
    expect(rgb('#nonsense')).toEqual([0, 0, 0]);
  });

  test.each(['light', 'dark'] as const)('%s: every feature has a colour of its own', (theme) => {
    const colours = FEATURES.map((name) => PALETTES[theme].features[name]);
    expect(new Set(colours).size).toBe(FEATURES.length);
    for (const colour of colours) expect(colour).toMatch(/^#[0-9a-f]{6}$/);
  });

  test.each(['light', 'dark'] as const)('%s: walls and travels stand out from the bed', (theme) => {
    const palette = PALETTES[theme];
    const bed = luminance(rgb(palette.bed));
    for (const colour of [palette.features.outerWall, palette.travel, palette.seam]) {
      const [a, b] = [luminance(rgb(colour)), bed].sort((x, y) => y - x);
      expect(((a ?? 0) + 0.05) / ((b ?? 0) + 0.05)).toBeGreaterThan(1.7);
    }
  });

  test('the table has every number a vertex can hold', () => {
    const table = featureTable(PALETTES.dark);
    expect(table).toHaveLength(96);
    expect([...table.subarray(93)]).toEqual([...new Float32Array(rgb(PALETTES.dark.features.other))]);
  });

  test('hidden features lose their bit', () => {
    expect(featureMask([])).toBe(0xffff_ffff);
    expect(featureMask(['infill'])).toBe((0xffff_ffff & ~(1 << featureNumber('infill'))) >>> 0);
    expect(featureMask(['other']) >>> featureNumber('other')).toBe(0);
  });
});

describe('the bed', () => {
  test('grid lines lie on multiples of 10 mm, every fifth apart', () => {
    const { fine, coarse } = gridLines({ minMm: [-5, 0], maxMm: [105, 50] });
    expect((fine.length + coarse.length) / 6).toBe(11 + 6);
    for (let at = 0; at < coarse.length; at += 6) {
      expect([coarse[at], coarse[at + 1]].some((value) => (value ?? 1) % 50 === 0)).toBe(true);
    }
  });

  test('a huge bed has a bounded grid, a senseless one is none', () => {
    const { fine, coarse } = gridLines({ minMm: [0, 0], maxMm: [1e6, 10] });
    expect((fine.length + coarse.length) / 6).toBeLessThan(500);
    expect(isBed({ minMm: [0, 0], maxMm: [0, 10] })).toBe(false);
    expect(isBed({ minMm: [0, 0], maxMm: [Number.POSITIVE_INFINITY, 10] })).toBe(false);
    expect(isBed({ minMm: [0, 0], maxMm: [200, 200] })).toBe(true);
  });
});
