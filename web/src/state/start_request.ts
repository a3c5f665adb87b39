// The question where a print is to begin: for the file that is shown, or for an interrupted print whose board has
// forgotten it. Finds that print's file and shows it. Begins nothing and moves nothing.
import { effect, signal, untracked } from '@preact/signals';
import type { Interruption, KeptFile, KeptPrint, Trouble } from '../machine/protocol';
import { confirmAgain } from './confirm';
import { keptFile } from './machine';
import { file, openFile, summary } from './preview';

export type StartRequest =
  /** For the file that is shown; `line` is what is proposed. */
  | { readonly kind: 'shown'; readonly blob: Blob; readonly line: number }
  /** The copy of the interrupted print's file is looked for, or what the user gave is compared with it. */
  | { readonly kind: 'looking'; readonly lost: KeptPrint }
  /** The user has to give it; `trouble` says why what was given, or is kept, will not do. */
  | { readonly kind: 'needs-file'; readonly lost: KeptPrint; readonly trouble: Trouble | null }
  /** It is what is shown; `trouble` says why its place in it could not be found, where that is so. */
  | {
      readonly kind: 'lost';
      readonly lost: KeptPrint;
      readonly blob: Blob;
      readonly at: Interruption | null;
      readonly trouble: Trouble | null;
    };

/** Null: nothing is asked. */
export const startRequest = signal<StartRequest | null>(null);

export function askWhereToBegin(line: number): void {
  const open = file.peek();
  if (open) startRequest.value = { kind: 'shown', blob: open.blob, line };
}

/** Asks for an interrupted print; with its kept file, or one from the user. */
export async function askToContinue(lost: KeptPrint, given: Blob | null = null): Promise<void> {
  const looking: StartRequest = { kind: 'looking', lost };
  startRequest.value = looking;
  const found: KeptFile = await keptFile(lost.id, given);
  // Put away meanwhile.
  if (startRequest.peek() !== looking) return;
  if (found.kind === 'missing') startRequest.value = { kind: 'needs-file', lost, trouble: found.trouble };
  else {
    openFile(found.file, lost.facts.name);
    startRequest.value = { kind: 'lost', lost, blob: found.file, at: found.at, trouble: found.trouble };
  }
}

/** What the user had left out of an interrupted print stays left out; and a question about a file ends with it. */
export function followStartRequest(): void {
  effect(() => {
    const request = startRequest.value;
    if (request?.kind !== 'shown' && request?.kind !== 'lost') return;
    if (file.value?.blob !== request.blob) startRequest.value = null;
    else if (request.kind === 'lost' && summary.value)
      untracked(() => confirmAgain(request.lost.confirmedLines));
  });
}
