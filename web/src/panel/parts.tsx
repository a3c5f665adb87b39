// Small parts that all panels are made of. Know nothing of printers.
import type { ComponentChildren, JSX, RefObject } from 'preact';
import { useEffect, useId, useRef, useState } from 'preact/hooks';
import { Icon, type IconName } from './icons';
import { formatPlain, parseNumber } from './numbers';

interface CardProps {
  readonly title: string;
  readonly aside?: ComponentChildren;
  readonly children: ComponentChildren;
}

/** A titled group of controls. */
export function Card({ title, aside, children }: CardProps): JSX.Element {
  const id = useId();
  return (
    <section class="card" aria-labelledby={id}>
      <header class="card-head">
        <h2 id={id}>{title}</h2>
        {aside}
      </header>
      {children}
    </section>
  );
}

interface ButtonProps {
  readonly onClick: () => void;
  readonly children?: ComponentChildren;
  readonly icon?: IconName;
  readonly kind?: 'plain' | 'primary' | 'danger' | 'quiet';
  readonly label?: string;
  readonly disabled?: boolean;
  /** Why the button cannot be used now; null where it can. */
  readonly why?: string | null;
  readonly pressed?: boolean;
  /** Presses are passed over for now. Keeps the focus, which a disabled button loses. */
  readonly busy?: boolean;
  readonly class?: string;
  readonly place?: RefObject<HTMLButtonElement | null>;
}

/** A button; with `label` instead of words it is an icon with a name. */
export function Button({
  onClick,
  children,
  icon,
  kind = 'plain',
  label,
  disabled,
  why,
  pressed,
  busy = false,
  class: more = '',
  place,
}: ButtonProps): JSX.Element {
  return (
    <button
      ref={place ?? null}
      type="button"
      class={`button ${kind} ${children ? '' : 'only-icon'} ${more}`}
      onClick={() => !busy && onClick()}
      disabled={disabled || Boolean(why)}
      aria-disabled={busy || undefined}
      aria-label={label}
      aria-pressed={pressed}
      title={why ?? (children ? undefined : label)}
    >
      {icon && <Icon name={icon} />}
      {children && <span>{children}</span>}
    </button>
  );
}

interface NumberFieldProps {
  readonly label: string;
  readonly unit: string;
  readonly value: number;
  readonly min: number;
  readonly max: number;
  readonly decimals?: number;
  readonly disabled?: boolean;
  /** Why the field cannot be used now; null where it can. */
  readonly why?: string | null;
  readonly hideLabel?: boolean;
  /** Told whether what is typed cannot be set. Then it stays, with what is wrong with it, when the field is left. */
  readonly onWrong?: (isWrong: boolean) => void;
  /** Told of each number as it is typed, not only once the field is left. */
  readonly live?: boolean;
  /** What is set acts on the machine: only Enter and the button pass it on, and leaving the field puts it away. */
  readonly acts?: boolean;
  /** Called with a number between `min` and `max`: on Enter, and, unless it `acts`, on leaving the field after a change. */
  readonly onSet: (value: number) => void;
}

interface Draft {
  /** What is typed and not yet set. */
  readonly text: string | null;
  readonly isWrong: boolean;
  readonly set: (text: string | null) => void;
  readonly commit: () => void;
  readonly leave: () => void;
}

function useDraft({ value, min, max, acts, onWrong, onSet }: NumberFieldProps, isOff: boolean): Draft {
  const [text, set] = useState<string | null>(null);
  const number = text === null ? value : parseNumber(text);
  const isWrong = number === undefined || number < min || number > max;
  // A field that is switched off is not left: the browser says nothing.
  useEffect(() => {
    if (isOff) set(null);
  }, [isOff]);
  // Told of a change alone: several fields may have one listener.
  const wasWrong = useRef(false);
  useEffect(() => {
    if (wasWrong.current !== isWrong) onWrong?.(isWrong);
    wasWrong.current = isWrong;
  }, [isWrong, onWrong]);
  // It was set from elsewhere: what is typed is out of date.
  useEffect(() => {
    if (onWrong) set(null);
  }, [value, onWrong]);
  const commit = (): void => {
    if (text === null || isWrong || isOff) return;
    set(null);
    onSet(number);
  };
  const leave = (): void => {
    if (!acts) commit();
    if (!onWrong || !isWrong) set(null);
  };
  return { text, isWrong, set, commit, leave };
}

/** A number to type, with its unit; what is no number, or out of range, is said and not passed on. */
export function NumberField(props: NumberFieldProps): JSX.Element {
  const { label, unit, value, min, max, decimals = 0, disabled, why, hideLabel, acts, live, onSet } = props;
  const id = useId();
  const isOff = Boolean(disabled || why);
  const { text, isWrong, set, commit, leave } = useDraft(props, isOff);
  const hint = `From ${formatPlain(min, decimals)} to ${formatPlain(max, decimals)} ${unit}`;
  return (
    <span
      class="number-field"
      onFocusOut={(event) => {
        const to = event.relatedTarget;
        if (!(to instanceof Node && event.currentTarget.contains(to))) leave();
      }}
    >
      <label for={id} class={hideLabel ? 'unseen' : ''}>
        {label}
      </label>
      <span class={`number-box ${isWrong ? 'wrong' : ''}`}>
        <input
          id={id}
          type="text"
          inputMode="decimal"
          autocomplete="off"
          value={text ?? formatPlain(value, decimals)}
          disabled={isOff}
          title={why ?? undefined}
          aria-invalid={isWrong}
          aria-describedby={isWrong ? `${id}-hint` : undefined}
          onFocus={(event) => event.currentTarget.select()}
          onInput={(event) => {
            const typed = event.currentTarget.value;
            set(typed);
            const number = live ? parseNumber(typed) : undefined;
            if (number !== undefined && number >= min && number <= max) onSet(number);
          }}
          onKeyDown={(event) => {
            if (event.key === 'Enter') {
              event.preventDefault();
              commit();
            } else if (event.key === 'Escape' && text !== null) {
              event.stopPropagation();
              set(null);
            }
          }}
        />
        {acts && text !== null ? (
          <SetButton label={label} disabled={isWrong} onClick={commit} />
        ) : (
          <span class="unit" aria-hidden="true">
            {unit}
          </span>
        )}
      </span>
      {isWrong && (
        <span class="field-hint" id={`${id}-hint`}>
          {hint}
        </span>
      )}
    </span>
  );
}

interface SetButtonProps {
  readonly label: string;
  readonly disabled: boolean;
  readonly onClick: () => void;
}

/** Passes a typed number on, for those without an Enter key at hand. */
function SetButton({ label, disabled, onClick }: SetButtonProps): JSX.Element {
  return (
    <button
      type="button"
      class="number-set"
      aria-label={`Set ${label}`}
      disabled={disabled}
      // The field keeps the focus, and with it what is typed.
      onMouseDown={(event) => event.preventDefault()}
      onClick={onClick}
    >
      Set
    </button>
  );
}

export interface DialogProps {
  readonly title: string;
  readonly onClose: () => void;
  readonly children: ComponentChildren;
  readonly wide?: boolean;
  /** In the head, before the cross. */
  readonly aside?: ComponentChildren;
  /** Asked before Escape and the cross close the dialog. */
  readonly mayClose?: () => boolean;
  /** What has the focus at first; without it the title. */
  readonly first?: RefObject<HTMLElement | null>;
}

/**
 * A modal dialog; Escape and the cross close it, and the focus goes back to where it was. The browser would focus the
 * first button, which is the emergency stop in most dialogs: a second Enter would stop the print.
 */
export function Dialog({ title, onClose, children, wide, aside, mayClose, first }: DialogProps): JSX.Element {
  const ref = useRef<HTMLDialogElement>(null);
  const heading = useRef<HTMLHeadingElement>(null);
  const id = useId();
  useEffect(() => {
    const dialog = ref.current;
    const before = document.activeElement;
    dialog?.showModal();
    (first ?? heading).current?.focus();
    return () => {
      dialog?.close();
      // It is out of the page by now: the browser gives the focus back only from a dialog that is still there.
      if (before instanceof HTMLElement && document.activeElement === document.body) before.focus();
    };
  }, [first]);
  const isFree = (): boolean => mayClose?.() ?? true;
  return (
    <dialog
      ref={ref}
      class={wide ? 'wide' : ''}
      aria-labelledby={id}
      // The browser tells of the end in a later task, when another dialog may be open already: then it is not this one's.
      onClose={() => ref.current && onClose()}
      onCancel={(event) => !isFree() && event.preventDefault()}
    >
      <header class="dialog-head">
        <h2 id={id} ref={heading} tabIndex={-1}>
          {title}
        </h2>
        {aside}
        <Button icon="close" label="Close" kind="quiet" onClick={() => isFree() && onClose()} />
      </header>
      <div class="dialog-body">{children}</div>
    </dialog>
  );
}

interface ChoiceProps<T extends string | number> {
  readonly label: string;
  readonly choices: readonly { readonly value: T; readonly text: string }[];
  readonly value: T;
  readonly onSet: (value: T) => void;
  readonly disabled?: boolean;
  /** The label is for screen readers alone, where the choices speak for themselves. */
  readonly hideLabel?: boolean;
}

/** A few choices side by side, of which one holds. */
export function Choice<T extends string | number>({
  label,
  choices,
  value,
  onSet,
  disabled,
  hideLabel,
}: ChoiceProps<T>): JSX.Element {
  const name = useId();
  return (
    <fieldset class="choice-field" disabled={disabled}>
      <legend class={hideLabel ? 'unseen' : ''}>{label}</legend>
      <div class="choice">
        {choices.map((choice) => (
          <label key={choice.value} class={choice.value === value ? 'chosen' : ''}>
            <input
              type="radio"
              name={name}
              class="unseen"
              checked={choice.value === value}
              onChange={() => onSet(choice.value)}
            />
            {choice.text}
          </label>
        ))}
      </div>
    </fieldset>
  );
}

/** Gives a text to the user as a file. */
export function download(text: string, name: string): void {
  save(new Blob([text], { type: 'text/plain' }), name);
}

/** Gives bytes to the user as a file. */
export function save(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
