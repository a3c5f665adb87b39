// Numbers are read however people write them.
import { expect, test } from 'vitest';
import { formatDuration, formatNumber, formatPlain, parseNumber } from '../src/panel/numbers';

test.each([
  ['1.5', 1.5],
  ['1,5', 1.5],
  [' 205 ', 205],
  ['1.234,5', 1234.5],
  ['1,234.5', 1234.5],
  ['1 234,5', 1234.5],
  ["1'234.5", 1234.5],
  ['\u22123', -3],
  ['-0,1', -0.1],
  ['.5', 0.5],
  ['5.', 5],
])('%s is %d', (text, value) => {
  expect(parseNumber(text)).toBe(value);
});

test.each(['', ' ', 'abc', '1e5', '--1', '1.2.3,4,5', 'NaN', 'Infinity', '0x10', '1,2,3'])(
  '%s is no number',
  (text) => {
    expect(parseNumber(text)).toBeUndefined();
  },
);

test.each([
  [250_000, 0],
  [4_000_000, 0],
  [1234.5, 1],
  [0.1, 1],
  [-12_345, 0],
])('what a field shows of %d can be read back', (value, decimals) => {
  expect(parseNumber(formatPlain(value, decimals))).toBe(value);
});

test('durations are short where they are short', () => {
  expect(formatDuration(0)).toBe('0:00');
  expect(formatDuration(59.6)).toBe('1:00');
  expect(formatDuration(3661)).toBe('1:01:01');
  expect(formatDuration(90_000)).toBe('25:00:00');
});

test('there is no negative zero', () => {
  expect(formatNumber(-0.001, 2)).toBe('0.00');
});
