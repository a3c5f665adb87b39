// The planned speed in words says what the graph shows.
import { expect, test } from 'vitest';
import { peakAhead, speedNow } from '../src/panel/instrument_values';

const plan = (...numbers: number[]): Float64Array => Float64Array.from(numbers);

test.each([
  ['nothing', plan(), null, null],
  ['between two pairs', plan(-1, 0, 1, 100), 50, 100],
  ['exactly at a pair', plan(-1, 0, 0, 80, 1, 20), 80, 80],
  ['beginning now', plan(0, 30, 1, 60), 30, 60],
  ['beginning later', plan(1, 30, 2, 60), null, 60],
  ['all made', plan(-2, 30, -1, 60), null, null],
  ['a jump now', plan(0, 10, 0, 50, 1, 20), 10, 50],
  ['slower from now on than before', plan(-2, 200, -1, 10, 1, 10), 10, 10],
])('%s', (_name, pairs, now, peak) => {
  expect(speedNow(pairs)).toBe(now);
  expect(peakAhead(pairs)).toBe(peak);
});
