// Quiet words to the user that can wait: told beside what they do, put away when they like. At most one of each kind.
import { signal } from '@preact/signals';

export interface Notice {
  readonly kind: string;
  readonly text: string;
  /** What may be done about it, as the button says it; why it cannot be done now, if so. */
  readonly action?: { readonly text: string; readonly act: () => void; readonly why: string | null };
  /** What else may be done. */
  readonly other?: { readonly text: string; readonly act: () => void };
  /** It stays as long as what it says is so. */
  readonly isFixed?: true;
  /** It was put away by the user. */
  readonly onClosed?: () => void;
}

export const notices = signal<readonly Notice[]>([]);

/** Shows a notice, in the place of the last one of its kind. */
export function notify(notice: Notice): void {
  const shown = notices.peek();
  notices.value = shown.some(({ kind }) => kind === notice.kind)
    ? shown.map((other) => (other.kind === notice.kind ? notice : other))
    : [...shown, notice];
}

export function withdraw(kind: string): void {
  if (notices.peek().some((notice) => notice.kind === kind))
    notices.value = notices.peek().filter((notice) => notice.kind !== kind);
}
