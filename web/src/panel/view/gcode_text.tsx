// The file's text beside the 3D view: any number of lines, of which those that are seen are there. It scrolls to what is
// chosen, played or printed; a line that is chosen here is shown there.
import { useSignal } from '@preact/signals';
import type { JSX, RefObject } from 'preact';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { lineText, textVersion, wantLines } from '../../state/file_text';
import { lineInView } from '../../state/inspect';
import { stop } from '../../state/playback';
import { isTextSlow, linesRead, outline } from '../../state/preview';
import { isShown, progress } from '../../state/print';
import { chooseLine, cursor } from '../../state/view';
import { formatNumber } from '../numbers';
import { NumberField } from '../parts';
import { movedByKey } from './range_slider';
import { clampTop, contentPx, isScaled, type Rows, scrollAt, seen, topAt, topToSee } from './virtual_rows';

const ROW_PX = 20;
/** Closer than that a bar stands where it was put. */
const SAME_PX = 1.5;

interface Scroll {
  readonly place: RefObject<HTMLDivElement | null>;
  readonly rows: Rows;
  /** The row at the top, and part of one. */
  readonly top: number;
  readonly go: (top: number) => void;
  readonly onScroll: () => void;
}

function useRows(count: number): Scroll {
  const place = useRef<HTMLDivElement>(null);
  const top = useSignal(0);
  const viewPx = useSignal(400);
  const rows: Rows = { count, rowPx: ROW_PX, viewPx: viewPx.value };
  useEffect(() => {
    const element = place.current;
    if (!element) return;
    const observer = new ResizeObserver(() => {
      viewPx.value = element.clientHeight;
    });
    observer.observe(element);
    return () => observer.disconnect();
  }, [viewPx]);
  const go = (wanted: number): void => {
    const element = place.current;
    top.value = clampTop(rows, wanted);
    if (element) element.scrollTop = scrollAt(rows, top.value);
  };
  const onScroll = (): void => {
    const element = place.current;
    // Where we put it ourselves, its pixels say less than we know.
    if (!element || Math.abs(element.scrollTop - scrollAt(rows, top.value)) < SAME_PX) return;
    top.value = topAt(rows, element.scrollTop);
  };
  return { place, rows, top: Math.min(top.value, Math.max(0, count - 1)), go, onScroll };
}

/** Where the bar stands for more rows than its pixels, a notch of the wheel still means so many rows. */
function useWheel({ place, rows, top, go }: Scroll): void {
  const latest = useRef({ rows, top, go });
  latest.current = { rows, top, go };
  useEffect(() => {
    const element = place.current;
    if (!element) return;
    const onWheel = (event: WheelEvent): void => {
      const now = latest.current;
      if (!isScaled(now.rows) || event.ctrlKey) return;
      event.preventDefault();
      const px =
        event.deltaY * (event.deltaMode === 1 ? ROW_PX : event.deltaMode === 2 ? now.rows.viewPx : 1);
      now.go(now.top + px / ROW_PX);
    };
    element.addEventListener('wheel', onWheel, { passive: false });
    return () => element.removeEventListener('wheel', onWheel);
  }, [place]);
}

interface LineProps {
  readonly line: number;
  readonly y: number;
  readonly count: number;
  readonly isChosen: boolean;
  readonly isPrinted: boolean;
}

function Line({ line, y, count, isChosen, isPrinted }: LineProps): JSX.Element {
  const text = lineText(line);
  const comment = text?.indexOf(';') ?? -1;
  return (
    // biome-ignore lint/a11y/useKeyWithClickEvents: the list has the keys
    // biome-ignore lint/a11y/useFocusableInteractive: the list has the focus
    <div
      id={`gcode-line-${line}`}
      class={`gcode-line ${isChosen ? 'chosen' : ''} ${isPrinted ? 'printed' : ''}`}
      role="option"
      aria-selected={isChosen}
      aria-setsize={count}
      aria-posinset={line}
      style={{ transform: `translateY(${y}px)` }}
      onClick={() => {
        stop();
        chooseLine(line);
      }}
    >
      <span class="line-number">{line}</span>
      {text === undefined ? (
        <span class="dim">…</span>
      ) : (
        <>
          {comment < 0 ? text : text.slice(0, comment)}
          {comment >= 0 && <span class="dim">{text.slice(comment)}</span>}
        </>
      )}
    </div>
  );
}

/** The line whose motion is made, of a print of the file that is shown. */
const printedLine = (): number | null => (isShown.value ? (progress.value?.line ?? null) : null);

function onKey(event: KeyboardEvent, count: number, page: number): void {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const from = lineInView.peek() ?? 1;
  const isPage = event.key === 'PageUp' || event.key === 'PageDown';
  // Down the page is up in numbers.
  const turned: Record<string, string> = { ArrowUp: 'ArrowDown', ArrowDown: 'ArrowUp' };
  const to = isPage
    ? Math.min(Math.max(from + (event.key === 'PageDown' ? page : -page), 1), count)
    : movedByKey(turned[event.key] ?? event.key, from, 1, count);
  if (to === null || event.key === 'ArrowLeft' || event.key === 'ArrowRight') return;
  event.preventDefault();
  stop();
  chooseLine(to);
}

export function GcodeText(): JSX.Element {
  const count = linesRead.value;
  const scroll = useRows(count);
  const { place, rows, top, go, onScroll } = scroll;
  useWheel(scroll);
  textVersion.value;
  const chosen = lineInView.value;
  useLayoutEffect(() => {
    if (chosen !== null) go(topToSee(rows, top, chosen - 1));
  }, [chosen]);
  const { first, end } = seen(rows, top);
  useEffect(() => {
    if (end > first) wantLines(first + 1, end);
  }, [first, end, count]);
  const lines = Array.from({ length: Math.max(0, end - first) }, (_, at) => first + at + 1);
  const printed = printedLine();
  const active = chosen !== null && chosen > first && chosen <= end ? `gcode-line-${chosen}` : undefined;
  return (
    <section class="gcode" aria-label="G-code of the file">
      <header>
        <NumberField
          label={`Line (of ${formatNumber(count)})`}
          unit=""
          value={chosen ?? 1}
          min={1}
          max={Math.max(1, count)}
          disabled={!outline.value}
          onSet={(line) => chooseLine(Math.round(line))}
        />
        {isTextSlow.value && (
          <p class="hint" role="status">
            This file is packed and very large: lines take a while to come.
          </p>
        )}
      </header>
      <div
        ref={place}
        class="gcode-lines code"
        role="listbox"
        aria-label="G-code"
        aria-activedescendant={active}
        tabIndex={0}
        onScroll={onScroll}
        onKeyDown={(event) => onKey(event, count, Math.max(1, Math.floor(rows.viewPx / ROW_PX) - 1))}
      >
        <div class="gcode-seen">
          {lines.map((line) => (
            <Line
              key={line}
              line={line}
              y={(line - 1 - top) * ROW_PX}
              count={count}
              isChosen={line === chosen && cursor.value !== null}
              isPrinted={line === printed}
            />
          ))}
        </div>
        <div style={{ height: `${contentPx(rows)}px` }} />
      </div>
    </section>
  );
}
