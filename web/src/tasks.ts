// Work in pieces, each a task of its own: between two of them the page answers its user; and work that waits until the page
// has shown what is new. Knows nothing of the pieces.

/** A page that is not seen shows nothing: after so long nobody waits for its pictures, in ms. */
const PICTURES_MS = 500;

/** Calls back once the page has shown so many pictures of itself, or would have. */
export function afterPictures(count: number, act: () => void): void {
  let left = count;
  const end = (): void => {
    clearTimeout(timer);
    left = -1;
    act();
  };
  const timer = setTimeout(end, PICTURES_MS);
  const next = (): void => {
    if (left < 0) return;
    left -= 1;
    if (left < 0) end();
    else requestAnimationFrame(next);
  };
  if (typeof requestAnimationFrame === 'function') next();
}

/** Carries out steps one after the other, each in a task of its own but the first, which is done at once. */
export function inTasks(...steps: readonly (() => void)[]): void {
  const { port1, port2 } = new MessageChannel();
  let at = 0;
  const next = (): void => {
    const step = steps[at];
    at += 1;
    // Asked for first, so that a step that fails does not keep the others from being done. Unlike a timer's, such a
    // task is not put off in a page that is hidden.
    if (at < steps.length) port2.postMessage(null);
    else port1.close();
    step?.();
  };
  port1.onmessage = next;
  next();
}
