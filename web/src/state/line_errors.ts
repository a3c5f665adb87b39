// Errors on the line that the browser reports and the link repairs: nothing to act on, so a line in the log now and then.
import { allLineErrors, type LineErrorKind, type LineErrors } from '../transport/transport';
import { note } from './log';

/** A line in the log at most this often, in ms: a noisy cable has hundreds of them. */
const NOTE_EVERY_MS = 10_000;

const WORDS: Record<LineErrorKind, readonly [string, string]> = {
  break: ['break', 'breaks'],
  framing: ['framing error', 'framing errors'],
  parity: ['parity error', 'parity errors'],
  overrun: ['overrun', 'overruns'],
  system: ['error of the system', 'errors of the system'],
};

let noted = 0;
let notedAt = Number.NEGATIVE_INFINITY;

/** A new connection begins. */
export function forgetLineErrors(): void {
  noted = 0;
  notedAt = Number.NEGATIVE_INFINITY;
}

export function lineErrorWords(errors: LineErrors): string {
  return (Object.keys(WORDS) as LineErrorKind[])
    .filter((kind) => errors[kind] > 0)
    .map((kind) => `${errors[kind]} ${WORDS[kind][errors[kind] === 1 ? 0 : 1]}`)
    .join(', ');
}

export function noteLineErrors(errors: LineErrors): void {
  const all = allLineErrors(errors);
  if (all <= noted || performance.now() - notedAt < NOTE_EVERY_MS) return;
  noted = all;
  notedAt = performance.now();
  note('info', `On the line so far: ${lineErrorWords(errors)}. What was lost was sent again.`);
}
