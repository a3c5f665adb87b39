// Temperatures, their targets, presets for materials.
import type { JSX } from 'preact';
import type { HeaterName, HeaterState } from '../machine/protocol';
import { isReady, isStale, snapshot, wish } from '../state/machine';
import { HEATING_BELOW_K } from '../state/print';
import { type Preset, settings } from '../state/settings';
import { celsius } from '../units';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, Card, NumberField } from './parts';
import { notReady } from './reasons';

const NAMES: Record<HeaterName, string> = { extruder: 'Nozzle', heater_bed: 'Bed' };
/** Where the machine's file sets no limit that is known here; the planner refuses what it forbids. */
const TARGET_MAX_C = 500;
/** Warmer than this burns. */
const HOT_C = 50;

const setTarget = (heater: HeaterName, target: number): void =>
  void wish({ kind: 'temperature', heater, target: celsius(target) });

function apply(preset: Preset): void {
  const heaters = snapshot.value?.heaters.map(({ name }) => name) ?? [];
  if (heaters.includes('extruder')) setTarget('extruder', preset.nozzle);
  if (heaters.includes('heater_bed')) setTarget('heater_bed', preset.bed);
}

/** What the heater does. Without a board that answers nothing is known but what was read last. */
function doing(heater: HeaterState | undefined): string {
  if (!heater) return 'Not known';
  if (!isReady.value || isStale.value) return 'Last reading';
  const { temperature, target, duty, isStandby } = heater;
  if (isStandby) return 'Stand-by';
  if (target === 0) return 'Off';
  const word = target - temperature > HEATING_BELOW_K ? 'Heating' : 'Holding';
  return `${word}, ${formatNumber(duty * 100)} %`;
}

interface HeaterProps {
  readonly name: HeaterName;
  readonly heater: HeaterState | undefined;
}

function Heater({ name, heater }: HeaterProps): JSX.Element {
  const max = machineSummary.value?.heaters.find((limits) => limits.name === name)?.max ?? TARGET_MAX_C;
  const isHot = heater !== undefined && heater.temperature >= HOT_C;
  const isOn = isReady.value && heater !== undefined && heater.target > 0;
  return (
    <li class="heater">
      <div class="heater-name">
        {NAMES[name]}
        <span class="heater-duty" title="What it does, and the share of the time that it is on">
          {doing(heater)}
        </span>
      </div>
      <div class={`heater-reading ${isHot ? 'hot' : ''} ${isReady.value && !isStale.value ? '' : 'old'}`}>
        {heater ? formatNumber(heater.temperature, 1) : '–'}
        <span class="unit"> °C</span>
      </div>
      <NumberField
        label={`${NAMES[name]} target`}
        hideLabel
        unit="°C"
        value={isReady.value ? (heater?.target ?? 0) : 0}
        min={0}
        max={max}
        why={notReady.value}
        acts
        onSet={(target) => setTarget(name, target)}
      />
      <Button
        label={`${NAMES[name]} off`}
        disabled={!isOn}
        why={notReady.value}
        onClick={() => setTarget(name, 0)}
      >
        Off
      </Button>
    </li>
  );
}

export function Temperatures(): JSX.Element {
  const read = snapshot.value?.heaters ?? [];
  // Before a printer is connected, the heaters that its file has.
  const names = read.length > 0 ? read : (machineSummary.value?.heaters ?? []);
  return (
    <Card title="Temperatures">
      <ul class="heaters">
        {names.map(({ name }) => (
          <Heater key={name} name={name} heater={read.find((heater) => heater.name === name)} />
        ))}
      </ul>
      <fieldset class="row wrap">
        <legend class="unseen">Presets</legend>
        {settings.value.presets.map((preset, index) => (
          <Button key={index} why={notReady.value} onClick={() => apply(preset)}>
            {preset.name}
          </Button>
        ))}
        <Button why={notReady.value} onClick={() => apply({ name: '', nozzle: 0, bed: 0 })}>
          Cool down
        </Button>
      </fieldset>
      {notReady.value && <p class="hint">{notReady.value}</p>}
    </Card>
  );
}
