// Events as the DOM has them, for objects that are not in its tree. Knows nothing of ports.

/** Gives `target` an `on…` attribute for events of this type. */
export function chainHandler(target: EventTarget, type: string): void {
  let handler: ((event: Event) => void) | null = null;
  EventTarget.prototype.addEventListener.call(target, type, (event) => handler?.call(target, event));
  Object.defineProperty(target, `on${type}`, {
    configurable: true,
    enumerable: true,
    get: () => handler,
    set: (value: unknown) => {
      handler = typeof value === 'function' ? (value as (event: Event) => void) : null;
    },
  });
}

/** Fires an event at `target` and, unless it is stopped there, at `parent`, where it still has its first target. */
export function fireBubbling(target: EventTarget, parent: EventTarget, type: string): void {
  const event = new Event(type, { bubbles: true });
  target.dispatchEvent(event);
  if (event.cancelBubble) return;
  Object.defineProperty(event, 'target', { value: target });
  parent.dispatchEvent(event);
}
