// What may be changed while printing: speed, flow, fan.
import type { JSX } from 'preact';
import { connection, port, snapshot, wish } from '../state/machine';
import { share } from '../units';
import { machineSummary } from './machine_summary';
import { Card, NumberField } from './parts';
import { notReady } from './reasons';
import { VirtualSpeed } from './virtual_speed';

const percent = (value: number | undefined): number => Math.round((value ?? 0) * 100);

export function Tuning(): JSX.Element {
  const now = snapshot.value;
  const field = (
    label: string,
    kind: 'speed-factor' | 'flow-factor' | 'fan',
    value: number,
    min: number,
    max: number,
  ): JSX.Element => (
    <NumberField
      label={label}
      unit="%"
      value={value}
      min={min}
      max={max}
      why={notReady.value}
      acts
      onSet={(set) => void wish({ kind, value: share(set / 100) })}
    />
  );
  return (
    <Card title="Speed and fan">
      <div class="fields">
        {field('Speed', 'speed-factor', percent(now?.speedFactor ?? 1), 10, 300)}
        {field('Flow', 'flow-factor', percent(now?.flowFactor ?? 1), 10, 200)}
        {machineSummary.value?.hasFan !== false && field('Part fan', 'fan', percent(now?.fan), 0, 100)}
      </div>
      {notReady.value && <p class="hint">{notReady.value}</p>}
      {connection.value === 'open' && port.value?.kind === 'virtual' && (
        <VirtualSpeed label="Virtual printer" />
      )}
    </Card>
  );
}
