import { describe, expect, test } from 'vitest';
import {
  CATEGORIES,
  COLOUR_MODES,
  categoryColour,
  colourTable,
  modeNumber,
  RAMP_LENGTH,
  RAMPS,
} from '../src/colours';
import { rgb } from '../src/palette';
import { isColourMode, validRange } from '../src/shown';

/** WCAG's relative luminance. */
function luminance(colour: readonly [number, number, number]): number {
  const [r, g, b] = colour.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * (r ?? 0) + 0.7152 * (g ?? 0) + 0.0722 * (b ?? 0);
}

describe('colours of values', () => {
  test.each(['light', 'dark'] as const)('%s: the ramp grows brighter all the way', (theme) => {
    const ramp = RAMPS[theme];
    const bright = ramp.map((colour) => luminance(rgb(colour)));
    for (let at = 1; at < bright.length; at++) expect(bright[at]).toBeGreaterThan(bright[at - 1] ?? 1);
    expect(colourTable(ramp)).toHaveLength(3 * RAMP_LENGTH);
  });

  test('tools and objects have colours of their own, over and over; no object has none', () => {
    expect(new Set(CATEGORIES).size).toBe(CATEGORIES.length);
    expect(categoryColour('tool', 0)).toBe(CATEGORIES[0]);
    expect(categoryColour('object', 1)).toBe(CATEGORIES[0]);
    expect(categoryColour('object', 0)).toBeNull();
    expect(categoryColour('tool', CATEGORIES.length + 1)).toBe(CATEGORIES[1]);
  });

  test('every mode has a number', () => {
    expect(COLOUR_MODES.map(modeNumber)).toEqual(COLOUR_MODES.map((_, at) => at));
    expect(isColourMode('speed')).toBe(true);
    expect(isColourMode('colour')).toBe(false);
  });

  test('limits are put in order, senseless ones and those of modes without a range are none', () => {
    expect(validRange('speed', [1, 5])).toEqual([1, 5]);
    expect(validRange('speed', [5, 1])).toEqual([1, 5]);
    expect(validRange('speed', [5, Number.NaN])).toBeNull();
    expect(validRange('tool', [0, 1])).toBeNull();
    expect(validRange('speed', null)).toBeNull();
  });
});
