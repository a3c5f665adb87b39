/**
 * How much to draw in one go: learns what a segment costs from the frames before.
 *
 * Does not know: what is drawn or how time is measured. Units: ms, segments.
 */
import type { Ms } from './units';

/** What one go may take, with room for the rest of a frame of 50 ms. */
export const FRAME_TARGET_MS: Ms = 36;
/** Goes with fewer segments tell what a go costs whatever is drawn in it. */
const SEGMENTS_FEW = 1_000;
/** However slow the machine: fewer would no longer look like the part. */
const SEGMENTS_MIN = 8_000;
const SEGMENTS_START = 16_000;
/** More than any file: 2²⁶ vertices are 1 GiB. */
const SEGMENTS_MAX = 1 << 26;
/** The budget may grow so much from one go to the next: a single lucky measurement must not freeze the view. */
const GROWTH_MAX = 4;
const NEWEST_WEIGHT = 0.3;
/** Segments get at least this share of the target, even where the fixed cost eats it up. */
const SHARE_MIN = 0.4;

const towards = (old: number | null, newest: number): number =>
  old === null ? newest : old + NEWEST_WEIGHT * (newest - old);

export class DetailBudget {
  #fixedMs: Ms = 0;
  #msPerSegment: number | null = null;
  #budget = SEGMENTS_START;

  /** Segments for the next go. */
  get segments(): number {
    return this.#budget;
  }

  /** What `segments` would take, or null before anything was measured. */
  estimateMs(segments: number): Ms | null {
    return this.#msPerSegment === null ? null : this.#fixedMs + this.#msPerSegment * segments;
  }

  /** A go of so many segments took so long. */
  measured(segments: number, elapsedMs: Ms): void {
    if (!(elapsedMs >= 0) || !(segments >= 0)) return;
    if (segments < SEGMENTS_FEW) {
      this.#fixedMs = towards(this.#fixedMs === 0 ? null : this.#fixedMs, elapsedMs);
      return;
    }
    // A go cheaper than the fixed part was thought to be corrects that.
    this.#fixedMs = Math.min(this.#fixedMs, 0.8 * elapsedMs);
    this.#msPerSegment = towards(this.#msPerSegment, Math.max(elapsedMs - this.#fixedMs, 0.2) / segments);
    const forSegments = Math.max(FRAME_TARGET_MS - this.#fixedMs, FRAME_TARGET_MS * SHARE_MIN);
    const wanted = Math.min(forSegments / this.#msPerSegment, this.#budget * GROWTH_MAX, SEGMENTS_MAX);
    this.#budget = Math.round(Math.max(wanted, SEGMENTS_MIN));
  }
}

/** A full picture that takes longer does without several samples a pixel. */
const SMOOTH_MAX_MS: Ms = 1500;
/** Fewer segments never take long, whatever else the machine does. */
const SMOOTH_ALWAYS = 30_000;
/** Four samples a pixel make a picture at most so many times as dear. */
const SMOOTH_COST_MAX = 3;

/** Whether full pictures are drawn with several samples a pixel: as long as that is no nuisance, by the pictures before. */
export class SmoothChoice {
  #smoothMs: Ms = 0;
  #plainMs: Ms = Infinity;

  /** Whether the next picture, of so many segments, is worth it. */
  isWorth(segments: number): boolean {
    if (segments <= SMOOTH_ALWAYS) return true;
    // One picture that took long for another reason is put right by the next one, which is plain.
    return Math.min(this.#smoothMs, SMOOTH_COST_MAX * this.#plainMs) * segments <= SMOOTH_MAX_MS;
  }

  /** A picture of so many segments took so long. */
  measured(isSmooth: boolean, segments: number, elapsedMs: Ms): void {
    if (!(elapsedMs >= 0) || !(segments >= SEGMENTS_FEW)) return;
    if (isSmooth) this.#smoothMs = elapsedMs / segments;
    else this.#plainMs = elapsedMs / segments;
  }

  /** Pictures of another size: what was measured holds no longer. */
  reset(): void {
    this.#smoothMs = 0;
    this.#plainMs = Infinity;
  }
}
