// The bar at the top: what is connected, the dialogs' buttons, and the emergency stop, apart from everything else.
import { computed } from '@preact/signals';
import type { JSX } from 'preact';
import type { JobStatus, Phase, PortChoice } from '../machine/protocol';
import { connection, disconnect, isPrinting, isStale, job, port, snapshot } from '../state/machine';
import { activeProfile } from '../state/profiles';
import { isViewing, watched } from '../state/watched';
import { openDialog } from './dialogs';
import { EmergencyStop } from './emergency';
import { Button } from './parts';
import { ask } from './question';

export interface Status {
  readonly text: string;
  readonly tone: 'off' | 'busy' | 'good' | 'bad';
}

const JOBS = {
  none: 'Ready',
  printing: 'Printing',
  pausing: 'Pausing',
  paused: 'Paused',
  ending: 'Ending the print',
  held: 'Held',
} as const;

/** How a machine is, in a word or two. */
export function statusOf(phase: Phase, job: JobStatus): Status {
  if (phase === 'ready') return { text: JOBS[job], tone: 'good' };
  if (phase === 'shutdown') return { text: 'Stopped', tone: 'bad' };
  if (phase === 'holding') return { text: 'Holding a print', tone: 'busy' };
  return phase === 'failed' ? { text: 'Failed', tone: 'bad' } : { text: 'Connecting', tone: 'busy' };
}

const status = computed<Status>(() => {
  const [other] = watched.value;
  if (other) {
    if (other.isStale) return { text: 'Viewer: not responding', tone: 'bad' };
    const { text, tone } = statusOf(other.view.snapshot.phase, other.view.snapshot.job);
    return { text: `Viewer: ${text.toLowerCase()}`, tone };
  }
  if (connection.value === 'closed') return { text: 'Not connected', tone: 'off' };
  if (isStale.value) return { text: 'Not responding', tone: 'bad' };
  const phase = snapshot.value?.phase;
  if (connection.value === 'opening' || phase === undefined) return { text: 'Connecting', tone: 'busy' };
  return statusOf(phase, job.value);
});

function end(): void {
  if (!isPrinting.value) return disconnect();
  ask({
    title: 'Disconnect while printing?',
    text:
      port.value?.kind === 'virtual'
        ? 'That ends the print: the virtual printer is gone with the connection.'
        : 'A board with Stepcast\u2019s firmware brings the head to rest and holds the print until you connect again and resume or cancel it. Any other board stops when its queue of moves is empty and switches the heaters off: there the print is lost.',
    yes: 'Disconnect',
    no: 'Go on printing',
    act: disconnect,
  });
}

const nameOf = (choice: PortChoice | null, profile: string): string =>
  choice?.kind === 'virtual' ? 'Virtual printer' : profile;

export function TopBar(): JSX.Element {
  const isClosed = connection.value === 'closed';
  const where = isViewing.value
    ? watched.value.map(({ view }) => nameOf(view.port, view.name)).join(', ')
    : nameOf(port.value, activeProfile.value.name);
  return (
    <header class="top-bar">
      <h1 class="brand">
        <img src="./icon.svg" alt="Stepcast" width="28" height="28" />
        <span aria-hidden="true">Stepcast</span>
      </h1>
      <p class={`status ${status.value.tone}`} role="status">
        <span class="dot" aria-hidden="true" />
        <span>{status.value.text}</span>
        {(!isClosed || isViewing.value) && <span class="status-where">{where}</span>}
      </p>
      <nav class="top-actions" aria-label="Page">
        {isClosed ? (
          <Button
            icon="plug"
            kind={isViewing.value ? 'plain' : 'primary'}
            onClick={() => (openDialog.value = 'connect')}
          >
            Connect
          </Button>
        ) : (
          <Button icon="plug" onClick={end}>
            Disconnect
          </Button>
        )}
        <Button icon="machine" kind="quiet" label="Machine" onClick={() => (openDialog.value = 'machine')} />
        <Button
          icon="settings"
          kind="quiet"
          label="Settings"
          onClick={() => (openDialog.value = 'settings')}
        />
      </nav>
      <EmergencyStop />
    </header>
  );
}
