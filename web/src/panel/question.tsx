// A question before something that cannot be taken back. In the page, not the browser's own: that one would stop the
// page, the emergency stop with it.
import { signal } from '@preact/signals';
import type { JSX } from 'preact';
import { useRef } from 'preact/hooks';
import { PanelDialog } from './emergency';
import { Button } from './parts';

interface Question {
  readonly title: string;
  readonly text: string;
  /** What the buttons say. */
  readonly yes: string;
  readonly no: string;
  readonly act: () => void;
}

const question = signal<Question | null>(null);

export function ask(asked: Question): void {
  question.value = asked;
}

/** Shows the question that is asked. */
export function Asked(): JSX.Element | null {
  const asked = question.value;
  const safe = useRef<HTMLButtonElement>(null);
  if (!asked) return null;
  const close = (): void => {
    if (question.value === asked) question.value = null;
  };
  return (
    <PanelDialog key={asked.title} title={asked.title} onClose={close} first={safe}>
      <div class="stack">
        <p>{asked.text}</p>
        <div class="dialog-foot">
          <Button class="big" place={safe} onClick={close}>
            {asked.no}
          </Button>
          <Button
            kind="danger"
            class="big"
            onClick={() => {
              close();
              asked.act();
            }}
          >
            {asked.yes}
          </Button>
        </div>
      </div>
    </PanelDialog>
  );
}
