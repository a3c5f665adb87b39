// The script of faults, as it is typed.
import { expect, test } from 'vitest';
import { faultProblem } from '../src/panel/faults';

test.each([
  '',
  '  ',
  'corrupt=0.01',
  'drop=1',
  'sensor-open=extruder@30',
  'sensor-short=heater_bed',
  'unplug@5.5s, replug@6',
  'endstop-stuck-off=x',
  'heater-dead=extruder@.5,delay=0',
  'board-reset@7, outage=1.5@8, power-loss=60@90',
])('%j can be used', (script) => expect(faultProblem(script)).toBeNull());

test.each([
  ['sensor-open', 'extruder, heater_bed'],
  ['sensor-open=bed@3', 'extruder, heater_bed'],
  ['endstop-stuck-on=e', 'x, y, z'],
  ['corrupt', 'probability'],
  ['corrupt=1.5', 'probability'],
  ['corrupt=0.1@4', 'takes no @'],
  ['unplug@soon', 'seconds'],
  ['unplug@1@2', 'more than one @'],
  ['unplug=usb@1', 'takes no part'],
  ['unplug@-3', 'seconds'],
  ['meteor@3', 'not known'],
  ['power-loss@3', 'seconds that it lasts'],
  ['outage=long@3', 'seconds that it lasts'],
  ['board-reset=1@3', 'takes no part'],
  ['unplug@3,', 'comma'],
])('%j is refused: %s', (script, says) => expect(faultProblem(script)).toContain(says));
