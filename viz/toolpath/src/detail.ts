/**
 * How much to draw in one go: learns what a segment costs from the frames before.
 *
 * Does not know: what is drawn or how time is measured. Units: ms, segments.
 */
import type { Ms } from './units';

/** What one go may take, with room for the rest of a frame of 50 ms. */
export const FRAME_TARGET_MS: Ms = 36;
/** Fewer say nothing about the cost of one: the fixed part of a frame outweighs them. */
const SEGMENTS_MIN = 4_000;
const SEGMENTS_START = 40_000;
/** More than any file: 2²⁶ vertices are 1 GiB. */
const SEGMENTS_MAX = 1 << 26;
/** The budget may grow so much from one go to the next: a single lucky measurement must not freeze the view. */
const GROWTH_MAX = 4;
const NEWEST_WEIGHT = 0.4;

export class DetailBudget {
  #msPerSegment: number | null = null;
  #budget = SEGMENTS_START;

  /** Segments for the next go. */
  get segments(): number {
    return this.#budget;
  }

  /** What `segments` would take, or null before anything was measured. */
  estimateMs(segments: number): Ms | null {
    return this.#msPerSegment === null ? null : this.#msPerSegment * segments;
  }

  /** A go of so many segments took so long. */
  measured(segments: number, elapsedMs: Ms): void {
    if (!(elapsedMs >= 0) || segments < SEGMENTS_MIN) return;
    const cost = Math.max(elapsedMs, 0.5) / segments;
    // Slower counts at once, faster little by little.
    this.#msPerSegment =
      this.#msPerSegment === null || cost > this.#msPerSegment
        ? cost
        : this.#msPerSegment + NEWEST_WEIGHT * (cost - this.#msPerSegment);
    const wanted = FRAME_TARGET_MS / this.#msPerSegment;
    this.#budget = Math.round(
      Math.min(Math.max(wanted, SEGMENTS_MIN), this.#budget * GROWTH_MAX, SEGMENTS_MAX),
    );
  }
}
