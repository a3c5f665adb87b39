// The instruments: graphs of temperatures and planned speed, loaded when they are opened for the first time, and the
// same values as text. The values are there whether the graphs are or not.
import { effect, type ReadonlySignal, useSignal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect, useId, useRef } from 'preact/hooks';
import { canDraw, InstrumentsHost } from '../instruments/host';
import type { FromInstruments } from '../instruments/protocol';
import type { HeaterName } from '../machine/protocol';
import { temperatures, temperaturesAt } from '../state/history';
import { plannedSpeed, plannerLoaded, snapshot, watchSpeed } from '../state/machine';
import { change, settings } from '../state/settings';
import { isDark } from '../state/theme';
import { type Seconds, seconds } from '../units';
import { peakAhead, speedNow } from './instrument_values';
import { decimalSign, formatNumber } from './numbers';
import { Button, Card, Choice } from './parts';

const HEATERS: readonly { readonly name: HeaterName; readonly label: string }[] = [
  { name: 'extruder', label: 'Nozzle' },
  { name: 'heater_bed', label: 'Bed' },
];
const SPANS = [
  { value: 600, text: '10 min' },
  { value: 1800, text: '30 min' },
  { value: 7200, text: '2 h' },
] as const;
/** How often speeds in words change at most, in ms: more cannot be read. */
const WORDS_MS = 500;

type GraphsState = 'loading' | FromInstruments['kind'] | 'unsupported';

/** Lets the graphs follow the page's state; returns what ends that. */
function follow(host: InstrumentsHost, span: ReadonlySignal<Seconds>): () => void {
  let sent = seconds(Number.NEGATIVE_INFINITY);
  const names = HEATERS.map(({ name }) => name);
  const ends = [
    effect(() => host.setDark(isDark.value)),
    effect(() => host.showLast(span.value)),
    effect(() => host.setPlannedSpeed(plannedSpeed.value)),
    effect(() => {
      const at = temperaturesAt.value;
      host.addTemperatures(temperatures.numbersAfter(sent, names));
      sent = at;
    }),
  ];
  return () => {
    for (const end of ends) end();
  };
}

const FAILURES = {
  missing: 'The graphs are still being built. npm start does it in the background; it takes a few minutes.',
  failed: 'The graphs could not be drawn.',
  unsupported: 'This browser cannot draw in a worker. The values below are the same.',
} as const;

function Graphs({ span }: { readonly span: ReadonlySignal<Seconds> }): JSX.Element {
  const around = useRef<HTMLDivElement>(null);
  const place = useRef<HTMLDivElement>(null);
  const state = useSignal<GraphsState>(canDraw() ? 'loading' : 'unsupported');
  const why = useSignal('');
  const attempt = useSignal(0);
  const count = attempt.value;
  useEffect(() => {
    const parent = place.current;
    if (!parent || state.peek() === 'unsupported') return;
    state.value = 'loading';
    const host = new InstrumentsHost(parent, {
      heaters: HEATERS.map(({ label }) => label),
      decimalSign: decimalSign(),
      onEvent: (event) => {
        why.value = event.kind === 'failed' ? event.why : '';
        state.value = event.kind;
      },
    });
    const unfollow = follow(host, span);
    return () => {
      unfollow();
      host.dispose();
    };
  }, [count]);
  const now = state.value;
  const failure = now === 'loading' || now === 'ready' ? undefined : FAILURES[now];
  const label = 'Graphs of the temperatures and of the planned speed. The values follow as text.';
  return (
    <div ref={around} class="graphs" data-state={now} tabIndex={-1}>
      <div ref={place} class="graphs-place" role="img" aria-label={label} hidden={failure !== undefined} />
      {now === 'loading' && (
        <p class="hint graphs-loading" role="status">
          Loading the graphs…
        </p>
      )}
      {failure && (
        <div class="graphs-failure" role="status">
          <p>{failure}</p>
          {why.value && <p class="hint">{why.value}</p>}
          {now !== 'unsupported' && (
            <Button
              onClick={() => {
                attempt.value += 1;
                // The button goes away with what it says: whoever pressed it stays here.
                around.current?.focus();
              }}
            >
              Try again
            </Button>
          )}
        </div>
      )}
    </div>
  );
}

/** A signal's value, at most every `WORDS_MS`; what `matters` is shown at once. */
function useCalm<T>(source: ReadonlySignal<T>, matters: (value: T) => boolean): T {
  const calm = useSignal(source.peek());
  useEffect(() => {
    let shownAt = Number.NEGATIVE_INFINITY;
    return effect(() => {
      const value = source.value;
      const now = performance.now();
      if (!matters(value) && now - shownAt < WORDS_MS) return;
      shownAt = now;
      calm.value = value;
    });
  }, [source, calm, matters]);
  return calm.value;
}

const isEmpty = (pairs: Float64Array): boolean => pairs.length === 0;

function SpeedValues(): JSX.Element {
  const plan = useCalm(plannedSpeed, isEmpty);
  const now = speedNow(plan);
  const peak = peakAhead(plan);
  const queued = snapshot.value?.queued ?? null;
  return (
    <dl class="values">
      <div>
        <dt>Toolhead now</dt>
        <dd>{now === null ? '–' : `${formatNumber(now)} mm/s`}</dd>
      </div>
      <div>
        <dt>Fastest in the queue</dt>
        <dd>{peak === null ? '–' : `${formatNumber(peak)} mm/s`}</dd>
      </div>
      <div>
        <dt>Queued</dt>
        <dd>{queued === null ? '–' : `${formatNumber(queued, 1)} s`}</dd>
      </div>
    </dl>
  );
}

function TemperatureValues({ span }: { readonly span: Seconds }): JSX.Element | null {
  // The history is no signal itself: this one changes with it.
  void temperaturesAt.value;
  const rows = HEATERS.flatMap(({ name, label }) => {
    const statistics = temperatures.statistics(name, span);
    return statistics ? [{ name, label, ...statistics }] : [];
  });
  if (rows.length === 0) return null;
  return (
    <table class="values-table">
      <caption class="unseen">Temperatures of the time shown, in °C</caption>
      <thead>
        <tr>
          <th scope="col">°C</th>
          <th scope="col">Lowest</th>
          <th scope="col">Average</th>
          <th scope="col">Highest</th>
        </tr>
      </thead>
      <tbody>
        {rows.map(({ name, label, lowest, average, highest }) => (
          <tr key={name}>
            <th scope="row">{label}</th>
            <td>{formatNumber(lowest, 1)}</td>
            <td>{formatNumber(average, 1)}</td>
            <td>{formatNumber(highest, 1)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Opened(): JSX.Element {
  const span = useSignal<Seconds>(seconds(SPANS[0].value));
  const isLoaded = plannerLoaded.value;
  useEffect(() => {
    if (!isLoaded) return;
    watchSpeed(true);
    return () => watchSpeed(false);
  }, [isLoaded]);
  return (
    <>
      <Graphs span={span} />
      <Choice
        label="Time shown"
        choices={SPANS}
        value={span.value as (typeof SPANS)[number]['value']}
        onSet={(value) => {
          span.value = seconds(value);
        }}
      />
      <TemperatureValues span={span.value} />
      <SpeedValues />
    </>
  );
}

export function Instruments(): JSX.Element {
  const id = useId();
  const isOpen = settings.value.showInstruments;
  const toggle = (
    <button
      type="button"
      class="button quiet small"
      aria-expanded={isOpen}
      aria-controls={id}
      onClick={() => change({ showInstruments: !isOpen })}
    >
      {isOpen ? 'Hide' : 'Show'}
      <span class="unseen"> the instruments</span>
    </button>
  );
  return (
    <Card title="Instruments" aside={toggle}>
      <div id={id} class="instruments" hidden={!isOpen}>
        {isOpen && <Opened />}
      </div>
    </Card>
  );
}
