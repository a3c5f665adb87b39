// The instruments' worker: owns the canvas and the module that draws on it, so that drawing never holds the page up.
// The first message must be `start`; what comes while the module loads is done when it is there.
import { type Milliseconds, milliseconds } from '../units';
import { Frames } from './frames';
import { type Instruments, loadInstruments } from './module';
import type { CanvasSize, FromInstruments, PointerAct, ToInstruments } from './protocol';

/** Messages that wait for the module: beyond these the oldest go. Temperatures come as one message at first. */
const WAITING_MAX = 256;

const scope = self as unknown as {
  onmessage: ((message: MessageEvent<ToInstruments>) => void) | null;
  postMessage(message: FromInstruments): void;
  requestAnimationFrame(callback: () => void): number;
};

const tell = (message: FromInstruments): void => scope.postMessage(message);
const fail = (why: unknown): void => {
  drawing?.frames.stop();
  drawing = undefined;
  scope.onmessage = null;
  tell({ kind: 'failed', why: why instanceof Error ? why.message : String(why) });
};

interface Drawing {
  readonly instruments: Instruments;
  readonly canvas: OffscreenCanvas;
  readonly frames: Frames;
}

let drawing: Drawing | undefined;
let isStarted = false;
const waiting: ToInstruments[] = [];

/** A picture. A panic in the module ends it for good: its memory cannot be trusted any more. */
function draw(instruments: Instruments): Milliseconds {
  try {
    return milliseconds(instruments.draw(performance.now() / 1000) * 1000);
  } catch (error) {
    fail(error);
    return milliseconds(Number.POSITIVE_INFINITY);
  }
}

async function start(message: ToInstruments & { kind: 'start' }): Promise<void> {
  const { canvas, url, heaters, decimalSign } = message;
  const module = await loadInstruments(url);
  if (!module) return tell({ kind: 'missing' });
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false });
  if (!gl) throw new Error('This browser gives no WebGL 2.');
  canvas.addEventListener('webglcontextlost', () => fail('The graphics card was taken away from the page.'));
  const instruments = new module.Instruments(gl, [...heaters], decimalSign);
  const frames = new Frames(() => draw(instruments), {
    now: () => performance.now(),
    requestFrame: (callback) => scope.requestAnimationFrame(callback),
    setTimer: (callback, delay) => setTimeout(callback, delay) as unknown as number,
    clearTimer: (handle) => clearTimeout(handle),
  });
  drawing = { instruments, canvas, frames };
  for (const early of waiting.splice(0)) carryOut(early, drawing);
  tell({ kind: 'ready' });
}

function resize({ instruments, canvas }: Drawing, { width, height, ratio }: CanvasSize): void {
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  instruments.resize(canvas.width, canvas.height, ratio);
}

function point(instruments: Instruments, act: PointerAct): void {
  switch (act.kind) {
    case 'left':
      return instruments.pointer_left();
    case 'zoomed':
      return instruments.zoom(act.factor);
    default:
      instruments.pointer_moved(act.x, act.y);
      if (act.kind !== 'moved') instruments.pointer_pressed(act.kind === 'pressed');
  }
}

function carryOut(message: ToInstruments, current: Drawing): void {
  const { instruments, frames } = current;
  switch (message.kind) {
    case 'start':
      return;
    case 'size':
      resize(current, message.size);
      return frames.now();
    case 'dark':
      instruments.set_dark(message.on);
      return frames.now();
    case 'temperatures':
      instruments.push_temperatures(message.readings);
      return frames.soon();
    case 'speed':
      instruments.set_planned_speed(message.pairs);
      return frames.soon();
    case 'span':
      instruments.show_last(message.span);
      return frames.now();
    case 'pointer':
      point(instruments, message.act);
      return frames.now();
  }
}

scope.onmessage = ({ data }) => {
  try {
    if (data.kind === 'start' && !isStarted) {
      isStarted = true;
      start(data).catch(fail);
    } else if (drawing) {
      carryOut(data, drawing);
    } else {
      // The newest plan is the only one that matters.
      const older = data.kind === 'speed' ? waiting.findIndex(({ kind }) => kind === 'speed') : -1;
      if (older >= 0) waiting.splice(older, 1);
      else if (waiting.length >= WAITING_MAX) waiting.shift();
      waiting.push(data);
    }
  } catch (error) {
    fail(error);
  }
};
