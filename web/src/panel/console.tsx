// The console: what happened, and a line to type G-code into, with a history.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { dateFormat } from '../dates';
import { entries } from '../state/log';
import { gcode, mayMove } from '../state/machine';
import { Button, Card } from './parts';
import { notFree } from './reasons';

const HISTORY_MAX = 50;
const history: string[] = [];

const time = dateFormat({
  hour: '2-digit',
  minute: '2-digit',
  second: '2-digit',
  hourCycle: 'h23',
});
/** Somebody who is this near the end, in px, reads what comes. */
const NEAR_END_PX = 24;

function Log(): JSX.Element {
  const ref = useRef<HTMLOListElement>(null);
  const follows = useRef(true);
  const lastTop = useRef(0);
  const last = entries.value.at(-1)?.id;
  // Follows what is new, unless the user has scrolled up to read.
  useEffect(() => {
    const list = ref.current;
    if (last !== undefined && list && follows.current) list.scrollTop = list.scrollHeight;
  }, [last]);
  return (
    <ol
      class="log"
      ref={ref}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: what scrolls must be reached by keyboard
      tabIndex={0}
      aria-label="Messages"
      onScroll={({ currentTarget: { scrollHeight, scrollTop, clientHeight } }) => {
        // What comes meanwhile also makes the end farther away: only going up says that somebody reads.
        if (scrollTop < lastTop.current) follows.current = false;
        if (scrollHeight - scrollTop - clientHeight < NEAR_END_PX) follows.current = true;
        lastTop.current = scrollTop;
      }}
    >
      {entries.value.length === 0 && <li class="dim">What happens is noted here.</li>}
      {entries.value.map((entry) => (
        <li key={entry.id} class={entry.kind}>
          <time dateTime={entry.at.toISOString()}>{time(entry.at)}</time>
          <span>{entry.text}</span>
        </li>
      ))}
    </ol>
  );
}

export function Console(): JSX.Element {
  const [text, setText] = useState('');
  const [place, setPlace] = useState(0);
  const submit = (): void => {
    const line = text.trim();
    if (line === '' || !mayMove.value) return;
    if (history.at(-1) !== line) history.push(line);
    if (history.length > HISTORY_MAX) history.shift();
    setText('');
    setPlace(0);
    void gcode(line);
  };
  const recall = (steps: number): void => {
    const next = Math.min(Math.max(place + steps, 0), history.length);
    setPlace(next);
    setText(next === 0 ? '' : (history.at(-next) ?? ''));
  };
  return (
    <Card title="Console">
      <Log />
      <form
        class="row"
        onSubmit={(event) => {
          event.preventDefault();
          submit();
        }}
      >
        <input
          class="grow code"
          type="text"
          aria-label="G-code to send"
          placeholder={notFree.value ?? 'G-code, e.g. G28 X'}
          title={notFree.value ?? undefined}
          autocomplete="off"
          autocapitalize="characters"
          spellcheck={false}
          maxLength={1000}
          value={text}
          disabled={!mayMove.value}
          onInput={(event) => setText(event.currentTarget.value)}
          onKeyDown={(event) => {
            if (event.key !== 'ArrowUp' && event.key !== 'ArrowDown') return;
            event.preventDefault();
            recall(event.key === 'ArrowUp' ? 1 : -1);
          }}
        />
        <Button why={notFree.value} disabled={text.trim() === ''} onClick={submit}>
          Send
        </Button>
      </form>
    </Card>
  );
}
