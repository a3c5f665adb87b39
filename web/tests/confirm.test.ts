// Lines that are not known are confirmed a command at a time.
import { beforeEach, expect, test } from 'vitest';
import type { Remark, Summary } from '../src/preview/protocol';
import { confirmGroup, consent, groups, rest, unconfirmed } from '../src/state/confirm';
import { confirmed, summary } from '../src/state/preview';
import { summaryOf } from './fake_summary';

const remark = (line: number, text: string): Remark => ({ line, text, severity: 'blocking' });
const found = (blocking: readonly Remark[], dropped = 0): Summary => summaryOf({ blocking, dropped });

beforeEach(() => {
  confirmed.value = new Set();
});

test('the same command in many lines is one thing to confirm, and can be taken back', () => {
  summary.value = found([remark(3, 'A'), remark(5, 'B'), remark(900, 'A')]);
  expect(groups.value.map(({ lines }) => lines)).toEqual([[3, 900], [5]]);
  for (const group of groups.value) confirmGroup(group, true);
  expect(unconfirmed.value).toEqual([]);
  expect(consent.value).toEqual([3, 900, 5]);
  confirmGroup({ text: 'A', lines: [3, 900] }, false);
  expect(unconfirmed.value.map(({ text }) => text)).toEqual(['A']);
  expect(consent.value).toEqual([5]);
});

test('lines beyond those listed take a word of their own, and only then all is left out', () => {
  const lines = Array.from({ length: 1000 }, (_, at) => remark(at + 1, 'A'));
  summary.value = found(lines);
  expect(rest.value).toBeNull();
  summary.value = found(lines, 1);
  for (const group of groups.value) confirmGroup(group, true);
  expect(unconfirmed.value).toEqual([rest.value]);
  expect(consent.value).toHaveLength(1000);
  if (rest.value) confirmGroup(rest.value, true);
  expect(consent.value).toBe('all');
});
