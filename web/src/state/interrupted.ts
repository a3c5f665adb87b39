// What the page does about prints that outlived their page: says so, offers to connect with the right machine, and shows
// the file of one that was taken up. Nothing of it connects or moves by itself.
import { computed, effect } from '@preact/signals';
import { dateFormat } from '../dates';
import type { KeptPrint } from '../machine/protocol';
import type { Summary } from '../preview/protocol';
import { heldPrint, keptPrints } from './kept';
import { connection, forgetPrint, isPrinting, isReady, lookForPrints, port } from './machine';
import { notify, withdraw } from './notices';
import { file, lineMarks, openFile, summary } from './preview';
import { printed } from './print';
import { activeProfile, newProfileId, PROFILES_MAX, profiles, saveProfile } from './profiles';
import { change } from './settings';
import { lineAfter, type Place, placeOf } from './start';
import { askToContinue } from './start_request';
import { watched } from './watched';

/** So many are spoken of. */
const SHOWN_MAX = 3;
const KIND = 'interrupted:';

const when = dateFormat({
  weekday: 'short',
  day: 'numeric',
  month: 'short',
  hour: 'numeric',
  minute: '2-digit',
});
export const timeOf = (ms: number): string => when(new Date(ms));

const lineOf = ({ line }: KeptPrint): string => (line > 0 ? `, after line ${line}` : '');

/** Uses the machine that the print was begun with, as it was then: with another one the board would be restarted. */
export async function useMachineOf({ machine }: KeptPrint): Promise<void> {
  change({ connectTo: 'serial' });
  const known = profiles.peek().find(({ config }) => config === machine.config);
  if (known) return change({ profile: known.id });
  const name = `${machine.name} (as printed)`;
  if (profiles.peek().length < PROFILES_MAX)
    await saveProfile({ id: newProfileId(), name, config: machine.config });
}

/** Interrupted prints of such a device that were begun with another machine file: connecting would end one that is held. */
export const endedBy = (device: KeptPrint['port'], config: string): readonly KeptPrint[] =>
  keptPrints.value.filter(
    ({ port, machine }) =>
      port.vendor === device.vendor && port.product === device.product && machine.config !== config,
  );

/** The board is ready, prints nothing and holds nothing: what was interrupted on it cannot go on with its next step. All that
 * is known is that it is such a board: another one of the kind may hold the print. */
const lost = computed<readonly KeptPrint[]>(() => {
  const [choice, isFree] = [port.value, isReady.value && !isPrinting.value];
  if (!isFree || choice?.kind !== 'serial' || heldPrint.value) return [];
  const { vendor, product } = choice.id;
  return keptPrints.value.filter(
    ({ port, machine }) =>
      port.vendor === vendor && port.product === product && machine.config === activeProfile.value.config,
  );
});

function tell(print: KeptPrint, isLost: boolean, connect: (print: KeptPrint) => void): void {
  const happened = `The print of ${print.facts.name} was interrupted on ${timeOf(print.heardOf)}${lineOf(print)}.`;
  const kind = KIND + print.id;
  const forget = { text: 'Forget it', act: () => forgetPrint(print.id) };
  if (isLost) {
    const line = lineAfter(print);
    const hope =
      line === null
        ? 'nothing had been printed yet'
        : 'it cannot go on with its next step, but it can from a line';
    return notify({
      kind,
      text: `${happened} This printer does not hold it. If another one does, connect that. If it was this one, ${hope}.`,
      ...(line !== null && {
        action: {
          text: 'Continue from a line…',
          act: () => void askToContinue(print),
          why: null,
        },
      }),
      other: forget,
    });
  }
  notify({
    kind,
    text: `${happened} Connect the printer to see whether it can go on; do not switch the printer off before.`,
    action: { text: 'Connect', act: () => connect(print), why: null },
    other: forget,
  });
}

/** `connect` opens the way to connect to the print's machine. */
export function followInterrupted(connect: (print: KeptPrint) => void): void {
  let told: readonly string[] = [];
  effect(() => {
    const isLost = lost.value.length > 0;
    const shown = (connection.value === 'closed' ? keptPrints.value : lost.value).slice(0, SHOWN_MAX);
    for (const id of told) if (!shown.some((print) => print.id === id)) withdraw(KIND + id);
    told = shown.map(({ id }) => id);
    for (const print of shown) tell(print, isLost, connect);
  });
  // The tab that had it open has let go of it, or is gone.
  let watching = 0;
  effect(() => {
    const now = watched.value.length;
    if (now < watching) lookForPrints();
    watching = now;
  });
  followTakenUp();
}

/** Where a print began, where that was not the beginning. */
const fromOf = ({ startLine }: KeptPrint, plan: Summary): Place | null =>
  startLine === null ? null : placeOf(plan, startLine);

/** The file of a print that was taken up is shown, and is what is printed. */
function followTakenUp(): void {
  effect(() => {
    const held = heldPrint.value;
    if (held?.kind !== 'held') return;
    const { name } = held.print.facts;
    const known = printed.peek()?.file;
    if (known?.name === name && known.blob.size === held.file.size) return;
    if (file.peek()?.blob !== held.file) openFile(held.file, name);
    const found = summary.value;
    if (found)
      printed.value = {
        file: { name, blob: held.file },
        summary: found,
        marks: lineMarks(),
        from: fromOf(held.print, found),
      };
  });
}
