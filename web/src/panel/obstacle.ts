// Why the file that is shown cannot be printed now, in words; null where it can.
import { computed } from '@preact/signals';
import { unconfirmed } from '../state/confirm';
import { connection, isReady } from '../state/machine';
import { failure, file, outline, reading, summary } from '../state/preview';
import { machineSummary } from './machine_summary';
import { notReady } from './reasons';

export const obstacle = computed<string | null>(() => {
  if (!file.value) return null;
  // What has to be confirmed, and what cannot be printed at all, is known only behind the planner's pass.
  if (reading.value !== null)
    return outline.value
      ? 'The file is in view; the planner is still checking that this machine can print it.'
      : 'The file is still being read.';
  if (failure.value || !summary.value) return 'The file could not be read.';
  if (summary.value.errors.length > 0) return 'The file cannot be printed on this machine: see below.';
  if (!machineSummary.value) return 'The machine file has errors: mend it under Machine.';
  if (connection.value === 'closed') return 'Connect a printer to print.';
  if (!isReady.value) return notReady.value;
  const open = unconfirmed.value.length;
  if (open > 0)
    return open === 1
      ? 'A command has to be confirmed first: see below.'
      : `${open} commands have to be confirmed first: see below.`;
  return null;
});
