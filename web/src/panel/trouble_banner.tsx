// What went wrong, in three parts, with the action that comes next.
import type { JSX } from 'preact';
import type { Trouble } from '../machine/protocol';
import { connection, isShutdown, snapshot, trouble, wish } from '../state/machine';
import { mayReconnect, reconnect } from '../state/reconnect';
import { openDialog } from './dialogs';
import { Icon } from './icons';
import { Button } from './parts';

/** Troubles after which connecting from this tab is the way on. */
const CONNECTABLE = new Set(['driver-gone']);

function Restart(): JSX.Element | null {
  if (!isShutdown.value) return null;
  return (
    <Button kind="primary" onClick={() => void wish({ kind: 'firmware-restart' })}>
      Restart the board
    </Button>
  );
}

/** What may be done about it here and now; nothing of it happens by itself. */
function WayOn({ of: { code } }: { readonly of: Trouble }): JSX.Element | null {
  if (mayReconnect.value)
    return (
      <Button kind="primary" onClick={reconnect}>
        Reconnect
      </Button>
    );
  if (connection.value !== 'closed' || !CONNECTABLE.has(code)) return null;
  return (
    <Button kind="primary" onClick={() => (openDialog.value = 'connect')}>
      Connect here
    </Button>
  );
}

/** The same in a line: of a board that has stopped after its message was put away, and inside dialogs. */
function Short({ text }: { readonly text: string }): JSX.Element {
  return (
    <div class={`trouble short ${isShutdown.value ? 'severe' : ''}`}>
      <Icon name="warning" />
      <p class="trouble-text trouble-what">{text}</p>
      <Restart />
    </div>
  );
}

const STOPPED = 'The board has stopped.';

/** What lies behind a dialog is not read and cannot be reached: the trouble is told in it, too. */
export function TroubleInDialog(): JSX.Element {
  const text = trouble.value?.happened ?? (isShutdown.value ? STOPPED : null);
  return (
    <div role="alert" class="alert-place">
      {text !== null && <Short text={text} />}
    </div>
  );
}

export function TroubleBanner(): JSX.Element | null {
  const current = trouble.value;
  return (
    <div role="alert" class="alert-place">
      {!current && isShutdown.value && <Short text={STOPPED} />}
      {current && (
        <div class={`trouble ${isShutdown.value || snapshot.value?.phase === 'failed' ? 'severe' : ''}`}>
          <Icon name="warning" />
          <div class="trouble-text">
            <p class="trouble-what">{current.happened}</p>
            <p>{current.safe}</p>
            <p>{current.todo}</p>
            {mayReconnect.value && <p>The device is there again.</p>}
          </div>
          <div class="trouble-actions">
            <Restart />
            <WayOn of={current} />
            <Button
              icon="close"
              kind="quiet"
              label="Put this message away"
              onClick={() => (trouble.value = null)}
            />
          </div>
        </div>
      )}
    </div>
  );
}
