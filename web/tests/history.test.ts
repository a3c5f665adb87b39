// The temperature history is bounded, takes a reading a second, and says what it holds.
import { expect, test } from 'vitest';
import type { HeaterState } from '../src/machine/protocol';
import { READINGS_MAX, TemperatureHistory } from '../src/state/history';
import { celsius, seconds, share } from '../src/units';

const heater = (name: HeaterState['name'], temperature: number, target = 0): HeaterState => ({
  name,
  temperature: celsius(temperature),
  target: celsius(target),
  duty: share(0),
  isStandby: false,
});

const ALWAYS = seconds(Number.NEGATIVE_INFINITY);
const BOTH = ['extruder', 'heater_bed'] as const;

test('a reading a second is kept, whatever comes between', () => {
  const history = new TemperatureHistory();
  const kept = [0, 0.1, 0.9, 1.0, 1.5, 2.05].filter((at) =>
    history.take(seconds(at), [heater('extruder', at)]),
  );
  expect(kept).toEqual([0, 1.0, 2.05]);
  expect(history.last).toBe(2.05);
});

test('nothing is kept of a machine without readings', () => {
  const history = new TemperatureHistory();
  expect(history.take(seconds(1), [])).toBe(false);
  expect(history.statistics('extruder', seconds(600))).toBeNull();
  expect(history.numbersAfter(ALWAYS, BOTH)).toHaveLength(0);
});

test('readings are handed on once each, with their heater’s place', () => {
  const history = new TemperatureHistory();
  history.take(seconds(1), [heater('heater_bed', 60, 60), heater('extruder', 200, 205)]);
  expect([...history.numbersAfter(ALWAYS, BOTH)]).toEqual([0, 1, 200, 205, 1, 1, 60, 60]);
  history.take(seconds(2), [heater('extruder', 201, 205)]);
  expect([...history.numbersAfter(seconds(1), BOTH)]).toEqual([0, 2, 201, 205]);
  expect(history.numbersAfter(seconds(2), BOTH)).toHaveLength(0);
});

test('no more than two hours are kept, and the newest are those that stay', () => {
  const history = new TemperatureHistory();
  const end = READINGS_MAX + 1000;
  for (let at = 0; at < end; at += 1) history.take(seconds(at), [heater('extruder', at)]);
  const numbers = history.numbersAfter(ALWAYS, BOTH);
  expect(numbers).toHaveLength(READINGS_MAX * 4);
  expect([...numbers.subarray(0, 3)]).toEqual([0, 1000, 1000]);
  expect([...numbers.subarray(-4, -1)]).toEqual([0, end - 1, end - 1]);
  expect(READINGS_MAX).toBeGreaterThanOrEqual(3600);
});

test('lowest, average and highest are those of the span before the last reading', () => {
  const history = new TemperatureHistory();
  for (const [at, temperature] of [
    [0, 500],
    [10, 20],
    [11, 40],
    [12, 30],
  ] as const)
    history.take(seconds(at), [heater('extruder', temperature)]);
  expect(history.statistics('extruder', seconds(5))).toEqual({ lowest: 20, highest: 40, average: 30 });
  expect(history.statistics('extruder', seconds(100))?.highest).toBe(500);
  expect(history.statistics('heater_bed', seconds(5))).toBeNull();
});
