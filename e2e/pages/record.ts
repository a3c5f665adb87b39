// The virtual printer's own record, as the diagnostic report gives it: what the motors did, whatever the page believes.
import { expect } from '@playwright/test';
import type { VirtualState } from '../../web/src/bindings/VirtualState.ts';

export type { VirtualState };

/** A part of a diagnostic report, by its title. */
export function sectionOf(report: string, title: string): string {
  const start = report.indexOf(`== ${title}`);
  expect(start, `the report has a part "${title}"`).toBeGreaterThanOrEqual(0);
  const body = report.slice(report.indexOf('\n', start) + 1);
  const end = body.indexOf('\n== ');
  return end < 0 ? body : body.slice(0, end);
}

export function recordOf(report: string): VirtualState {
  const record = JSON.parse(sectionOf(report, "Virtual printer's own record")) as VirtualState | null;
  if (!record) throw new Error('no virtual printer is connected');
  return record;
}

/** Pulses by motor. */
export const pulsesOf = (record: VirtualState): Record<string, number> =>
  Object.fromEntries(record.motors.map(({ name, pulses }) => [name, pulses]));

export function motor(record: VirtualState, name: string): VirtualState['motors'][number] {
  const found = record.motors.find((other) => other.name === name);
  if (!found) throw new Error(`the record has no motor ${name}`);
  return found;
}
