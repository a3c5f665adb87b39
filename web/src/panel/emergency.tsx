// The emergency stop: acts at once, without a question. In the bar, and in the head of every dialog that may be open
// while a printer is connected, since what lies behind a dialog cannot be reached.
import type { JSX } from 'preact';
import { connection, emergencyStop, plannerLoaded } from '../state/machine';
import { Icon } from './icons';
import { Dialog, type DialogProps } from './parts';
import { TroubleInDialog } from './trouble_banner';

export function EmergencyStop(): JSX.Element {
  const isOff = connection.value === 'closed' || !plannerLoaded.value;
  return (
    <button
      type="button"
      class="emergency"
      aria-label="Emergency stop"
      title={isOff ? 'Nothing is connected' : 'Stops the motors and switches the heaters off, at once'}
      onClick={() => void emergencyStop()}
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
    <Dialog {...props} aside={connection.value === 'closed' ? null : <EmergencyStop />}>
      <TroubleInDialog />
      {props.children}
    </Dialog>
  );
}
