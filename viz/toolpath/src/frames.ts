/**
 * When to draw: quick pictures while something moves, the full one at rest, never more than one frame on its way.
 *
 * A full picture is drawn in slices of about one frame, out of sight, and shown when it is complete; whatever moves in between
 * abandons it. Frames are timed until the GPU is done with them, since issuing the commands takes next to no time.
 * Does not know: what is drawn. Units: ms, segments.
 */
import { DetailBudget, FRAME_TARGET_MS } from './detail';
import type { Ms } from './units';

/** The clock and the timers of the realm that the loop runs in. */
export interface FrameClock {
  now(): Ms;
  requestFrame(callback: () => void): number;
  cancelFrame(handle: number): void;
  setTimer(callback: () => void, delayMs: Ms): number;
  clearTimer(handle: number): void;
}

/** What one go drew. */
export interface Drawn {
  readonly segments: number;
  /** True when the picture is complete and shown. */
  readonly complete: boolean;
}

export interface Painter {
  /** How many segments a full picture has. */
  fullSegments(): number;
  /** Draws and shows a picture of about so many segments. */
  drawQuick(budget: number): number;
  /** Goes on with the full picture (from its beginning if `restart`) by about so many segments. */
  drawSlice(budget: number, restart: boolean): Drawn;
  /** Mends the complete picture after a small change; false if it has to be drawn anew. */
  patch(): boolean;
  /** Shows the complete picture again, with what lies over it as it is now. */
  overlay(): void;
  /** A question whether the GPU has done all that was asked of it. */
  fence(): () => boolean;
}

export interface FrameReport {
  /** 'part': a full picture is under way, out of sight; told where it takes long. */
  readonly kind: 'quick' | 'part' | 'full' | 'patch' | 'overlay';
  readonly segments: number;
  /** From the first command until the GPU was done; for a full picture the longest slice. */
  readonly longestMs: Ms;
  /** From the beginning of the picture to its end. */
  readonly totalMs: Ms;
  /** Of the picture, 0 … 1; all of it but for parts. */
  readonly share: number;
  /** Another picture follows: this one is not what was asked for last, or not in full detail. */
  readonly more: boolean;
}

/** After the last movement, until the full picture is begun. */
const REST_MS = 140;
/** The same after more of a file has come. */
const GROWTH_REST_MS = 1500;
/** While a file comes, the picture follows this often: first soon, then not so often that drawing delays the reading. */
const GROWTH_MS: Ms = 150;
const GROWTH_MAX_MS: Ms = 1000;
const GROWTH_SLOWER = 1.5;
/** Where pictures are drawn by the processor, they take it from the reading: a pause is so many times as long as a picture. */
const GROWTH_PAUSE = 8;
const GROWTH_PAUSE_MAX_MS: Ms = 5000;
const POLL_MS = 2;
/** How far a full picture is is told this often. */
const PART_MS = 500;
/** A GPU that is silent for so long has lost its context or is stuck: the loop goes on. */
const FENCE_MAX_MS = 10_000;

/** Those who wait for a picture at once; more are told with the last of them. */
const RESTING_MAX = 64;

type Picture = 'none' | 'begun' | 'complete';

export class FrameLoop {
  readonly #painter: Painter;
  readonly #clock: FrameClock;
  readonly #report: (report: FrameReport) => void;
  readonly #quickBudget = new DetailBudget();
  readonly #fullBudget = new DetailBudget();
  #frame: number | null = null;
  #timer: number | null = null;
  #poll: number | null = null;
  #stopped = false;
  #quickWanted = false;
  #fullWanted = false;
  #patchWanted = false;
  #overlayWanted = false;
  #picture: Picture = 'none';
  #pictureBegan: Ms = 0;
  #pictureSegments = 0;
  #longest: Ms = 0;
  #partTold: Ms = -Infinity;
  /** The file is thought to grow until then. */
  #growsUntil: Ms = -Infinity;
  /** A picture of what has come is drawn then at the earliest; and how long after that one the next. */
  #nextGrowth: Ms = -Infinity;
  #growthMs: Ms = GROWTH_MS;
  /** The first of the file came then. */
  #cameAt: Ms = Infinity;
  /** What the last quick or full picture took. */
  #tookMs: Ms = 0;
  /** Runs while changes are gathered. */
  #gathering: number | null = null;
  #resting: (() => void)[] = [];

  constructor(painter: Painter, clock: FrameClock, report: (report: FrameReport) => void) {
    this.#painter = painter;
    this.#clock = clock;
    this.#report = report;
  }

  /** Something that moves has changed the picture. */
  moved(): void {
    this.#changed();
  }

  /** A file begins: what comes first of it is shown at once. */
  begins(): void {
    this.#growsUntil = -Infinity;
    this.#nextGrowth = -Infinity;
    this.#growthMs = GROWTH_MS;
    this.#cameAt = Infinity;
  }

  /** The file has grown, and will again: a picture now and then, and no full one is begun between. */
  grew(): void {
    const now = this.#clock.now();
    this.#growsUntil = now + GROWTH_REST_MS;
    this.#cameAt = Math.min(this.#cameAt, now);
    // How long a picture takes, and with it the pause, is known when it is done.
    if (now < this.#nextGrowth || this.#frame !== null || this.#poll !== null) return;
    this.#nextGrowth = now + this.#growthMs;
    this.#growthMs = Math.min(this.#growthMs * GROWTH_SLOWER, GROWTH_MAX_MS);
    this.#changed();
  }

  /** The file grows no more. */
  ended(): void {
    this.#growsUntil = -Infinity;
    this.changed();
  }

  /** Something has changed that is no movement: more may follow, and where pictures take long all of it is drawn at once. */
  changed(): void {
    if (this.#tookMs <= FRAME_TARGET_MS) return this.#changed();
    this.#picture = 'none';
    this.#fullWanted = false;
    this.#gathering ??= this.#clock.setTimer(() => this.#changed(), REST_MS);
  }

  #changed(): void {
    if (this.#gathering !== null) this.#clock.clearTimer(this.#gathering);
    this.#gathering = null;
    if (this.#fullFits()) {
      this.redraw();
      return;
    }
    this.#picture = 'none';
    this.#fullWanted = false;
    this.#quickWanted = true;
    this.#schedule();
    this.#rest(REST_MS);
  }

  /** The full picture is begun after that, or when the file grows no more. */
  #rest(delayMs: Ms): void {
    if (this.#timer !== null) this.#clock.clearTimer(this.#timer);
    this.#timer = this.#clock.setTimer(() => {
      this.#timer = null;
      const wait = this.#growsUntil - this.#clock.now();
      if (wait > 0) return this.#rest(wait);
      this.#fullWanted = true;
      this.#schedule();
    }, delayMs);
  }

  /** A picture has taken so long. One that shows nothing of the file yet does not delay the first that does. */
  #took(began: Ms, elapsed: Ms): void {
    this.#tookMs = elapsed;
    if (began < this.#cameAt) return;
    const pause = Math.min(elapsed * GROWTH_PAUSE, GROWTH_PAUSE_MAX_MS);
    this.#nextGrowth = Math.max(this.#nextGrowth, this.#clock.now() + pause);
  }

  /** The picture is to be drawn anew; the old one stays until then. */
  redraw(): void {
    this.#picture = 'none';
    this.#fullWanted = true;
    this.#schedule();
  }

  /** A little has changed: mended on the complete picture, or part of the one that comes next. */
  patched(): void {
    this.#patchWanted = true;
    this.#schedule();
  }

  /** What lies over the picture has changed; pictures in motion and new ones show it anyway. */
  overlaid(): void {
    if (this.#picture !== 'complete') return;
    this.#overlayWanted = true;
    this.#schedule();
  }

  /** Calls back once what was asked for up to now is shown in full and nothing is under way. */
  onRest(callback: () => void): void {
    if (this.#isAtRest() && this.#poll === null) return callback();
    if (this.#resting.length < RESTING_MAX) this.#resting.push(callback);
    this.#schedule();
  }

  /** Draws no more until {@link resume}. */
  pause(): void {
    this.#stopped = true;
    for (const handle of [this.#timer, this.#poll, this.#gathering])
      if (handle !== null) this.#clock.clearTimer(handle);
    if (this.#frame !== null) this.#clock.cancelFrame(this.#frame);
    this.#frame = null;
    this.#timer = null;
    this.#poll = null;
    this.#gathering = null;
    this.#picture = 'none';
  }

  resume(): void {
    this.#stopped = false;
    this.moved();
  }

  #fullFits(): boolean {
    const estimate = this.#fullBudget.estimateMs(this.#painter.fullSegments());
    return estimate !== null && estimate <= FRAME_TARGET_MS;
  }

  #schedule(): void {
    if (this.#stopped || this.#frame !== null || this.#poll !== null) return;
    this.#frame = this.#clock.requestFrame(() => {
      this.#frame = null;
      this.#draw();
    });
  }

  #draw(): void {
    const began = this.#clock.now();
    if (this.#quickWanted) {
      this.#quickWanted = false;
      this.#patchWanted = false;
      this.#overlayWanted = false;
      const segments = this.#painter.drawQuick(this.#quickBudget.segments);
      this.#await(began, (elapsed) => {
        this.#quickBudget.measured(segments, elapsed);
        this.#took(began, elapsed);
        this.#tell({ kind: 'quick', segments, longestMs: elapsed, totalMs: elapsed });
      });
    } else if (this.#fullWanted) {
      this.#drawSlice(began);
    } else if (this.#patchWanted) {
      this.#patchWanted = false;
      if (this.#picture !== 'complete' || !this.#painter.patch()) return this.redraw();
      this.#overlayWanted = false;
      this.#awaitSmall('patch', began);
    } else if (this.#overlayWanted) {
      this.#overlayWanted = false;
      if (this.#picture !== 'complete') return;
      this.#painter.overlay();
      this.#awaitSmall('overlay', began);
    }
  }

  #awaitSmall(kind: 'patch' | 'overlay', began: Ms): void {
    this.#await(began, (elapsed) => this.#tell({ kind, segments: 0, longestMs: elapsed, totalMs: elapsed }));
  }

  #drawSlice(began: Ms): void {
    const restart = this.#picture !== 'begun';
    if (restart) {
      this.#picture = 'begun';
      this.#pictureBegan = began;
      this.#pictureSegments = 0;
      this.#longest = 0;
    }
    const { segments, complete } = this.#painter.drawSlice(this.#fullBudget.segments, restart);
    this.#pictureSegments += segments;
    if (complete) {
      this.#fullWanted = false;
      this.#overlayWanted = false;
      this.#picture = 'complete';
    }
    this.#await(began, (elapsed) => {
      this.#fullBudget.measured(segments, elapsed);
      this.#longest = Math.max(this.#longest, elapsed);
      if (!complete) return this.#tellPart();
      const totalMs = this.#clock.now() - this.#pictureBegan;
      this.#took(this.#pictureBegan, totalMs);
      this.#tell({ kind: 'full', segments: this.#pictureSegments, longestMs: this.#longest, totalMs });
    });
  }

  #isWanted(): boolean {
    return this.#quickWanted || this.#fullWanted || this.#patchWanted || this.#overlayWanted;
  }

  #isWaiting(): boolean {
    return this.#timer !== null || this.#gathering !== null;
  }

  #isAtRest(): boolean {
    return this.#picture === 'complete' && !this.#isWanted() && !this.#isWaiting();
  }

  /** Now and then, how far the full picture is. */
  #tellPart(): void {
    const now = this.#clock.now();
    if (now - Math.max(this.#partTold, this.#pictureBegan) < PART_MS) return;
    this.#partTold = now;
    const [segments, longestMs] = [this.#pictureSegments, this.#longest];
    const share = Math.min(segments / Math.max(this.#painter.fullSegments(), 1), 1);
    this.#tell({ kind: 'part', segments, longestMs, totalMs: now - this.#pictureBegan, share });
  }

  #tell(report: Omit<FrameReport, 'more' | 'share'> & { readonly share?: number }): void {
    this.#report({ share: 1, ...report, more: this.#isWanted() || this.#isWaiting() });
    if (!this.#isAtRest()) return;
    for (const callback of this.#resting.splice(0)) callback();
  }

  /** Waits for the GPU, then goes on with what is wanted. */
  #await(began: Ms, done: (elapsed: Ms) => void): void {
    const isDone = this.#painter.fence();
    const poll = (): void => {
      this.#poll = null;
      const elapsed = this.#clock.now() - began;
      if (!isDone() && elapsed < FENCE_MAX_MS) {
        this.#poll = this.#clock.setTimer(poll, POLL_MS);
        return;
      }
      done(elapsed);
      if (this.#isWanted()) this.#schedule();
    };
    this.#poll = this.#clock.setTimer(poll, 0);
  }
}

/** The clock of a window or a dedicated worker. */
export function realmClock(): FrameClock {
  return {
    now: () => performance.now(),
    requestFrame: (callback) => requestAnimationFrame(callback),
    cancelFrame: (handle) => cancelAnimationFrame(handle),
    setTimer: (callback, delayMs) => setTimeout(callback, delayMs) as unknown as number,
    clearTimer: (handle) => clearTimeout(handle),
  };
}
