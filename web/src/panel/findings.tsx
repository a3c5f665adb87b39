// What the check found in the file, by line, and the confirmation of lines that would be passed over.
import type { JSX } from 'preact';
import type { Trouble } from '../machine/protocol';
import type { Remark } from '../preview/protocol';
import { isPrinting } from '../state/machine';
import { confirmed, confirmLine, failure, file, summary } from '../state/preview';
import { Icon } from './icons';
import { formatNumber } from './numbers';

/** Longer lists help nobody; the rest is counted. */
const SHOWN_MAX = 100;
/** Of errors of one kind. */
const ALIKE_MAX = 3;
/** As many as the check keeps. */
const ERRORS_MAX = 1000;

const lineText = (line: number | null): string => (line ? `Line ${formatNumber(line)}` : 'The file');

/** The same thing wrong in many lines is one thing to do. */
function groups(errors: readonly Trouble[]): Trouble[][] {
  const byCode = new Map<string, Trouble[]>();
  for (const error of errors) byCode.set(error.code, [...(byCode.get(error.code) ?? []), error]);
  return [...byCode.values()];
}

function Errors({ errors }: { readonly errors: readonly Trouble[] }): JSX.Element {
  return (
    <ul class="findings bad" aria-label="What stops the print">
      {groups(errors.slice(0, ERRORS_MAX)).map((group) => (
        <li key={group[0]?.code}>
          <Icon name="warning" />
          <div>
            {group.slice(0, ALIKE_MAX).map((error) => (
              <p class="finding-what" key={error.happened}>
                {error.happened}
              </p>
            ))}
            {group.length > ALIKE_MAX && (
              <p class="finding-what">and {formatNumber(group.length - ALIKE_MAX)} more lines like these.</p>
            )}
            <p>{group[0]?.todo}</p>
          </div>
        </li>
      ))}
    </ul>
  );
}

function Blocking({ lines }: { readonly lines: readonly Remark[] }): JSX.Element {
  return (
    <fieldset class="findings asks" disabled={isPrinting.value}>
      <legend>These lines are not known and will be left out. Confirm each one:</legend>
      {lines.slice(0, SHOWN_MAX).map(({ line, text }) => (
        <label key={line} class="check">
          <input
            type="checkbox"
            checked={confirmed.value.has(line)}
            onChange={(event) => confirmLine(line, event.currentTarget.checked)}
          />
          <span>
            <strong>{lineText(line)}</strong> {text}
          </span>
        </label>
      ))}
    </fieldset>
  );
}

function Remarks({ remarks }: { readonly remarks: readonly Remark[] }): JSX.Element {
  return (
    <details class="remarks">
      <summary>{remarks.length === 1 ? 'One remark' : `${formatNumber(remarks.length)} remarks`}</summary>
      <ul>
        {remarks.slice(0, SHOWN_MAX).map(({ line, text, severity }, index) => (
          <li key={index} class={severity}>
            <strong>{lineText(line)}</strong> {text}
          </li>
        ))}
      </ul>
      {remarks.length > SHOWN_MAX && <p class="dim">and {formatNumber(remarks.length - SHOWN_MAX)} more</p>}
    </details>
  );
}

export function Findings(): JSX.Element | null {
  if (file.value && failure.value) return <Errors errors={[failure.value]} />;
  const found = summary.value;
  if (!found) return null;
  const remarks = found.remarks.filter(({ severity }) => severity === 'warning' || severity === 'info');
  return (
    <>
      {found.errors.length > 0 && <Errors errors={found.errors} />}
      {found.blocking.length > 0 && <Blocking lines={found.blocking} />}
      {remarks.length > 0 && <Remarks remarks={remarks} />}
    </>
  );
}
