import { expect, test } from 'vitest';
import type { MachineMesh } from '../src/preview/protocol';
import { meshOf, surfaceOf } from '../src/state/mesh';
import { mm } from '../src/units';

const mesh = (name: string): MachineMesh => ({
  name,
  origin: [mm(20), mm(30)],
  step: [mm(50), mm(100)],
  rows: [[0.1, 0.2, 0.3].map(mm), [0.4, 0.5, 0.6].map(mm)],
});

test('what is in force is shown, else what was chosen, else the default', () => {
  const all = [mesh('cold'), mesh('default'), mesh('hot')];
  const shown = (inForce: string | null, wanted: string | null): string | undefined =>
    meshOf(all, inForce, wanted)?.name;
  expect(shown('hot', 'cold')).toBe('hot');
  expect(shown(null, 'cold')).toBe('cold');
  expect(shown(null, 'gone')).toBe('default');
  expect(shown('of another machine', 'cold')).toBeUndefined();
  expect(meshOf([mesh('cold')], null, null)?.name).toBe('cold');
  expect(meshOf([], null, 'cold')).toBeNull();
});

test('a mesh is handed to the view row by row', () => {
  expect(surfaceOf(mesh('cold'))).toEqual({
    originMm: [20, 30],
    stepMm: [50, 100],
    columns: 3,
    rows: 2,
    heightsMm: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
  });
});
