import { expect, test } from 'vitest';
import { gridLines } from '../src/bed';

const BED = { minMm: [-110, -50], maxMm: [110, 50] } as const;

test('the lines of a round bed end at its edge, those of others at its sides', () => {
  const { fine, coarse } = gridLines({ ...BED, isRound: true });
  for (let at = 0; at < fine.length; at += 3)
    expect(Math.hypot((fine[at] ?? 0) / 110, (fine[at + 1] ?? 0) / 50)).toBeCloseTo(1, 9);
  expect(coarse.slice(0, 6).map(Math.abs)).not.toContain(110);
  const straight = gridLines(BED);
  expect(straight.fine).toHaveLength(fine.length);
  for (let at = 0; at < straight.fine.length; at += 3)
    expect(
      Math.abs(straight.fine[at] ?? 0) === 110 || Math.abs(straight.fine[at + 1] ?? 0) === 50,
      'an end of a line lies on a side',
    ).toBe(true);
});
