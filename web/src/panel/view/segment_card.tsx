// What is known of a segment: all of it for the chosen one, in short for the one under the pointer.
import type { JSX } from 'preact';
import { command, type Segment, segment } from '../../state/inspect';
import { outline } from '../../state/preview';
import { cursor } from '../../state/view';
import { Fact } from '../facts';
import { machineSummary } from '../machine_summary';
import { formatNumber } from '../numbers';
import { Button } from '../parts';
import { hovered } from './canvas';
import { FEATURE_NAMES } from './words';

function kindOf({ geometry }: Segment): string {
  if (geometry.wipe) return 'Wipe';
  if (geometry.travel) return 'Travel';
  if (geometry.break) return 'Beginning of a path';
  return FEATURE_NAMES[geometry.feature];
}

const inMm = (value: number, decimals = 2): string =>
  value > 0 ? `${formatNumber(value, decimals)} mm` : '–';

/** In mm where the machine's filament is known, else in mm³. */
function filamentOf({ planned, geometry, lengthMm }: Segment): string {
  if (geometry.travel || geometry.break) return '–';
  const bead = geometry.widthMm * geometry.heightMm * lengthMm;
  const volume = planned ? planned.flow * planned.timeS : bead;
  const diameter = machineSummary.value?.filament;
  if (!(volume > 0)) return '–';
  if (!diameter) return `${formatNumber(volume, 3)} mm³`;
  return `${formatNumber(volume / ((Math.PI / 4) * diameter * diameter), 3)} mm`;
}

function time(seconds: number): string {
  if (!(seconds > 0)) return '–';
  return seconds < 1 ? `${formatNumber(seconds * 1000, 1)} ms` : `${formatNumber(seconds, 2)} s`;
}

function Planned({ of }: { readonly of: Segment }): JSX.Element {
  const plan = of.planned;
  const or = (value: number | undefined, unit: string, decimals = 0): string =>
    value === undefined ? '–' : `${formatNumber(value, decimals)} ${unit}`;
  return (
    <>
      <Fact name="Speed in the file">{or(plan?.feed, 'mm/s')}</Fact>
      <Fact name="Actual speed">
        {plan ? `${formatNumber(plan.meanSpeed)} (up to ${formatNumber(plan.peakSpeed)}) mm/s` : '–'}
      </Fact>
      <Fact name="Acceleration">{or(plan?.accel, 'mm/s²')}</Fact>
      <Fact name="Flow">{or(plan?.flow, 'mm³/s', 2)}</Fact>
      <Fact name="Time">{time(plan?.timeS ?? 0)}</Fact>
      <Fact name="Nozzle, fan">
        {plan ? `${formatNumber(plan.nozzle)} °C, ${formatNumber(plan.fan)} %` : '–'}
      </Fact>
    </>
  );
}

/** The chosen segment. */
export function SegmentCard(): JSX.Element | null {
  const of = segment.value;
  if (!of || cursor.value === null) return null;
  const { geometry, line } = of;
  const object = outline.value?.objects[geometry.object - 1];
  return (
    <section class="segment-card" aria-label="Segment">
      <header>
        <strong>{kindOf(of)}</strong>
        <span class="dim">{line === null ? '' : `Line ${formatNumber(line)}`}</span>
        <Button
          icon="close"
          kind="quiet"
          label="Put the choice away"
          onClick={() => {
            cursor.value = null;
          }}
        />
      </header>
      <p class="code segment-command">{command.value ?? '…'}</p>
      <dl class="facts">
        <Fact name="Layer">{formatNumber(geometry.layer + 1)}</Fact>
        <Fact name="Ends at">{geometry.positionMm.map((at) => formatNumber(at, 2)).join(', ')}</Fact>
        <Fact name="Length">{inMm(of.lengthMm)}</Fact>
        <Fact name="Width, height">
          {inMm(geometry.widthMm)}, {inMm(geometry.heightMm)}
        </Fact>
        <Fact name="Filament">{filamentOf(of)}</Fact>
        <Planned of={of} />
        <Fact name="Tool">T{geometry.tool}</Fact>
        {object && <Fact name="Object">{object.name}</Fact>}
      </dl>
    </section>
  );
}

/** Beside the pointer. */
export function HoverNote(): JSX.Element | null {
  const at = hovered.value;
  if (!at) return null;
  const { planned, line } = at.segment;
  return (
    <div class="hover-note" role="tooltip" style={{ left: `${at.x}px`, top: `${at.y}px` }}>
      <strong>{kindOf(at.segment)}</strong>
      {line !== null && <span>Line {formatNumber(line)}</span>}
      {planned && <span>{formatNumber(planned.meanSpeed)} mm/s</span>}
    </div>
  );
}
