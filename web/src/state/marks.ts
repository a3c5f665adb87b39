// Which vertex of the drawn path belongs to which line of the file. Two sources: marks, pairs of a line and a vertex some
// dozens of vertices apart; and line steps, one byte a vertex, how many lines further than the one before it it comes
// from, 255 where a mark says. Both in order. Knows neither files nor drawing.

type Numbers = Uint32Array<ArrayBuffer> | Uint8Array<ArrayBuffer>;

/** Numbers that are added to those that are there; the memory doubles, so that a long file costs no more copies. */
class Growing<T extends Numbers> {
  #values: T;
  #used = 0;
  readonly #make: (length: number) => T;

  constructor(make: (length: number) => T) {
    this.#make = make;
    this.#values = make(4096);
  }

  get length(): number {
    return this.#used;
  }

  append(more: T): void {
    if (this.#used + more.length > this.#values.length) {
      const larger = this.#make(Math.max(this.#values.length * 2, this.#used + more.length));
      larger.set(this.#values.subarray(0, this.#used));
      this.#values = larger;
    }
    this.#values.set(more, this.#used);
    this.#used += more.length;
  }

  at(index: number): number {
    return this.#values[index] ?? 0;
  }
}

export class LineMarks {
  readonly #pairs = new Growing((length) => new Uint32Array(length));
  readonly #steps = new Growing((length) => new Uint8Array(length));

  append(pairs: Uint32Array<ArrayBuffer>): void {
    this.#pairs.append(pairs);
  }

  appendSteps(steps: Uint8Array<ArrayBuffer>): void {
    this.#steps.append(steps);
  }

  /** The last vertex that has been made when this line's moves have been made. */
  vertexAt(line: number): number {
    const mark = this.#lastMark(0, line);
    if (mark < 0) return 0;
    let vertex = this.#pairs.at(mark * 2 + 1);
    const next = mark * 2 + 3;
    const end = Math.min(
      next < this.#pairs.length ? this.#pairs.at(next) : Number.MAX_VALUE,
      this.#steps.length,
    );
    for (let at = this.#pairs.at(mark * 2); vertex + 1 < end; vertex += 1) {
      at += this.#steps.at(vertex + 1);
      if (at > line) break;
    }
    return vertex;
  }

  /** The line that a vertex comes from; null where that is not known (yet). */
  lineAt(vertex: number): number | null {
    const mark = this.#lastMark(1, vertex);
    if (mark < 0 || vertex >= this.#steps.length) return null;
    let line = this.#pairs.at(mark * 2);
    for (let at = this.#pairs.at(mark * 2 + 1) + 1; at <= vertex; at += 1) line += this.#steps.at(at);
    return line;
  }

  /** The last mark whose line (0) or vertex (1) is not beyond this; -1 where there is none. */
  #lastMark(which: 0 | 1, value: number): number {
    let [low, high] = [0, this.#pairs.length / 2];
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (this.#pairs.at(middle * 2 + which) <= value) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }
}
