// A slider with two handles, lying or standing. By pointer the nearer handle follows; by keyboard each is a slider of its
// own. Knows whole numbers only, not what they mean.
import type { JSX } from 'preact';
import { useRef } from 'preact/hooks';

export interface RangeSliderProps {
  readonly min: number;
  readonly max: number;
  readonly from: number;
  readonly to: number;
  readonly fromLabel: string;
  readonly toLabel: string;
  /** A value in words, for those who do not see the handle. */
  readonly textOf: (value: number) => string;
  readonly isUpright?: boolean;
  readonly onSet: (from: number, to: number) => void;
}

/** A page is this part of the whole, but never less than ten. */
const PAGE_SHARE = 0.1;
const PAGE_MIN = 10;

export type Handle = 'from' | 'to';

const clamp = (value: number, min: number, max: number): number => Math.min(Math.max(value, min), max);

/** Where a key puts a handle; null for keys that mean nothing here. */
export function movedByKey(key: string, value: number, min: number, max: number): number | null {
  const page = Math.max(PAGE_MIN, Math.round((max - min) * PAGE_SHARE));
  switch (key) {
    case 'ArrowUp':
    case 'ArrowRight':
      return clamp(value + 1, min, max);
    case 'ArrowDown':
    case 'ArrowLeft':
      return clamp(value - 1, min, max);
    case 'PageUp':
      return clamp(value + page, min, max);
    case 'PageDown':
      return clamp(value - page, min, max);
    case 'Home':
      return min;
    case 'End':
      return max;
    default:
      return null;
  }
}

/** Both ends after one of them was moved: neither goes past the other. */
export const movedTo = (handle: Handle, value: number, from: number, to: number): [number, number] =>
  handle === 'from' ? [Math.min(value, to), to] : [from, Math.max(value, from)];

/** The handle that a press takes: the nearer one; where both stand in one place, the one that can go there. */
export function nearer(value: number, from: number, to: number): Handle {
  if (value >= to) return 'to';
  if (value <= from) return 'from';
  return value - from < to - value ? 'from' : 'to';
}

interface ThumbProps {
  readonly handle: Handle;
  readonly props: RangeSliderProps;
  readonly share: number;
}

function Thumb({ handle, props, share }: ThumbProps): JSX.Element {
  const { min, max, from, to, textOf, isUpright, onSet } = props;
  const value = handle === 'from' ? from : to;
  const [low, high] = handle === 'from' ? [min, to] : [from, max];
  return (
    <div
      class={`range-thumb ${handle}`}
      role="slider"
      tabIndex={0}
      aria-label={handle === 'from' ? props.fromLabel : props.toLabel}
      aria-orientation={isUpright ? 'vertical' : 'horizontal'}
      aria-valuemin={low}
      aria-valuemax={high}
      aria-valuenow={value}
      aria-valuetext={textOf(value)}
      data-handle={handle}
      style={{ [isUpright ? 'bottom' : 'left']: `${share * 100}%` }}
      onKeyDown={(event) => {
        if (event.ctrlKey || event.altKey || event.metaKey) return;
        const moved = movedByKey(event.key, value, low, high);
        if (moved === null) return;
        event.preventDefault();
        event.stopPropagation();
        if (moved !== value) onSet(...movedTo(handle, moved, from, to));
      }}
    />
  );
}

export function RangeSlider(props: RangeSliderProps): JSX.Element {
  const { min, max, from, to, isUpright, onSet } = props;
  const track = useRef<HTMLDivElement>(null);
  const held = useRef<Handle | null>(null);
  const span = Math.max(max - min, 1);
  const shareOf = (value: number): number => clamp((value - min) / span, 0, 1);

  const valueAt = (event: PointerEvent): number => {
    const box = track.current?.getBoundingClientRect();
    if (!box) return min;
    const share = isUpright
      ? (box.bottom - event.clientY) / Math.max(box.height, 1)
      : (event.clientX - box.left) / Math.max(box.width, 1);
    return clamp(Math.round(min + share * span), min, max);
  };
  const drag = (event: PointerEvent): void => {
    if (!held.current) return;
    const [nextFrom, nextTo] = movedTo(held.current, valueAt(event), from, to);
    if (nextFrom !== from || nextTo !== to) onSet(nextFrom, nextTo);
  };
  const [low, high] = [shareOf(from) * 100, shareOf(to) * 100];
  return (
    <div
      ref={track}
      class={`range-slider ${isUpright ? 'upright' : ''}`}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        const pressed = event.target instanceof HTMLElement ? event.target.dataset['handle'] : undefined;
        const isThumb = (pressed === 'from' || pressed === 'to') && from !== to;
        held.current = isThumb ? (pressed as Handle) : nearer(valueAt(event), from, to);
        event.currentTarget.setPointerCapture(event.pointerId);
        event.preventDefault();
        event.currentTarget.querySelector<HTMLElement>(`.range-thumb.${held.current}`)?.focus();
        if (!isThumb) drag(event);
      }}
      onPointerMove={drag}
      onPointerUp={() => {
        held.current = null;
      }}
      onPointerCancel={() => {
        held.current = null;
      }}
    >
      <div class="range-rail" />
      <div
        class="range-chosen"
        style={
          isUpright
            ? { bottom: `${low}%`, top: `${100 - high}%` }
            : { left: `${low}%`, right: `${100 - high}%` }
        }
      />
      <Thumb handle="from" props={props} share={shareOf(from)} />
      <Thumb handle="to" props={props} share={shareOf(to)} />
    </div>
  );
}
