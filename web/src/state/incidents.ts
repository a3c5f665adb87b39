// Stalls of what drives the printer: the computer slept, or was very busy. Kept for the diagnostic report, told quietly.
// Bounded: the last ones are kept, all are counted. Times in s.
import { signal } from '@preact/signals';
import { dateFormat } from '../dates';
import type { Seconds } from '../units';
import { note } from './log';
import { notify } from './notices';

const KEPT_MAX = 50;

export interface Incident {
  readonly at: Date;
  readonly seconds: Seconds;
  readonly isPrinting: boolean;
}

export interface Incidents {
  readonly count: number;
  readonly longest: number;
  /** The last ones. */
  readonly kept: readonly Incident[];
}

export const incidents = signal<Incidents>({ count: 0, longest: 0, kept: [] });

const clock = dateFormat({
  hour: '2-digit',
  minute: '2-digit',
  second: '2-digit',
  hourCycle: 'h23',
});

/** What drives the printer stood still until now. */
export function stalled(seconds: Seconds, isPrinting: boolean): void {
  const { count, longest, kept } = incidents.value;
  const incident = { at: new Date(), seconds, isPrinting };
  const now = {
    count: count + 1,
    longest: Math.max(longest, seconds),
    kept: [...kept.slice(-(KEPT_MAX - 1)), incident],
  };
  incidents.value = now;
  const what = `What drives the printer was held up for ${seconds.toFixed(1)} s`;
  note('warning', `${what}${isPrinting ? ' during a print' : ''}.`);
  const others = now.count > 1 ? ` So far ${now.count} times, at most ${now.longest.toFixed(1)} s.` : '';
  notify({
    kind: 'stall',
    text: `${what} at ${clock(incident.at)}: the computer slept or was very busy.${others}`,
  });
}
