// Stalls and errors of the line are told quietly, counted all, and kept within bounds.
import { beforeEach, expect, test, vi } from 'vitest';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';

let incidents: typeof import('../src/state/incidents');
let lines: typeof import('../src/state/line_errors');
let log: typeof import('../src/state/log');
let notices: typeof import('../src/state/notices');

beforeEach(async () => {
  vi.resetModules();
  incidents = await import('../src/state/incidents');
  lines = await import('../src/state/line_errors');
  log = await import('../src/state/log');
  notices = await import('../src/state/notices');
});

test('many stalls are all counted, some kept, and one notice told', () => {
  for (let at = 1; at <= 500; at += 1) incidents.stalled(seconds(1 + at / 100), at % 2 === 0);
  const { count, longest, kept } = incidents.incidents.value;
  expect([count, longest, kept.length]).toEqual([500, 6, 50]);
  expect(kept.at(-1)).toMatchObject({ seconds: 6, isPrinting: true });
  expect(notices.notices.value).toHaveLength(1);
  expect(notices.notices.value[0]?.text).toMatch(/6\.0 s .*So far 500 times, at most 6\.0 s\./);
  expect(log.entries.value.at(-1)?.text).toContain('6.0 s during a print');
});

test('errors of the line are noted with their kinds, now and then', () => {
  vi.useFakeTimers({ toFake: ['performance'] });
  const noted = (): string[] => log.entries.value.map(({ text }) => text);
  lines.noteLineErrors(NO_LINE_ERRORS);
  expect(noted()).toEqual([]);
  lines.noteLineErrors({ ...NO_LINE_ERRORS, framing: 1 });
  for (let framing = 2; framing < 500; framing += 1)
    lines.noteLineErrors({ ...NO_LINE_ERRORS, framing, parity: 1 });
  expect(noted()).toEqual(['On the line so far: 1 framing error. What was lost was sent again.']);
  vi.advanceTimersByTime(10_000);
  lines.noteLineErrors({ ...NO_LINE_ERRORS, framing: 499, overrun: 2 });
  expect(noted().at(-1)).toContain('499 framing errors, 2 overruns');
  // Nothing new, however long it takes.
  vi.advanceTimersByTime(60_000);
  lines.noteLineErrors({ ...NO_LINE_ERRORS, framing: 499, overrun: 2 });
  expect(noted()).toHaveLength(2);
  lines.forgetLineErrors();
  lines.noteLineErrors({ ...NO_LINE_ERRORS, break: 1 });
  expect(noted()).toHaveLength(3);
  vi.useRealTimers();
});

test('a notice takes the place of the last one of its kind', () => {
  notices.notify({ kind: 'a', text: 'one' });
  notices.notify({ kind: 'b', text: 'other' });
  notices.notify({ kind: 'a', text: 'two' });
  expect(notices.notices.value.map(({ text }) => text)).toEqual(['two', 'other']);
  notices.withdraw('a');
  notices.withdraw('a');
  expect(notices.notices.value.map(({ kind }) => kind)).toEqual(['b']);
});
