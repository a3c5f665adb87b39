import { expect, test } from 'vitest';
import { type Movable, moveByKey, wheelFactor } from '../src/controls';

test('the wheel zooms in both directions alike, and never wildly', () => {
  expect(wheelFactor(100, 0) * wheelFactor(-100, 0)).toBeCloseTo(1, 12);
  expect(wheelFactor(3, 1)).toBeGreaterThan(1.1);
  expect(wheelFactor(1e9, 0)).toBeLessThan(1.5);
});

test('keys move, others are left to the page', () => {
  const said: string[] = [];
  const view: Movable = {
    orbit: (dx, dy) => said.push(`orbit ${dx} ${dy}`),
    pan: (dx, dy) => said.push(`pan ${dx} ${dy}`),
    zoom: (factor) => said.push(factor < 1 ? 'nearer' : 'farther'),
    fit: () => said.push('fit'),
  };
  for (const key of ['ArrowLeft', '+', '-', 'Home']) expect(moveByKey(view, key, false)).toBe(true);
  expect(moveByKey(view, 'ArrowLeft', true)).toBe(true);
  expect(moveByKey(view, 'Tab', false)).toBe(false);
  expect(said).toEqual(['orbit 24 0', 'nearer', 'farther', 'fit', 'pan -24 0']);
});
