// A trouble in its three parts, inside a dialog.
import type { JSX } from 'preact';
import type { Trouble } from '../machine/protocol';

export function Said({ of: { happened, safe, todo } }: { readonly of: Trouble }): JSX.Element {
  return (
    <div class="stack" role="alert">
      <p class="trouble-what">{happened}</p>
      <p>{safe}</p>
      <p>{todo}</p>
    </div>
  );
}
