import { describe, expect, test } from 'vitest';
import { cut, LayerList, lengthOf } from '../src/layers';
import { SHOW_ALL, shownRanges } from '../src/shown';

const LAYERS = new LayerList([0, 10, 20, 30].map((firstVertex) => ({ firstVertex, zMm: firstVertex })));
const ranges = (shown: Partial<typeof SHOW_ALL>, layers = LAYERS): (readonly [number, number])[] =>
  shownRanges({ ...SHOW_ALL, ...shown }, layers, 40)
    .filter(({ first, end }) => end > first)
    .map(({ first, end }) => [first, end]);

describe('what is shown', () => {
  test('all, and a range of layers', () => {
    expect(ranges({})).toEqual([[0, 40]]);
    expect(ranges({ layerFrom: 1, layerTo: 2 })).toEqual([[10, 30]]);
    expect(ranges({ layerFrom: 3, layerTo: 1 })).toEqual([]);
  });

  test('moves of the topmost layer; the layers below stay whole', () => {
    expect(ranges({ layerTo: 2, vertexTo: 24 })).toEqual([[0, 25]]);
    expect(ranges({ layerTo: 2, vertexFrom: 22, vertexTo: 24 })).toEqual([
      [0, 20],
      [22, 25],
    ]);
    expect(ranges({ layerFrom: 2, layerTo: 2, vertexFrom: 22 })).toEqual([[22, 30]]);
  });

  test('a limit in another layer', () => {
    // The topmost layer is the one in which it ends.
    expect(ranges({ vertexFrom: 12, vertexTo: 14 })).toEqual([
      [0, 10],
      [12, 15],
    ]);
    expect(lengthOf(shownRanges({ ...SHOW_ALL, layerTo: 2, vertexFrom: 5 }, LAYERS, 40))).toBe(30);
    expect(ranges({ layerTo: 1, vertexFrom: 25, vertexTo: 35 })).toEqual([[0, 10]]);
  });

  test('without layers all is one', () => {
    expect(ranges({ vertexFrom: 5, vertexTo: 9 }, new LayerList())).toEqual([[5, 10]]);
  });

  test('ranges are cut as if they lay end to end', () => {
    const parts = [
      { first: 0, end: 10 },
      { first: 50, end: 55 },
    ];
    expect(lengthOf(parts)).toBe(15);
    expect(cut(parts, 8, 4)).toEqual([
      { first: 8, end: 10 },
      { first: 50, end: 52 },
    ]);
    expect(cut(parts, 12, 100)).toEqual([{ first: 52, end: 55 }]);
    expect(cut(parts, 15, 5)).toEqual([]);
  });
});
