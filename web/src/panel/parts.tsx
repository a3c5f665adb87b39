// Small parts that all panels are made of. Know nothing of printers.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useId, useRef, useState } from 'preact/hooks';
import { Icon, type IconName } from './icons';
import { formatNumber, parseNumber } from './numbers';

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
  readonly class?: string;
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
  class: more = '',
}: ButtonProps): JSX.Element {
  return (
    <button
      type="button"
      class={`button ${kind} ${children ? '' : 'only-icon'} ${more}`}
      onClick={onClick}
      disabled={disabled || Boolean(why)}
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
  /** Called with a number between `min` and `max`, on Enter and on leaving the field after a change. */
  readonly onSet: (value: number) => void;
}

/** A number to type, with its unit; what is no number, or out of range, is said and not passed on. */
export function NumberField(props: NumberFieldProps): JSX.Element {
  const { label, unit, value, min, max, decimals = 0, disabled, why, hideLabel, onSet } = props;
  const id = useId();
  const [draft, setDraft] = useState<string | null>(null);
  const number = draft === null ? value : parseNumber(draft);
  const isWrong = number === undefined || number < min || number > max;
  const hint = `From ${formatNumber(min, decimals, 0)} to ${formatNumber(max, decimals, 0)} ${unit}`;
  const commit = (): void => {
    if (draft === null || isWrong) return;
    setDraft(null);
    onSet(number);
  };
  return (
    <span class="number-field">
      <label for={id} class={hideLabel ? 'unseen' : ''}>
        {label}
      </label>
      <span class={`number-box ${isWrong ? 'wrong' : ''}`}>
        <input
          id={id}
          type="text"
          inputMode="decimal"
          autocomplete="off"
          value={draft ?? formatNumber(value, decimals, 0)}
          disabled={disabled || Boolean(why)}
          title={why ?? undefined}
          aria-invalid={isWrong}
          aria-describedby={isWrong ? `${id}-hint` : undefined}
          onFocus={(event) => event.currentTarget.select()}
          onInput={(event) => setDraft(event.currentTarget.value)}
          onBlur={() => {
            commit();
            setDraft(null);
          }}
          onKeyDown={(event) => {
            if (event.key === 'Enter') {
              event.preventDefault();
              commit();
            } else if (event.key === 'Escape' && draft !== null) {
              event.stopPropagation();
              setDraft(null);
            }
          }}
        />
        <span class="unit" aria-hidden="true">
          {unit}
        </span>
      </span>
      {isWrong && (
        <span class="field-hint" id={`${id}-hint`}>
          {hint}
        </span>
      )}
    </span>
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
}

/** A modal dialog; Escape and the cross close it, and the focus goes back to where it was. */
export function Dialog({ title, onClose, children, wide, aside, mayClose }: DialogProps): JSX.Element {
  const ref = useRef<HTMLDialogElement>(null);
  const id = useId();
  useEffect(() => {
    const dialog = ref.current;
    dialog?.showModal();
    return () => dialog?.close();
  }, []);
  const isFree = (): boolean => mayClose?.() ?? true;
  return (
    <dialog
      ref={ref}
      class={wide ? 'wide' : ''}
      aria-labelledby={id}
      onClose={onClose}
      onCancel={(event) => !isFree() && event.preventDefault()}
    >
      <header class="dialog-head">
        <h2 id={id}>{title}</h2>
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
  const url = URL.createObjectURL(new Blob([text], { type: 'text/plain' }));
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
