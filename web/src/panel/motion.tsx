// Moving by hand: position, home, jog, extrude, motors off.
import type { JSX } from 'preact';
import type { Axis } from '../machine/protocol';
import { isReady, isShutdown, mayMove, snapshot, wish } from '../state/machine';
import { change, JOG_STEPS, settings } from '../state/settings';
import { mm } from '../units';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, Card, Choice, NumberField } from './parts';

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

const extrude = (length: number): void => void wish({ kind: 'extrude', length: mm(length) });

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

function JogPad(): JSX.Element {
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
      disabled={!mayMove.value || !homed[AXES.indexOf(axis)]}
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
          disabled={!mayMove.value}
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
  if (isShutdown.value) return 'The board has stopped: restart it first.';
  if (!isReady.value) return 'Connect a printer to move it.';
  if (!mayMove.value) return 'While a print runs, the print moves the head. Pause it to move by hand.';
  if (!(snapshot.value?.homed ?? []).every(Boolean))
    return 'Home first: until then the position is not known.';
  return null;
}

export function Motion(): JSX.Element {
  const { jogStep, extrudeLength } = settings.value;
  const why = reason();
  return (
    <Card title="Motion" aside={<Position />}>
      <Choice
        label="Step size"
        choices={JOG_STEPS.map((value) => ({ value, text: `${formatNumber(value, 1, 0)} mm` }))}
        value={jogStep as (typeof JOG_STEPS)[number]}
        onSet={(value) => change({ jogStep: value })}
      />
      <JogPad />
      {why && <p class="hint">{why}</p>}
      <div class="row wrap end">
        <NumberField
          label="Filament"
          unit="mm"
          value={extrudeLength}
          min={0.1}
          max={100}
          decimals={1}
          onSet={(value) => change({ extrudeLength: value })}
        />
        <Button disabled={!mayMove.value} onClick={() => extrude(extrudeLength)}>
          Extrude
        </Button>
        <Button disabled={!mayMove.value} onClick={() => extrude(-extrudeLength)}>
          Retract
        </Button>
      </div>
      <div class="row wrap">
        {AXES.map((axis) => (
          <Button
            key={axis}
            disabled={!mayMove.value}
            onClick={() => void wish({ kind: 'home', axes: [axis] })}
          >
            Home {axis}
          </Button>
        ))}
        <Button disabled={!mayMove.value} onClick={() => void wish({ kind: 'motors-off' })}>
          Motors off
        </Button>
      </div>
    </Card>
  );
}
