// The diagnostic report: everything that somebody who helps would ask for, as text.
import { entries } from '../state/log';
import { connection, firmware, port, snapshot, trouble, virtualRecord } from '../state/machine';
import { file, summary } from '../state/preview';
import { activeProfile } from '../state/profiles';

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
    section('Machine now', snapshot.value),
    section("Virtual printer's own record", virtualRecord.value),
    section('File', job),
    section('Messages', log.join('\n')),
    section(`printer.cfg (${activeProfile.value.name})`, activeProfile.value.config),
  ].join('\n');
}
