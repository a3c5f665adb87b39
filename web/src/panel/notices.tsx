// Quiet words that can wait, below what went wrong.
import type { JSX } from 'preact';
import { type Notice, notices, withdraw } from '../state/notices';
import { Button } from './parts';

function Line({ notice }: { readonly notice: Notice }): JSX.Element {
  const { kind, text, action, other, isFixed, onClosed } = notice;
  return (
    <li class="notice">
      <span class="grow">{text}</span>
      {action && (
        <Button why={action.why} onClick={action.act}>
          {action.text}
        </Button>
      )}
      {other && <Button onClick={other.act}>{other.text}</Button>}
      {!isFixed && (
        <Button
          icon="close"
          kind="quiet"
          label="Put this notice away"
          onClick={() => {
            withdraw(kind);
            onClosed?.();
          }}
        />
      )}
    </li>
  );
}

export function Notices(): JSX.Element {
  return (
    <div role="status" class="notice-place" aria-label="Notices">
      {notices.value.length > 0 && (
        <ul>
          {notices.value.map((notice) => (
            <Line key={notice.kind} notice={notice} />
          ))}
        </ul>
      )}
    </div>
  );
}
