// What the user has to confirm before a file is printed: lines that are not known and are left out, a command at a time.
import { computed } from '@preact/signals';
import type { ConfirmedLines } from '../machine/protocol';
import type { Remark } from '../preview/protocol';
import { confirmed, summary } from './preview';

/** As many lines as the check lists. */
const LISTED_MAX = 1000;
/** Stands among the confirmed lines for those that are not listed. */
const REST = -1;

/** Lines about which the same is to be said. */
export interface Group {
  readonly text: string;
  readonly lines: readonly number[];
}

export function groupsOf(remarks: readonly Remark[]): Group[] {
  const byText = new Map<string, number[]>();
  for (const { line, text } of remarks) {
    const lines = byText.get(text);
    if (lines) lines.push(line);
    else byText.set(text, [line]);
  }
  return [...byText].map(([text, lines]) => ({ text, lines }));
}

export const groups = computed(() => groupsOf(summary.value?.blocking ?? []));

/** Lines beyond those listed, which may hold commands that no group shows; null where all are listed. */
export const rest = computed<Group | null>(() => {
  const found = summary.value;
  if (!found || found.blocking.length < LISTED_MAX || found.dropped === 0) return null;
  return { text: 'Not all such lines are listed. Leave out everything that is not known.', lines: [REST] };
});

export const isConfirmed = ({ lines }: Group): boolean => lines.every((line) => confirmed.value.has(line));

/** What still has to be confirmed. */
export const unconfirmed = computed(() =>
  [...groups.value, ...(rest.value ? [rest.value] : [])].filter((group) => !isConfirmed(group)),
);

export function confirmGroup({ lines }: Group, yes: boolean): void {
  const all = new Set(confirmed.value);
  for (const line of lines) {
    if (yes) all.add(line);
    else all.delete(line);
  }
  confirmed.value = all;
}

/** Confirms what had been confirmed for the same file before. */
export function confirmAgain(lines: ConfirmedLines): void {
  if (lines !== 'all') confirmed.value = new Set([...confirmed.value, ...lines]);
  else for (const group of unconfirmed.value) confirmGroup(group, true);
}

/** What is printed without. */
export const consent = computed<ConfirmedLines>(() =>
  rest.value && unconfirmed.value.length === 0 ? 'all' : [...confirmed.value].filter((line) => line !== REST),
);
