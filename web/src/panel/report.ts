// The diagnostic report: everything that somebody who helps would ask for, as text.
import { effect } from '@preact/signals';
import type { Snapshot } from '../machine/protocol';
import { incidents } from '../state/incidents';
import { entries } from '../state/log';
import { connection, firmware, port, snapshot, trouble, virtualRecord } from '../state/machine';
import { file, summary } from '../state/preview';
import { activeProfile } from '../state/profiles';

/** The machine when it was last seen: after a connection that broke, that is what one wants to know. */
let last: Snapshot | null = null;
effect(() => {
  last = snapshot.value ?? last;
});

const section = (title: string, content: unknown): string =>
  `== ${title}\n${typeof content === 'string' ? content : JSON.stringify(content, null, 2)}\n`;

export function diagnosticReport(): string {
  const found = summary.value;
  const job = file.value && {
    name: file.value.name,
    bytes: file.value.blob.size,
    lines: found?.lines,
    errors: found?.errors,
    blocking: found?.blocking.length,
    generator: found?.generator,
  };
  const log = entries.value.map(({ at, kind, text }) => `${at.toISOString()} ${kind.padEnd(7)} ${text}`);
  return [
    section(
      'Stepcast report',
      `${new Date().toISOString()}\n${navigator.userAgent}\nWeb Serial: ${'serial' in navigator}`,
    ),
    section('Connection', {
      state: connection.value,
      port: port.value,
      firmware: firmware.value,
      trouble: trouble.value,
    }),
    section(snapshot.value ? 'Machine now' : 'Machine when last seen', last),
    section('Stalls', incidents.value),
    section("Virtual printer's own record", virtualRecord.value),
    section('File', job),
    section('Messages', log.join('\n')),
    section(`printer.cfg (${activeProfile.value.name})`, activeProfile.value.config),
  ].join('\n');
}
