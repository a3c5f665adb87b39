import { describe, expect, test } from 'vitest';
import { possibleSize, turned } from '../src/picture';

describe('a picture that is kept', () => {
  test('has the size that is asked for, as far as it can be made', () => {
    expect(possibleSize({ width: 1920, height: 1080 }, 16384)).toEqual({ width: 1920, height: 1080 });
    expect(possibleSize({ width: 10_000, height: 100 }, 2048)).toEqual({ width: 2048, height: 20 });
    const large = possibleSize({ width: 1e6, height: 1e6 }, 16384);
    expect(large.width).toBe(large.height);
    expect(large.width * large.height).toBeLessThanOrEqual(1 << 25);
    expect(possibleSize({ width: Number.NaN, height: -3 }, 2048)).toEqual({ width: 1, height: 1 });
  });

  test('has its rows from the top down', () => {
    const pixels = Uint8Array.from([1, 1, 1, 255, 2, 2, 2, 255, 3, 3, 3, 255, 4, 4, 4, 255]);
    expect([...turned(pixels, { width: 2, height: 2 })]).toEqual([
      3, 3, 3, 255, 4, 4, 4, 255, 1, 1, 1, 255, 2, 2, 2, 255,
    ]);
  });
});
