// Why something cannot be asked of the printer now, in words for hints and titles; null where it can.
import { computed } from '@preact/signals';
import {
  connection,
  isHolding,
  isReady,
  isShutdown,
  mayMove,
  plannerFailed,
  plannerLoaded,
  snapshot,
} from '../state/machine';

/** Why nothing at all can be asked of a printer. */
export const notReady = computed<string | null>(() => {
  if (isReady.value) return null;
  if (plannerFailed.value) return 'The planner could not be loaded; reload the page.';
  if (!plannerLoaded.value) return 'The planner is still loading.';
  if (connection.value === 'closed') return 'Connect a printer first.';
  if (isHolding.value) return 'The board holds a print: decide about that first.';
  if (isShutdown.value) return 'The board has stopped: restart it first.';
  if (snapshot.value?.phase === 'failed') return 'The connection failed: disconnect, then connect again.';
  return 'The printer is being set up.';
});

/** Why the head cannot be moved by hand. */
export const notFree = computed<string | null>(
  () => notReady.value ?? (mayMove.value ? null : 'A print is running: pause it to move by hand.'),
);
