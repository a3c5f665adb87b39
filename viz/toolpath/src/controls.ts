/**
 * Pointer, wheel and keys on an element, as the view's movements.
 *
 * One finger or the main button orbits; two fingers, the other buttons or Shift pan; wheel and pinch zoom to the pointer;
 * arrow keys orbit (with Shift pan), + and − zoom, Home fits. Does not know: what moves. Units: CSS pixels.
 */
import type { CssPx } from './units';

/** What is moved; ToolpathView and ToolpathHost are such. */
export interface Movable {
  orbit(dx: CssPx, dy: CssPx): void;
  pan(dx: CssPx, dy: CssPx): void;
  zoom(factor: number, at?: readonly [CssPx, CssPx]): void;
  fit(): void;
}

const KEY_STEP_PX = 24;
const KEY_ZOOM = 1.15;
/** A wheel's notch of 100 px zooms by about a seventh. */
const ZOOM_PER_PX = 0.0014;
const WHEEL_PX_MAX = 240;
const PX_PER_LINE = 33;
const PX_PER_PAGE = 400;

/** The factor of one wheel event. */
export function wheelFactor(delta: number, mode: number): number {
  const px = delta * (mode === 1 ? PX_PER_LINE : mode === 2 ? PX_PER_PAGE : 1);
  return Math.exp(Math.min(Math.max(px, -WHEEL_PX_MAX), WHEEL_PX_MAX) * ZOOM_PER_PX);
}

/** Carries out a key; false if it means nothing here. */
export function moveByKey(view: Movable, key: string, shift: boolean): boolean {
  const turn = (dx: number, dy: number): void => (shift ? view.pan(-dx, -dy) : view.orbit(dx, dy));
  switch (key) {
    case 'ArrowLeft':
      turn(KEY_STEP_PX, 0);
      return true;
    case 'ArrowRight':
      turn(-KEY_STEP_PX, 0);
      return true;
    case 'ArrowUp':
      turn(0, KEY_STEP_PX);
      return true;
    case 'ArrowDown':
      turn(0, -KEY_STEP_PX);
      return true;
    case '+':
    case '=':
      view.zoom(1 / KEY_ZOOM);
      return true;
    case '-':
      view.zoom(KEY_ZOOM);
      return true;
    case 'Home':
      view.fit();
      return true;
    default:
      return false;
  }
}

interface Finger {
  x: number;
  y: number;
}

const middle = (a: Finger, b: Finger): Finger => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
const apart = (a: Finger, b: Finger): number => Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1);

/** Listens on `element` (which should be focusable); returns what undoes it. */
export function attachControls(element: HTMLElement, view: Movable): () => void {
  const fingers = new Map<number, Finger>();
  const stop = new AbortController();
  const options = { signal: stop.signal };
  const fromMiddle = (at: Finger): [number, number] => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return [at.x - left - width / 2, at.y - top - height / 2];
  };

  const moveTwo = (moved: Finger, other: Finger, now: Finger): void => {
    const [from, to] = [middle(moved, other), middle(now, other)];
    view.pan(to.x - from.x, to.y - from.y);
    view.zoom(apart(moved, other) / apart(now, other), fromMiddle(to));
  };
  const onMove = (event: PointerEvent): void => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) moveTwo(before, other, now);
    else if (event.shiftKey || (event.buttons & 1) === 0) view.pan(now.x - before.x, now.y - before.y);
    else view.orbit(now.x - before.x, now.y - before.y);
    fingers.set(event.pointerId, now);
  };

  element.style.touchAction = 'none';
  element.addEventListener(
    'pointerdown',
    (event) => {
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      element.setPointerCapture(event.pointerId);
    },
    options,
  );
  element.addEventListener('pointermove', onMove, options);
  for (const type of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
    element.addEventListener(type, (event) => fingers.delete(event.pointerId), options);
  }
  element.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      const at = fromMiddle({ x: event.clientX, y: event.clientY });
      view.zoom(wheelFactor(event.deltaY, event.deltaMode), at);
    },
    { ...options, passive: false },
  );
  element.addEventListener('contextmenu', (event) => event.preventDefault(), options);
  element.addEventListener('dblclick', () => view.fit(), options);
  element.addEventListener(
    'keydown',
    (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (moveByKey(view, event.key, event.shiftKey)) event.preventDefault();
    },
    options,
  );
  return () => stop.abort();
}
