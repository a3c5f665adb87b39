// Which vertex of the drawn path belongs to which line of the file. Marks are pairs of a line and the vertex where its
// segment ends, some dozens of vertices apart, in order; steps say of each vertex how many lines further it comes from than
// the one before. Without steps, answers are right to some dozens of vertices. Knows neither files nor drawing.

/** A step so long says only that there is a mark at its vertex. */
const STEP_MARKED = 255;

function grown<T extends Uint32Array | Uint8Array>(array: T, used: number, more: number): T {
  if (used + more <= array.length) return array;
  const larger = new (array.constructor as new (length: number) => T)(
    Math.max(array.length * 2, used + more),
  );
  larger.set(array.subarray(0, used));
  return larger;
}

interface Mark {
  readonly line: number;
  readonly vertex: number;
}

export class LineMarks {
  #pairs = new Uint32Array(4096);
  #used = 0;
  #steps = new Uint8Array(4096);
  #vertices = 0;

  /** Adds pairs to those that are there; the memory doubles, so that a long file costs no more copies than a short one. */
  append(more: Uint32Array): void {
    this.#pairs = grown(this.#pairs, this.#used, more.length);
    this.#pairs.set(more, this.#used);
    this.#used += more.length;
  }

  /** Adds the steps of the next vertices. */
  appendSteps(more: Uint8Array): void {
    this.#steps = grown(this.#steps, this.#vertices, more.length);
    this.#steps.set(more, this.#vertices);
    this.#vertices += more.length;
  }

  /** The last vertex that has been made when this line's moves have been made. */
  vertexAt(line: number): number {
    const mark = this.#last((at) => (this.#pairs[at * 2] ?? 0) <= line);
    const from = mark ?? { line: this.#steps[0] ?? 0, vertex: 0 };
    let { vertex } = from;
    for (let reached = from.line; vertex + 1 < this.#vertices; vertex += 1) {
      const step = this.#steps[vertex + 1] ?? 0;
      reached += step;
      if (step === STEP_MARKED || reached > line) break;
    }
    return vertex;
  }

  /** The line whose segment ends at this vertex; null where there is none. */
  lineAt(vertex: number): number | null {
    const mark = this.#last((at) => (this.#pairs[at * 2 + 1] ?? 0) <= vertex);
    if (!mark) return this.#sum(0, vertex);
    if (mark.vertex === vertex) return mark.line;
    const further = this.#sum(mark.vertex + 1, vertex);
    return further === null ? null : mark.line + further;
  }

  #sum(first: number, last: number): number | null {
    if (last >= this.#vertices) return null;
    let sum = 0;
    for (let at = first; at <= last; at += 1) sum += this.#steps[at] ?? 0;
    return sum;
  }

  /** The last mark of those that hold, which come first. */
  #last(holds: (at: number) => boolean): Mark | null {
    let [low, high] = [0, this.#used / 2];
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (holds(middle)) low = middle + 1;
      else high = middle;
    }
    if (low === 0) return null;
    return { line: this.#pairs[low * 2 - 2] ?? 0, vertex: this.#pairs[low * 2 - 1] ?? 0 };
  }
}
