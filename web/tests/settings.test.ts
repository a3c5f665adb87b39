// What was stored is not trusted.
import { expect, test } from 'vitest';
import { DEFAULTS, readSettings } from '../src/state/settings';

test.each([
  null,
  '',
  'nonsense',
  '[]',
  'null',
  '42',
  '{"theme":"loud","baud":"fast","speed":-3,"presets":7}',
])('%j gives the defaults', (text) => {
  expect(readSettings(text)).toEqual(DEFAULTS);
});

test('what fits is kept, one by one', () => {
  const text = JSON.stringify({
    theme: 'dark',
    baud: 115_200,
    speed: 1e9,
    jogStep: 1,
    presets: [{ name: 'TPU', nozzle: 230, bed: 9999 }, { bed: 1 }],
  });
  const settings = readSettings(text);
  expect(settings).toMatchObject({ theme: 'dark', baud: 115_200, speed: DEFAULTS.speed, jogStep: 1 });
  expect(settings.presets).toEqual([{ name: 'TPU', nozzle: 230, bed: 0 }]);
});

test('settings come back as they went', () => {
  expect(readSettings(JSON.stringify(DEFAULTS))).toEqual(DEFAULTS);
});
