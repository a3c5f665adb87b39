// The planner's errors in the page's words. Knows nothing of what was asked.
import type { PrinterError } from './bindings/PrinterError';
import type { Trouble } from './machine/protocol';

export const inWords = (error: PrinterError): Trouble => ({
  code: error.code,
  line: error.line,
  happened: error.what_happened,
  safe: error.what_is_safe,
  todo: error.what_to_do,
});

/** Errors are thrown with the catalogue's entry as JSON in their message. */
export function plannerTrouble(error: unknown): Trouble | null {
  const text = error instanceof Error ? error.message : typeof error === 'string' ? error : '';
  try {
    const entry = JSON.parse(text) as PrinterError;
    return typeof entry.code === 'string' ? inWords(entry) : null;
  } catch {
    return null;
  }
}
