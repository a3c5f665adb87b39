// What there is to do before a print goes on that begins in the middle of its file: say where Z stands, and look at the
// part. Step by step, beside the controls for moving by hand; Resume waits for it.
import { signal } from '@preact/signals';
import type { ComponentChildren, JSX } from 'preact';
import type { Interruption, StartAt } from '../machine/protocol';
import { snapshot, wish } from '../state/machine';
import {
  isPartThere,
  isToBegin,
  nearestPlace,
  noteZ,
  overBed,
  placeNear,
  type Starting,
  starting,
} from '../state/start';
import { mm } from '../units';
import { Icon } from './icons';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, Choice, NumberField } from './parts';

const Z = 2;
/** A sheet of paper. */
const PAPER_MM = 0.1;
/** Nearer than this is the same. */
const NEAR_MM = 0.005;

/** What is typed for Z; null: what is proposed. */
const typedZ = signal<{ readonly of: Starting; readonly z: number } | null>(null);
const axisZ = () => machineSummary.value?.axes[Z];

/** Where Z stands, as far as that is known. */
const knownZ = (): number | null =>
  snapshot.value?.homed[Z] ? (snapshot.value.position?.[Z] ?? null) : null;

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

const millimetres = (z: number): string => `${formatNumber(z, 2)} mm`;

interface WhereProps {
  readonly at: Interruption;
  /** What the user has said so far. */
  readonly typed: number | null;
}

/** What the file, the journal and the motor say of Z. */
function WhereZWas({ at, typed }: WhereProps): JSX.Element {
  const { zRange, zPlaces, zPitch, zError } = at;
  if (!zRange) return <p>Z was being moved by hand or homed when the print was interrupted.</p>;
  const [low, high] = zRange;
  const was =
    high - low < NEAR_MM ? `at ${millimetres(low)}` : `between ${millimetres(low)} and ${millimetres(high)}`;
  if (zPlaces.length === 0)
    return (
      <p>
        Z was {was}. It may stand up to {millimetres(zError)} from there now.
      </p>
    );
  const places =
    zPlaces.length === 1
      ? 'this place'
      : `one of these places, ${millimetres(zPitch)} apart, the likeliest first`;
  const doubt = zError >= NEAR_MM ? `, give or take ${millimetres(zError)}` : '';
  return (
    <>
      <p>
        Z was {was}. If board and motors lost their power together and got it back together, and the head has
        not sunk, it stands at {places}
        {doubt}. Not so if the board was only restarted, or had power from USB meanwhile. Choose, then check
        with the paper.
      </p>
      <Choice
        label="Places where Z can stand"
        hideLabel
        choices={zPlaces.map((place, value) => ({ value, text: millimetres(place) }))}
        value={zPlaces.findIndex((place) => typed !== null && Math.abs(place - typed) < NEAR_MM)}
        onSet={(index) => type(zPlaces[index] ?? 0)}
      />
    </>
  );
}

interface NearestProps {
  readonly base: number;
  readonly pitch: number;
  readonly value: number;
}

/** Below the button, which must not move while it is pressed. */
function Nearest({ base, pitch, value }: NearestProps): JSX.Element | null {
  const nearest = nearestPlace(base, pitch, value);
  if (Math.abs(nearest - value) <= NEAR_MM) return null;
  return (
    <div class="row wrap">
      <span class="hint">As far as is known, the motor stands at {millimetres(nearest)} then.</span>
      <Button onClick={() => type(nearest)}>Take {millimetres(nearest)}</Button>
    </div>
  );
}

function type(z: number): void {
  const of = starting.value;
  if (of) typedZ.value = { of, z };
}

function SayZ({ begun }: { readonly begun: Starting }): JSX.Element {
  const axis = axisZ();
  const known = knownZ();
  // The motor's places, which stay where they are, are told as heights over the bed, as everything that is typed.
  const lift = snapshot.value?.zLift ?? 0;
  const motor = (z: number | null): number | null => (z === null ? null : z + lift);
  const { place } = begun;
  const at = overBed(begun.at, lift);
  const [min, max] = [axis?.min ?? 0, axis?.max ?? 0];
  const proposed = known ?? at?.zPlaces[0] ?? at?.zRange?.[0] ?? place.top;
  const typed = typedZ.value?.of === begun ? typedZ.value.z : null;
  const value = Math.min(Math.max(typed ?? proposed, min), max);
  const near = placeNear(begun.at, motor(known));
  const base = near === null ? null : near - lift;
  // What the motor says is proposed, and claimed by nobody but the user.
  const isSaid = known !== null || typed !== null;
  const say = async (): Promise<void> => {
    if (!(await wish({ kind: 'set-position', axis: 'Z', position: mm(value) }))) return;
    noteZ(begun, motor(known), value + lift);
    typedZ.value = null;
  };
  return (
    <Step title="Where Z stands" isDone={known !== null}>
      {known === null ? (
        <p>Z cannot be homed with the part in the way: say where the nozzle is.</p>
      ) : (
        <p>
          Taken to stand at {millimetres(known)}. Check it with a sheet of paper; where it is not so, correct
          it.
        </p>
      )}
      <p>
        To measure: say what is likely, then move Z under Motion until a sheet of paper just slides. On the
        bed, beside the part, that is {formatNumber(PAPER_MM, 1)} mm; on top of the part{' '}
        {millimetres(place.top + PAPER_MM)}. Then correct it here.
      </p>
      {at && known === null && <WhereZWas at={at} typed={typed} />}
      <div class="row wrap end">
        <NumberField
          label="Z stands at"
          unit="mm"
          value={value}
          min={min}
          max={max}
          decimals={3}
          live
          onSet={type}
        />
        <Button
          kind={known === null ? 'primary' : 'plain'}
          why={
            isSaid
              ? null
              : at?.zPlaces.length
                ? 'Type where Z stands, or choose a place.'
                : 'Type where Z stands first.'
          }
          onClick={() => void say()}
        >
          {known === null ? 'Z stands there' : 'Correct Z'}
        </Button>
      </div>
      {base !== null && typed !== null && <Nearest base={base} pitch={at?.zPitch ?? 0} value={value} />}
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

/** What is heated up there, in words. */
function heatedTo(start: StartAt | null): string {
  const [nozzle, bed] = [start?.nozzle ?? 0, start?.bed ?? 0].map((target) => `${formatNumber(target)} °C`);
  if (start && start.nozzle > 0)
    return `the nozzle is heated to ${nozzle}${start.bed > 0 ? `, the bed to ${bed}` : ''}`;
  return start && start.bed > 0 ? `the bed is heated to ${bed}` : 'nothing is heated';
}

/** The steps, while a print waits to begin; nothing otherwise. */
export function StartSteps(): JSX.Element | null {
  const begun = starting.value;
  if (!begun || !isToBegin.value) return null;
  const { line, layer, z } = begun.place;
  const { homed = [false, false, false], start = null } = snapshot.value ?? {};
  const homes = ['X', 'Y'].filter((_, axis) => !homed[axis]).join(' and ');
  return (
    <section class="start-steps" aria-label="Before it goes on">
      <p>
        The print begins with line {formatNumber(line)}
        {z !== null && `, in layer ${formatNumber(layer)} at ${millimetres(z)}`}. Two things first:
      </p>
      <ol>
        <SayZ begun={begun} />
        <LookAtPart />
      </ol>
      <p>
        Then press Resume: the nozzle gets warm enough to come free and goes up to{' '}
        {millimetres(start?.clearZ ?? 0)},{' '}
        {homes !== '' && `${homes} ${homes.length > 1 ? 'are' : 'is'} homed, `}
        {heatedTo(start)}, and it goes across, down, and on. Keep the way free.
      </p>
    </section>
  );
}
