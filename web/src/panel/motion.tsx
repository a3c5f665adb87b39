// Moving by hand: position, home, jog, extrude, motors off.
import { computed } from '@preact/signals';
import type { JSX } from 'preact';
import type { Axis } from '../machine/protocol';
import { isReady, snapshot, wish } from '../state/machine';
import { change, EXTRUDE_MAX_MM, EXTRUDE_SPEED_MAX_MM_S, JOG_STEPS, settings } from '../state/settings';
import { isToBegin } from '../state/start';
import { mm } from '../units';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, Card, Choice, NumberField } from './parts';
import { ask } from './question';
import { notFree } from './reasons';

const AXES = ['X', 'Y', 'Z'] as const;

/** How far a step may go from where the head is without leaving the machine. */
function reach(axis: Axis, step: number): number {
  const range = machineSummary.value?.axes.find(({ name }) => name === axis);
  const at = snapshot.value?.position?.[AXES.indexOf(axis)];
  if (!range || at === undefined) return step;
  return Math.min(Math.max(at + step, range.min), range.max) - at;
}

function jog(axis: Axis, step: number): void {
  const way = reach(axis, step);
  if (Math.abs(way) < 1e-4) return;
  void wish({ kind: 'jog', axis, distance: mm(way) });
}

function Position(): JSX.Element | null {
  if (!isReady.value) return null;
  const position = snapshot.value?.position;
  return (
    <dl class="position">
      {AXES.map((axis, index) => (
        <div key={axis}>
          <dt>{axis}</dt>
          <dd>
            {position && snapshot.value?.homed[index] ? (
              formatNumber(position[index] ?? 0, 2)
            ) : (
              <>
                <span aria-hidden="true">–</span>
                <span class="unseen">not homed</span>
              </>
            )}
          </dd>
        </div>
      ))}
    </dl>
  );
}

/** Before a print begins in the middle of its file: why axes are not homed by hand. */
const notHomed = computed<string | null>(() =>
  isToBegin.value ? 'Resume homes X and Y by itself, once the nozzle is above the part.' : null,
);

/** With the part on the bed a switch below it is reached through the part. */
function homeZ(): void {
  const home = (): void => void wish({ kind: 'home', axes: ['Z'] });
  if (!isToBegin.value) return home();
  ask({
    title: 'Home Z with a part on the bed?',
    text: 'The nozzle goes to the switch of Z wherever the head is now. Where that switch is below, it runs into whatever stands there.',
    yes: 'Home Z',
    no: 'Do not',
    act: home,
  });
}

function JogPad({ why }: { readonly why: string | null }): JSX.Element {
  const step = settings.value.jogStep;
  const homed = snapshot.value?.homed ?? [false, false, false];
  const button = (
    axis: Axis,
    sign: 1 | -1,
    icon: 'up' | 'down' | 'left' | 'right',
    words: string,
    at: string,
  ): JSX.Element => (
    <Button
      icon={icon}
      class={`jog ${at}`}
      label={`${words} ${formatNumber(step, 1, 0)} mm`}
      why={homed[AXES.indexOf(axis)] ? notFree.value : why}
      onClick={() => jog(axis, sign * step)}
    />
  );
  return (
    <div class="jog-pads">
      <fieldset class="jog-xy">
        <legend class="unseen">Move X and Y</legend>
        {button('Y', 1, 'up', 'Back', 'north')}
        {button('X', -1, 'left', 'Left', 'west')}
        <Button
          icon="home"
          class="jog centre"
          label="Home all axes"
          why={notFree.value ?? notHomed.value}
          onClick={() => void wish({ kind: 'home', axes: [] })}
        />
        {button('X', 1, 'right', 'Right', 'east')}
        {button('Y', -1, 'down', 'Front', 'south')}
      </fieldset>
      <fieldset class="jog-z">
        <legend class="unseen">Move Z</legend>
        {button('Z', 1, 'up', 'Up', '')}
        <span class="jog-label" aria-hidden="true">
          Z
        </span>
        {button('Z', -1, 'down', 'Down', '')}
      </fieldset>
    </div>
  );
}

function reason(): string | null {
  if (notFree.value) return notFree.value;
  if (isToBegin.value)
    return snapshot.value?.homed[2] ? 'Resume homes X and Y.' : 'Say first where Z stands: see Print.';
  if (!(snapshot.value?.homed ?? []).every(Boolean))
    return 'Home first: until then the position is not known.';
  return null;
}

/** Why no filament can be pushed. */
function coldReason(): string | null {
  if (notFree.value) return notFree.value;
  const min = machineSummary.value?.heaters.find(({ name }) => name === 'extruder')?.extrudeMin ?? null;
  const now = snapshot.value?.heaters.find(({ name }) => name === 'extruder')?.temperature;
  if (min === null || now === undefined || now >= min) return null;
  return `The nozzle is too cold to push filament: ${formatNumber(now)}\u00a0°C, at least ${formatNumber(min)}\u00a0°C are needed.`;
}

function Filament(): JSX.Element {
  const { extrudeLength, extrudeSpeed } = settings.value;
  const machine = machineSummary.value;
  const lengthMax = Math.min(EXTRUDE_MAX_MM, machine?.extrudeMax ?? EXTRUDE_MAX_MM);
  const speedMax = Math.min(EXTRUDE_SPEED_MAX_MM_S, machine?.extrudeSpeedMax ?? EXTRUDE_SPEED_MAX_MM_S);
  const why = coldReason();
  const push = (direction: 1 | -1): void =>
    void wish({
      kind: 'extrude',
      length: mm(direction * Math.min(extrudeLength, lengthMax)),
      speed: Math.min(extrudeSpeed, speedMax),
    });
  return (
    <fieldset class="stack">
      <legend class="unseen">Filament</legend>
      <div class="row wrap end filament">
        <NumberField
          label="Filament"
          unit="mm"
          value={Math.min(extrudeLength, lengthMax)}
          min={0.1}
          max={lengthMax}
          decimals={1}
          onSet={(value) => change({ extrudeLength: value })}
        />
        <NumberField
          label="Feed rate"
          unit="mm/s"
          value={Math.min(extrudeSpeed, speedMax)}
          min={0.1}
          max={speedMax}
          decimals={1}
          onSet={(value) => change({ extrudeSpeed: value })}
        />
        <Button why={why} onClick={() => push(1)}>
          Extrude
        </Button>
        <Button why={why} onClick={() => push(-1)}>
          Retract
        </Button>
      </div>
      {why && why !== notFree.value && <p class="hint">{why}</p>}
    </fieldset>
  );
}

export function Motion(): JSX.Element {
  const why = reason();
  return (
    <Card title="Motion" aside={<Position />}>
      <Choice
        label="Step size"
        hideLabel
        choices={JOG_STEPS.map((value) => ({ value, text: `${formatNumber(value, 1, 0)} mm` }))}
        value={settings.value.jogStep as (typeof JOG_STEPS)[number]}
        onSet={(value) => change({ jogStep: value })}
      />
      <JogPad why={why} />
      <div class="row homing">
        <span class="dim" aria-hidden="true">
          Home
        </span>
        {AXES.map((axis) => (
          <Button
            key={axis}
            label={`Home ${axis}`}
            why={notFree.value ?? (axis === 'Z' ? null : notHomed.value)}
            onClick={() => (axis === 'Z' ? homeZ() : void wish({ kind: 'home', axes: [axis] }))}
          >
            {axis}
          </Button>
        ))}
        <Button class="last" why={notFree.value} onClick={() => void wish({ kind: 'motors-off' })}>
          Motors off
        </Button>
      </div>
      {why && <p class="hint">{why}</p>}
      <Filament />
    </Card>
  );
}
