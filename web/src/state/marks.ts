// Which vertex of the drawn path belongs to which line of the file: pairs of a line and the vertex where its segment
// ends, some dozens of vertices apart, in order. Knows neither files nor drawing.

export class LineMarks {
  #pairs = new Uint32Array(4096);
  #used = 0;

  /** Adds pairs to those that are there; the memory doubles, so that a long file costs no more copies than a short one. */
  append(more: Uint32Array): void {
    if (this.#used + more.length > this.#pairs.length) {
      const larger = new Uint32Array(Math.max(this.#pairs.length * 2, this.#used + more.length));
      larger.set(this.#pairs.subarray(0, this.#used));
      this.#pairs = larger;
    }
    this.#pairs.set(more, this.#used);
    this.#used += more.length;
  }

  /** The last vertex that has been made when this line's moves have been made; a few dozen vertices short at most. */
  vertexAt(line: number): number {
    let [low, high] = [0, this.#used / 2];
    while (low < high) {
      const middle = (low + high) >>> 1;
      if ((this.#pairs[middle * 2] ?? 0) <= line) low = middle + 1;
      else high = middle;
    }
    return low === 0 ? 0 : (this.#pairs[low * 2 - 1] ?? 0);
  }
}
