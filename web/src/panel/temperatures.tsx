// Temperatures, their targets, presets for materials.
import type { JSX } from 'preact';
import type { HeaterName, HeaterState } from '../machine/protocol';
import { isReady, snapshot, wish } from '../state/machine';
import { type Preset, settings } from '../state/settings';
import { celsius } from '../units';
import { machineSummary } from './machine_summary';
import { formatNumber } from './numbers';
import { Button, Card, NumberField } from './parts';

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
function doing({ target, duty }: HeaterState): string {
  if (!isReady.value) return 'Last reading';
  return target > 0 ? `Heating ${formatNumber(duty * 100)} %` : 'Off';
}

function Heater({ heater }: { readonly heater: HeaterState }): JSX.Element {
  const max = machineSummary.value?.heaters.find(({ name }) => name === heater.name)?.max ?? TARGET_MAX_C;
  const name = NAMES[heater.name];
  return (
    <li class="heater">
      <div class="heater-name">
        {name}
        <span class="heater-duty">{doing(heater)}</span>
      </div>
      <div class={`heater-reading ${heater.temperature >= HOT_C ? 'hot' : ''} ${isReady.value ? '' : 'old'}`}>
        {formatNumber(heater.temperature, 1)}
        <span class="unit"> °C</span>
      </div>
      <NumberField
        label={`${name} target`}
        hideLabel
        unit="°C"
        value={isReady.value ? heater.target : 0}
        min={0}
        max={max}
        disabled={!isReady.value}
        onSet={(target) => setTarget(heater.name, target)}
      />
    </li>
  );
}

export function Temperatures(): JSX.Element {
  const heaters = snapshot.value?.heaters ?? [];
  return (
    <Card title="Temperatures">
      {heaters.length > 0 ? (
        <ul class="heaters">
          {heaters.map((heater) => (
            <Heater key={heater.name} heater={heater} />
          ))}
        </ul>
      ) : (
        <p class="hint">Shown once a printer is connected.</p>
      )}
      <fieldset class="row wrap">
        <legend class="unseen">Presets</legend>
        {settings.value.presets.map((preset) => (
          <Button key={preset.name} disabled={!isReady.value} onClick={() => apply(preset)}>
            {preset.name}
          </Button>
        ))}
        <Button disabled={!isReady.value} onClick={() => apply({ name: '', nozzle: 0, bed: 0 })}>
          Cool down
        </Button>
      </fieldset>
    </Card>
  );
}
