// What happened, in words, for the console and the diagnostic report. Bounded: the oldest entries go first.
import { signal } from '@preact/signals';

export type EntryKind = 'sent' | 'info' | 'warning' | 'error';

export interface Entry {
  readonly id: number;
  readonly at: Date;
  readonly kind: EntryKind;
  readonly text: string;
}

const ENTRIES_MAX = 500;

export const entries = signal<readonly Entry[]>([]);
let count = 0;

export function note(kind: EntryKind, text: string): void {
  count += 1;
  entries.value = [...entries.value.slice(-(ENTRIES_MAX - 1)), { id: count, at: new Date(), kind, text }];
}
