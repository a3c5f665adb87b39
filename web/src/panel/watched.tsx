// Machines that other tabs drive, as they are: to look at, and to stop.
import type { JSX } from 'preact';
import type { MachineView } from '../machine/broadcast_protocol';
import type { Snapshot } from '../machine/protocol';
import { isViewing, stopWatched, type Watched, watched } from '../state/watched';
import { Fact } from './facts';
import { Icon } from './icons';
import { formatDuration, formatNumber } from './numbers';
import { Card } from './parts';
import { statusOf } from './top_bar';

const HEATERS = { extruder: 'Nozzle', heater_bed: 'Bed' } as const;
const OUTCOMES = {
  done: 'The print is done.',
  cancelled: 'The print was cancelled.',
  stopped: 'The print stopped before its end. It does not start again by itself.',
} as const;
/** The slowest that the plan's rest is reckoned with. */
const SPEED_FACTOR_MIN = 0.1;

/** How much of the print is done, by time where the plan is known, else by lines; 0 … 1. */
function shareOf({ print, snapshot }: MachineView): number {
  if (!print) return 0;
  const [done, whole] = print.time === null ? [snapshot.line, print.lines] : [snapshot.elapsed, print.time];
  return whole > 0 ? Math.min(1, done / whole) : 0;
}

function Progress({ view }: { readonly view: MachineView }): JSX.Element {
  const { print, snapshot } = view;
  const share = shareOf(view);
  const left =
    print?.time == null
      ? null
      : Math.max(0, print.time - snapshot.elapsed) / Math.max(SPEED_FACTOR_MIN, snapshot.speedFactor);
  return (
    <>
      {print && <p class="watched-file">{print.name}</p>}
      <dl class="facts">
        <Fact name="Done">
          <span class="percent">{formatNumber(Math.floor(share * 100))} %</span>
        </Fact>
        <Fact name="Remaining">{left === null ? '–' : formatDuration(left)}</Fact>
        <Fact name="Elapsed">{formatDuration(snapshot.elapsed)}</Fact>
        <Fact name="Line">{formatNumber(snapshot.line)}</Fact>
        <Fact name="Queued on the board">
          {snapshot.queued === null ? '–' : `${formatNumber(snapshot.queued, 1)} s`}
        </Fact>
      </dl>
      <progress max={1} value={share} aria-label="Progress in the other tab" />
    </>
  );
}

function Readings({ snapshot }: { readonly snapshot: Snapshot }): JSX.Element {
  const { heaters, position, homed } = snapshot;
  return (
    <dl class="facts">
      {heaters.map(({ name, temperature, target }) => (
        <Fact key={name} name={HEATERS[name]}>
          {formatNumber(temperature, 1)} °C{target > 0 && ` of ${formatNumber(target)}`}
        </Fact>
      ))}
      {position && homed.every(Boolean) && (
        <Fact name="Position">
          {position
            .slice(0, 3)
            .map((value) => formatNumber(value, 2))
            .join(', ')}
        </Fact>
      )}
    </dl>
  );
}

function Machine({ of: { view, isStale } }: { readonly of: Watched }): JSX.Element {
  const { name, port, snapshot, trouble, outcome } = view;
  const status = statusOf(snapshot.phase, snapshot.job);
  const isPrinting = snapshot.job !== 'none' && snapshot.phase === 'ready';
  return (
    <Card
      title={port.kind === 'virtual' ? `Virtual printer (${name})` : name}
      aside={<span class={`status ${status.tone}`}>{isStale ? 'Not responding' : status.text}</span>}
    >
      <p class="watched-note">
        <Icon name="view" />
        <span>
          Viewer. Another tab of this browser drives this printer; use that tab for everything but the
          emergency stop.
        </span>
      </p>
      <div class={isStale ? 'stack old' : 'stack'}>
        {trouble && <p class="watched-trouble">{trouble.happened}</p>}
        {isPrinting && <Progress view={view} />}
        {!isPrinting && outcome && <p>{OUTCOMES[outcome]}</p>}
        <Readings snapshot={snapshot} />
      </div>
      {watched.value.length > 1 && (
        <button type="button" class="emergency" onClick={() => stopWatched(view)}>
          <Icon name="stop" />
          Emergency stop of {name}
        </button>
      )}
    </Card>
  );
}

/** All machines of other tabs; nothing where this tab drives one. */
export function WatchedMachines(): JSX.Element | null {
  if (!isViewing.value) return null;
  return (
    <>
      {watched.value.map((machine) => (
        <Machine key={machine.view.id} of={machine} />
      ))}
    </>
  );
}
