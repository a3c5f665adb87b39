// The print that a board holds after its page was gone: what is known of it, how far it has been taken up, and the
// user's word. Nothing here moves anything before that word.
import { computed, effect, signal } from '@preact/signals';
import type { JSX } from 'preact';
import type { HeldPrint, KeptPrint } from '../machine/protocol';
import { timeOf } from '../state/interrupted';
import { heldPrint } from '../state/kept';
import { giveHeldFile, job, snapshot, wish } from '../state/machine';
import { notify, withdraw } from '../state/notices';
import { EmergencyStop } from './emergency';
import { Fact } from './facts';
import { formatBytes, formatDuration, formatNumber } from './numbers';
import { pickWith } from './open_file';
import { Button, Dialog } from './parts';
import { ask } from './question';
import { Said } from './said';

/** The user wants to see something else first. */
const isPutAway = signal(false);
/** The user's word is on its way. */
const isUnderWay = signal(false);
/** It has been given: the print goes on, or heats before it does. */
const isResumed = signal(false);
const KIND = 'held-print';
const HEATERS = { extruder: 'Nozzle', heater_bed: 'Bed' } as const;

function restart(): void {
  ask({
    title: 'Restart the board?',
    text: 'The motors let go, the heaters are switched off, and everything has to be homed. The print cannot go on with its next step then, but from a line, as after a loss of power.',
    yes: 'Restart the board',
    no: 'Leave it as it is',
    act: () => void wish({ kind: 'firmware-restart' }),
  });
}

function cancel(): void {
  ask({
    title: 'End the print?',
    text: 'It cannot be continued. The heaters are switched off.',
    yes: 'End the print',
    no: 'Leave it held',
    act: () => void wish({ kind: 'cancel' }),
  });
}

async function resume(): Promise<void> {
  if (isUnderWay.value) return;
  isUnderWay.value = true;
  isResumed.value = await wish({ kind: 'resume' });
  isUnderWay.value = false;
}

/** The print waits for the user's word: held on its path, or paused with its head parked. */
const isWaiting = computed(() => job.value === 'held' || job.value === 'paused');

/** How long it has been so, in words. */
function since(ms: number): string {
  const seconds = Math.max(0, (Date.now() - ms) / 1000);
  return seconds < 60 ? 'less than a minute' : formatDuration(seconds);
}

function Known({ print }: { readonly print: KeptPrint }): JSX.Element {
  const { facts, line, elapsed, heardOf } = print;
  return (
    <dl class="facts">
      <Fact name="File">{facts.name}</Fact>
      <Fact name="Last known line">
        {line > 0 ? `${formatNumber(line)} of ${formatNumber(facts.lines)}` : '–'}
      </Fact>
      <Fact name="Printed">
        {formatDuration(elapsed)}
        {facts.time !== null && ` of ${formatDuration(facts.time)}`}
      </Fact>
      <Fact name="Last heard of">{timeOf(heardOf)}</Fact>
      <Fact name={job.value === 'paused' ? 'Paused for' : 'Held for'}>{since(heardOf)}</Fact>
      {snapshot.value?.heaters.map(({ name, temperature, target, isStandby }) => (
        <Fact key={name} name={HEATERS[name]}>
          {formatNumber(temperature, 1)} °C{target > 0 && ` of ${formatNumber(target)}`}
          {isStandby && ', stand-by'}
        </Fact>
      ))}
    </dl>
  );
}

const Restart = (): JSX.Element => (
  <Button kind="danger" class="big" onClick={restart}>
    Restart the board
  </Button>
);

const OpenFile = ({ text }: { readonly text: string }): JSX.Element => (
  <Button kind="primary" class="big" icon="file" onClick={() => pickWith(giveHeldFile)}>
    {text}
  </Button>
);

function Body({ held }: { readonly held: HeldPrint }): JSX.Element {
  switch (held.kind) {
    case 'looking':
      return <p role="status">The board holds a print. Looking for what is known of it here.</p>;
    case 'unknown':
      return (
        <>
          <p>
            The board holds a print that this browser does not know: it was begun on another computer or in
            another browser, or what was kept of it is gone. The head rests on its path.
          </p>
          {held.trouble && <Said of={held.trouble} />}
          <p>
            Where it was begun it can go on with its next step: disconnect here and connect there. From here
            the board can only be restarted, which ends the print.
          </p>
          <div class="dialog-foot">
            <Restart />
          </div>
        </>
      );
    case 'finding':
      return (
        <>
          <p role="status">Finding the place in {held.print.facts.name}. Nothing moves.</p>
          <progress max={1} value={held.share} aria-label="Finding the place in the file" />
          <Known print={held.print} />
        </>
      );
    case 'needs-file':
      return (
        <>
          <p>
            The board holds the print of {held.print.facts.name}, but there is no whole copy of its file here.
            Open the very file that it was started with ({formatBytes(held.print.fileBytes)}); nothing moves
            by that.
          </p>
          {held.trouble && <Said of={held.trouble} />}
          <Known print={held.print} />
          <div class="dialog-foot">
            <Restart />
            <OpenFile text="Open the file" />
          </div>
        </>
      );
    case 'refused':
      return (
        <>
          <Said of={held.trouble} />
          <p>
            What is printed so far stays on the bed. The board goes on holding it until it is restarted or
            switched off; after that the print can go on from a line.
          </p>
          <Known print={held.print} />
          <div class="dialog-foot">
            <Restart />
            <OpenFile text="Try with its file" />
          </div>
        </>
      );
    case 'held':
      return (
        <>
          <p>
            {job.value === 'paused'
              ? 'The page that printed this is gone. The print was paused, and still is: the head is parked, or where it was moved to. No step is lost.'
              : 'The page that printed this is gone, and the board held the print: the head rests on its path, with no step lost.'}{' '}
            Look at the part first: does it still stick to the bed, is the nozzle free? Then resume
            {job.value === 'paused' &&
              ': what has cooled is heated, the head goes back, and the print goes on'}{' '}
            with the very next step, or end the print.
          </p>
          <Known print={held.print} />
          <div class="dialog-foot">
            <Button kind="danger" class="big" disabled={!isWaiting.value} onClick={cancel}>
              Cancel
            </Button>
            <Button
              kind="primary"
              icon="play"
              class="big"
              busy={isUnderWay.value}
              disabled={!isWaiting.value}
              onClick={() => void resume()}
            >
              Resume
            </Button>
          </div>
        </>
      );
  }
}

/** Taken up, a print that was paused is nothing that the board holds any more. */
const titleOf = ({ kind }: HeldPrint): string =>
  kind === 'held' && job.value === 'paused' ? 'A paused print' : 'The board holds a print';

/** Open as long as there is something to be decided, unless it is put away. */
export function HeldDialog(): JSX.Element | null {
  const held = heldPrint.value;
  if (!held || isPutAway.value || isResumed.value) return null;
  return (
    <Dialog title={titleOf(held)} aside={<EmergencyStop />} onClose={() => (isPutAway.value = true)}>
      <div class="stack">
        <Body held={held} />
      </div>
    </Dialog>
  );
}

/** Put away, a line in the page leads back. */
export function followHeld(): void {
  let hasGoneOn = false;
  effect(() => {
    const [held, waits] = [heldPrint.value?.kind === 'held', isWaiting.value];
    if (held && isResumed.value && (!waits || !hasGoneOn)) {
      hasGoneOn ||= !waits;
      return;
    }
    // Held anew, or no longer at all.
    hasGoneOn = false;
    isResumed.value = false;
  });
  effect(() => {
    if (heldPrint.value === null) {
      isPutAway.value = false;
      withdraw(KIND);
    } else if (isPutAway.value)
      notify({
        kind: KIND,
        text: `${titleOf(heldPrint.value)}.`,
        isFixed: true,
        action: { text: 'Show', act: () => (isPutAway.value = false), why: null },
      });
    else withdraw(KIND);
  });
}
