// What there is to do before a print goes on that begins in the middle of its file: say where Z is, home X and Y, look at
// the part. Step by step, beside the controls for moving by hand; Resume waits for all of it.
import { signal } from '@preact/signals';
import type { ComponentChildren, JSX } from 'preact';
import { job, snapshot, wish } from '../state/machine';
import { isPartThere, liftBefore, type Starting, starting } from '../state/start';
import { mm } from '../units';
import { Icon } from './icons';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, NumberField } from './parts';

const Z = 2;
/** A sheet of paper. */
const PAPER_MM = 0.1;

/** What is typed for Z; null: what is proposed. */
const typedZ = signal<{ readonly of: Starting; readonly z: number } | null>(null);
/** Homing has been asked for, and is not over yet. */
const isHoming = signal(false);

const axisZ = () => machineSummary.value?.axes[Z];

/** Where Z stands, as far as that is known. */
const knownZ = (): number | null =>
  snapshot.value?.homed[Z] ? (snapshot.value.position?.[Z] ?? null) : null;

/** Up, so that the nozzle does not drag over the part, then X and Y. Where Z is not known nothing is lifted, and nothing homed. */
export async function liftAndHome(): Promise<void> {
  const [begun, axis, z] = [starting.value, axisZ(), knownZ()];
  if (!begun || !axis || z === null || isHoming.value) return;
  isHoming.value = true;
  const lift = liftBefore(z, begun.place.top, axis);
  const isLifted = lift === 0 || (await wish({ kind: 'jog', axis: 'Z', distance: lift }));
  if (isLifted) await wish({ kind: 'home', axes: ['X', 'Y'] });
  isHoming.value = false;
}

interface StepProps {
  readonly title: string;
  readonly isDone: boolean;
  readonly children: ComponentChildren;
}

function Step({ title, isDone, children }: StepProps): JSX.Element {
  return (
    <li class={isDone ? 'step done' : 'step'}>
      <span class="step-mark">{isDone && <Icon name="check" />}</span>
      <div class="step-body">
        <h3>
          {title}
          {isDone && <span class="unseen"> (done)</span>}
        </h3>
        {children}
      </div>
    </li>
  );
}

function SayZ({ begun }: { readonly begun: Starting }): JSX.Element {
  const axis = axisZ();
  const known = knownZ();
  const { top, z } = begun.place;
  const [min, max] = [axis?.min ?? 0, axis?.max ?? 0];
  const proposed = known ?? (begun.lost ? (z ?? top) : top);
  const typed = typedZ.value?.of === begun ? typedZ.value.z : null;
  const value = Math.min(Math.max(typed ?? proposed, min), max);
  const say = async (): Promise<void> => {
    if (await wish({ kind: 'set-position', axis: 'Z', position: mm(value) })) typedZ.value = null;
  };
  return (
    <Step title="Where Z stands" isDone={known !== null}>
      <p>
        {known === null
          ? 'Z cannot be homed with the part in the way: say where the nozzle is.'
          : `Taken to stand at ${formatNumber(known, 2)} mm. Where that is not so, correct it.`}
        {begun.lost && known === null && ' What is proposed is where it was when it was last heard of.'}
      </p>
      <p class="hint">
        Once something is said, Z can be moved under Motion. Go down until a sheet of paper just slides: on
        the bed, beside the part, that is {formatNumber(PAPER_MM, 1)} mm, on top of the part{' '}
        {formatNumber(top + PAPER_MM, 2)} mm. Then say so here.
      </p>
      <div class="row wrap end">
        <NumberField
          label="Z stands at"
          unit="mm"
          value={value}
          min={min}
          max={max}
          decimals={2}
          onSet={(number) => {
            typedZ.value = { of: begun, z: number };
          }}
        />
        <Button kind={known === null ? 'primary' : 'plain'} onClick={() => void say()}>
          {known === null ? 'Z is there' : 'Correct Z'}
        </Button>
      </div>
    </Step>
  );
}

function HomeXY({ begun }: { readonly begun: Starting }): JSX.Element {
  const [x, y] = snapshot.value?.homed ?? [false, false];
  const isDone = Boolean(x && y);
  const [axis, z] = [axisZ(), knownZ()];
  const lift = axis && z !== null ? liftBefore(z, begun.place.top, axis) : 0;
  const above = formatNumber((z ?? 0) + lift, 2);
  return (
    <Step title="Home X and Y" isDone={isDone}>
      {isDone ? (
        <p>X and Y are homed.</p>
      ) : (
        <>
          <p>
            The head goes {lift > 0 ? `up to ${above} mm, then ` : ''}to the switches of X and Y. Keep the way
            free.
          </p>
          <div class="row wrap">
            <Button
              kind={z === null ? 'plain' : 'primary'}
              icon="home"
              busy={isHoming.value}
              why={z === null ? 'Say first where Z is: the nozzle may stand on the part.' : null}
              onClick={() => void liftAndHome()}
            >
              Lift and home X and Y
            </Button>
            {z === null && <span class="hint">Say first where Z is: the nozzle may stand on the part.</span>}
          </div>
        </>
      )}
    </Step>
  );
}

function LookAtPart(): JSX.Element {
  return (
    <Step title="Look at the part" isDone={isPartThere.value}>
      <label class="check">
        <input
          type="checkbox"
          checked={isPartThere.value}
          onChange={(event) => {
            isPartThere.value = event.currentTarget.checked;
          }}
        />
        It still sticks to the bed where it was, and nothing stands out of it.
      </label>
    </Step>
  );
}

/** The steps, while a print waits to begin; nothing otherwise. */
export function StartSteps(): JSX.Element | null {
  const begun = starting.value;
  if (!begun || job.value !== 'paused') return null;
  const { line, layer, z } = begun.place;
  return (
    <section class="start-steps" aria-label="Before it goes on">
      <p>
        The print begins with line {formatNumber(line)}
        {z !== null && `, in layer ${formatNumber(layer)} at ${formatNumber(z, 2)} mm`}. Three things first;
        then press Resume.
      </p>
      <ol>
        <SayZ begun={begun} />
        <HomeXY begun={begun} />
        <LookAtPart />
      </ol>
    </section>
  );
}
