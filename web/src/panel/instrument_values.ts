// What the planned speed says in words. Pairs of time (s from now) and speed (mm/s), as planner-wasm gives them.

/** The speed now, between the pairs around it; null where nothing is planned. */
export function speedNow(pairs: Float64Array): number | null {
  for (let i = 0; i + 1 < pairs.length; i += 2) {
    const [at, speed] = [pairs[i] ?? 0, pairs[i + 1] ?? 0];
    if (at < 0) continue;
    if (i === 0) return at === 0 ? speed : null;
    const [before, from] = [pairs[i - 2] ?? 0, pairs[i - 1] ?? 0];
    return at === before ? speed : from + ((speed - from) * -before) / (at - before);
  }
  return null;
}

/** The highest speed from now on; null where nothing is planned. */
export function peakAhead(pairs: Float64Array): number | null {
  let peak = speedNow(pairs);
  for (let i = 0; i + 1 < pairs.length; i += 2) {
    const speed = pairs[i + 1] ?? 0;
    if ((pairs[i] ?? 0) >= 0 && (peak === null || speed > peak)) peak = speed;
  }
  return peak;
}
