// The script of faults of the virtual printer: what is wrong with it as it is typed, so that nobody has to connect to
// find out. The virtual printer reads it by the same rules and has the last word.

const HEATERS = ['extruder', 'heater_bed'] as const;
const AXES = ['x', 'y', 'z'] as const;
/** Faults on bytes, with a probability. */
const BYTES = ['corrupt', 'drop', 'duplicate', 'delay'] as const;
const CABLE = ['unplug', 'replug', 'board-reset'] as const;
/** Faults that last for so many seconds. */
const LASTING = ['outage', 'power-loss'] as const;
const PARTS: Readonly<Record<string, readonly string[]>> = {
  'sensor-open': HEATERS,
  'sensor-short': HEATERS,
  'heater-dead': HEATERS,
  'heater-stuck-on': HEATERS,
  'endstop-stuck-on': AXES,
  'endstop-stuck-off': AXES,
};
const SECONDS_MAX = 1e9;
const NUMBER = /^\d+(\.\d*)?$|^\.\d+$/;

const isOne = (choices: readonly string[], word: string): boolean => choices.includes(word);
const listed = (words: readonly string[]): string => words.join(', ');

function problemOf(item: string): string | null {
  const [what = '', at, ...more] = item.split('@');
  const [name = '', value] = what.split(/=(.*)/s);
  if (more.length > 0) return 'has more than one @';
  if (at !== undefined && !(NUMBER.test(at.replace(/s$/, '')) && Number.parseFloat(at) <= SECONDS_MAX))
    return 'needs a number of seconds after @';
  if (isOne(BYTES, name)) {
    if (at !== undefined) return 'acts all the time and takes no @';
    return value !== undefined && NUMBER.test(value) && Number(value) <= 1
      ? null
      : `needs a probability from 0 to 1, as in ${name}=0.01`;
  }
  if (isOne(CABLE, name)) return value === undefined ? null : `takes no part, as in ${name}@60`;
  if (isOne(LASTING, name))
    return value !== undefined && NUMBER.test(value) && Number(value) <= SECONDS_MAX
      ? null
      : `needs a number of seconds that it lasts, as in ${name}=5@60`;
  const parts = PARTS[name];
  if (!parts)
    return `is not known; there are ${listed([...Object.keys(PARTS), ...CABLE, ...LASTING, ...BYTES])}`;
  return value !== undefined && parts.includes(value) ? null : `needs one of ${listed(parts)} after =`;
}

/** What is wrong with a script; null where it can be used, and where it is empty. */
export function faultProblem(script: string): string | null {
  if (script.trim() === '') return null;
  for (const item of script.split(',').map((part) => part.trim())) {
    if (item === '') return 'A comma has nothing after it or before it.';
    const problem = problemOf(item);
    if (problem !== null) return `“${item}” ${problem}.`;
  }
  return null;
}
