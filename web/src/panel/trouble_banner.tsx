// What went wrong, in three parts, with the action that comes next.
import type { JSX } from 'preact';
import { isShutdown, snapshot, trouble, wish } from '../state/machine';
import { Icon } from './icons';
import { Button } from './parts';

export function TroubleBanner(): JSX.Element | null {
  const current = trouble.value;
  return (
    <div role="alert" class="alert-place">
      {current && (
        <div class={`trouble ${isShutdown.value || snapshot.value?.phase === 'failed' ? 'severe' : ''}`}>
          <Icon name="warning" />
          <div class="trouble-text">
            <p class="trouble-what">{current.happened}</p>
            <p>{current.safe}</p>
            <p>{current.todo}</p>
          </div>
          <div class="trouble-actions">
            {isShutdown.value && (
              <Button kind="primary" onClick={() => void wish({ kind: 'firmware-restart' })}>
                Restart the board
              </Button>
            )}
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
