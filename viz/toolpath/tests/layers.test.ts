import { describe, expect, test } from 'vitest';
import { LayerList } from '../src/layers';

const every = (step: number, count: number): LayerList =>
  new LayerList(Array.from({ length: count }, (_, at) => ({ firstVertex: at * step, zMm: (at + 1) * 0.2 })));

describe('the list of layers', () => {
  test('a range of layers is a range of vertices, both ends included', () => {
    expect(every(10, 5).range(1, 2, 50)).toEqual({ first: 10, end: 30 });
    expect(every(10, 5).range(0, 99, 50)).toEqual({ first: 0, end: 50 });
    expect(every(10, 5).range(4, 4, 45)).toEqual({ first: 40, end: 45 });
  });

  test('what comes before the first layer belongs to it', () => {
    const list = new LayerList([
      { firstVertex: 7, zMm: 0.2 },
      { firstVertex: 20, zMm: 0.4 },
    ]);
    expect(list.range(0, 0, 30)).toEqual({ first: 0, end: 20 });
  });

  test('without layers everything is one', () => {
    expect(new LayerList().range(0, -1, 9)).toEqual({ first: 0, end: 9 });
  });

  test('a range upside down is empty', () => {
    const { first, end } = every(10, 5).range(3, 1, 50);
    expect(end).toBe(first);
  });

  test('each vertex has its layer', () => {
    const list = every(10, 5);
    for (let vertex = 0; vertex < 50; vertex++) expect(list.layerOf(vertex)).toBe(Math.floor(vertex / 10));
  });

  test('layers out of order are left out', () => {
    const list = new LayerList([0, 10, 5, 10, 20].map((firstVertex) => ({ firstVertex, zMm: firstVertex })));
    expect(list.count).toBe(3);
  });
});

describe('a thinner choice', () => {
  test('within the budget nothing is left out', () => {
    const range = { first: 0, end: 1000 };
    expect(every(10, 100).reduced(range, 1000)).toEqual({ ranges: [range], layerStep: 1, stride: 1 });
  });

  test('every nth layer, and always the topmost', () => {
    const { ranges, layerStep, stride } = every(10, 100).reduced({ first: 0, end: 1000 }, 250);
    expect([layerStep, stride]).toEqual([4, 1]);
    expect(ranges.at(-1)).toEqual({ first: 990, end: 1000 });
    expect(ranges).toHaveLength(25);
  });

  test('it stays within half as much again of the budget', () => {
    for (const budget of [1, 7, 100, 999, 5000]) {
      const { ranges, stride } = every(100, 100).reduced({ first: 150, end: 9_900 }, budget);
      const drawn = ranges.reduce((sum, { first, end }) => sum + end - first, 0) / stride;
      expect(drawn).toBeLessThanOrEqual(budget * 1.5 + 1);
      for (const { first, end } of ranges) {
        expect(first).toBeGreaterThanOrEqual(150);
        expect(end).toBeLessThanOrEqual(9_900);
      }
    }
  });
});
