// Prints that outlived their page: those that were interrupted, and the one that the board holds. What they are is told by
// the machine worker. Knows no panel.
import { signal } from '@preact/signals';
import type { HeldPrint, KeptPrint } from '../machine/protocol';

/** Prints that were interrupted, the newest first. */
export const keptPrints = signal<readonly KeptPrint[]>([]);
/** What there is to be decided about the print that the board holds; null where there is nothing. */
export const heldPrint = signal<HeldPrint | null>(null);
