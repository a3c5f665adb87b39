// Work in pieces, each a task of its own: between two of them the page answers its user. Knows nothing of the pieces.

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
