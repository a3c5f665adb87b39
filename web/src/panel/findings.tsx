// What the check found in the file, by line, and the confirmation of lines that would be passed over.
import type { JSX } from 'preact';
import type { Trouble } from '../machine/protocol';
import type { Remark } from '../preview/protocol';
import { confirmGroup, type Group, groups, isConfirmed, rest } from '../state/confirm';
import { isPrinting } from '../state/machine';
import { failure, file, summary } from '../state/preview';
import { Icon } from './icons';
import { formatNumber } from './numbers';

/** Longer lists help nobody; the rest is counted. */
const SHOWN_MAX = 100;
/** Of errors of one kind. */
const ALIKE_MAX = 3;
/** Of lines that have to be confirmed together. */
const LINES_NAMED_MAX = 5;
/** As many as the check keeps. */
const ERRORS_MAX = 1000;

const lineText = (line: number | null): string => (line ? `Line ${formatNumber(line)}` : 'The file');

/** The same thing wrong in many lines is one thing to do. */
function alike(errors: readonly Trouble[]): Trouble[][] {
  const byCode = new Map<string, Trouble[]>();
  for (const error of errors) byCode.set(error.code, [...(byCode.get(error.code) ?? []), error]);
  return [...byCode.values()];
}

function Errors({ errors }: { readonly errors: readonly Trouble[] }): JSX.Element {
  return (
    <ul class="findings bad" aria-label="What stops the print">
      {alike(errors.slice(0, ERRORS_MAX)).map((group) => (
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

function linesText(lines: readonly number[]): string {
  if (lines.length === 1) return lineText(lines[0] ?? null);
  const named = lines.slice(0, LINES_NAMED_MAX).map((line) => formatNumber(line));
  const more = lines.length - named.length;
  return `Lines ${named.join(', ')}${more > 0 ? ` and ${formatNumber(more)} more` : ''}`;
}

function Asking({ group, name }: { readonly group: Group; readonly name: string }): JSX.Element {
  return (
    <label class="check">
      <input
        type="checkbox"
        checked={isConfirmed(group)}
        onChange={(event) => confirmGroup(group, event.currentTarget.checked)}
      />
      <span>
        <strong>{name}</strong> {group.text}
      </span>
    </label>
  );
}

function Blocking(): JSX.Element {
  return (
    <fieldset class="findings asks" disabled={isPrinting.value}>
      <legend>These commands are not known and will be left out. Confirm each one:</legend>
      {groups.value.map((group) => (
        <Asking key={group.text} group={group} name={linesText(group.lines)} />
      ))}
      {rest.value && <Asking group={rest.value} name="More lines" />}
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
      {found.blocking.length > 0 && <Blocking />}
      {remarks.length > 0 && <Remarks remarks={remarks} />}
    </>
  );
}
