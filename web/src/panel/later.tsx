// Parts of the page that come a picture or more after the others, so that much that appears at once does not hold up the page
// in one block. Knows nothing of the parts.
import type { ComponentChildren } from 'preact';
import { useEffect, useState } from 'preact/hooks';

export interface LaterProps {
  /** Of the page, until the parts come. */
  readonly pictures: number;
  readonly children: ComponentChildren;
}

export function Later({ pictures, children }: LaterProps): ComponentChildren {
  const [left, setLeft] = useState(pictures);
  useEffect(() => {
    if (left <= 0) return;
    const frame = requestAnimationFrame(() => setLeft(left - 1));
    return () => cancelAnimationFrame(frame);
  }, [left]);
  return left <= 0 ? children : null;
}
