// The emergency stop: acts at once, without a question. In the bar, and in the head of every dialog that may be open
// while a printer is connected, since what lies behind a dialog cannot be reached.
import type { JSX } from 'preact';
import { connection, emergencyStop, plannerLoaded } from '../state/machine';
import { isViewing, stopAllWatched, watched } from '../state/watched';
import { Icon } from './icons';
import { Dialog, type DialogProps } from './parts';
import { TroubleInDialog } from './trouble_banner';

const STOPS = 'Stops the motors and switches the heaters off, at once';

function meaning(isOff: boolean): string {
  if (isOff) return 'Nothing is connected';
  if (!isViewing.value) return STOPS;
  return `${STOPS}: ${watched.value.map(({ view }) => view.name).join(', ')}, in another tab`;
}

/** Without a machine of this tab's own it stops those of the other tabs. */
export function EmergencyStop(): JSX.Element {
  const isOff = !isViewing.value && (connection.value === 'closed' || !plannerLoaded.value);
  return (
    <button
      type="button"
      class="emergency"
      aria-label="Emergency stop"
      title={meaning(isOff)}
      onClick={() => (isViewing.value ? stopAllWatched() : void emergencyStop())}
      disabled={isOff}
    >
      <Icon name="stop" />
      <span aria-hidden="true">
        Emergency<span class="emergency-more"> stop</span>
      </span>
    </button>
  );
}

/** A dialog that leaves the emergency stop within reach, and tells what goes wrong meanwhile. */
export function PanelDialog(props: Omit<DialogProps, 'aside'>): JSX.Element {
  return (
    <Dialog {...props} aside={connection.value === 'closed' && !isViewing.value ? null : <EmergencyStop />}>
      <TroubleInDialog />
      {props.children}
    </Dialog>
  );
}
