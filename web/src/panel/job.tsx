// The file as a print: what it takes, what stands against it, and starting, pausing, ending it.
import { computed } from '@preact/signals';
import type { JSX } from 'preact';
import { connection, isPrinting, isReady, job, outcome, print, snapshot, wish } from '../state/machine';
import {
  closeFile,
  confirmed,
  failure,
  file,
  printedShare,
  reading,
  summary,
  unconfirmed,
} from '../state/preview';
import { Findings } from './findings';
import { Icon } from './icons';
import { machineSummary } from './machine_summary';
import { formatBytes, formatDuration, formatNumber } from './numbers';
import { pickFile } from './open_file';
import { Button } from './parts';

/** Why the file cannot be printed now; null where it can. */
const obstacle = computed<string | null>(() => {
  if (!file.value) return null;
  if (reading.value !== null) return 'The file is still being read.';
  if (failure.value || !summary.value) return 'The file could not be read.';
  if (summary.value.errors.length > 0) return 'The file cannot be printed on this machine: see below.';
  if (!machineSummary.value) return 'The machine file has errors: mend it under Machine.';
  if (connection.value === 'closed') return 'Connect a printer to print.';
  if (!isReady.value) return 'The printer is not ready.';
  const open = unconfirmed.value.length;
  if (open > 0)
    return open === 1
      ? 'A line has to be confirmed first: see below.'
      : `${open} lines have to be confirmed first: see below.`;
  return null;
});

function start(): void {
  const open = file.value;
  if (open && obstacle.value === null) void print(open.blob, [...confirmed.value]);
}

function cancel(): void {
  if (window.confirm('End the print? It cannot be continued.')) void wish({ kind: 'cancel' });
}

function Facts(): JSX.Element | null {
  const facts = summary.value;
  if (!facts) return null;
  return (
    <dl class="facts">
      {facts.time !== null && (
        <div>
          <dt>Print time</dt>
          <dd>{formatDuration(facts.time)}</dd>
        </div>
      )}
      <div>
        <dt>Filament</dt>
        <dd>{formatNumber(facts.filament / 1000, 2)} m</dd>
      </div>
      <div>
        <dt>Layers</dt>
        <dd>{formatNumber(facts.layers.length)}</dd>
      </div>
    </dl>
  );
}

function Progress(): JSX.Element | null {
  const now = snapshot.value;
  if (!now || !isPrinting.value) return null;
  const done = printedShare(now);
  const total = summary.value?.time ?? null;
  // The plan is for the speed as written; what is left goes at the speed that is set.
  const left = total === null ? null : Math.max(0, total - now.elapsed) / Math.max(0.1, now.speedFactor);
  return (
    <div class="progress">
      <div class="progress-line">
        <span class="percent">{formatNumber(done * 100, 0)} %</span>
        <span>
          <span class="dim">Elapsed</span> {formatDuration(now.elapsed)}
        </span>
        {left !== null && (
          <span>
            <span class="dim">Remaining</span> {formatDuration(left)}
          </span>
        )}
        <span>
          <span class="dim">Line</span> {formatNumber(now.line)}
        </span>
        {now.queued !== null && (
          <span>
            <span class="dim">Queued on the board</span> {formatNumber(now.queued, 1)} s
          </span>
        )}
      </div>
      <progress max={1} value={done} aria-label="Print progress" />
    </div>
  );
}

function Actions(): JSX.Element {
  const state = job.value;
  if (state === 'none') {
    return (
      <Button kind="primary" icon="play" class="big" disabled={obstacle.value !== null} onClick={start}>
        Print
      </Button>
    );
  }
  const isBusy = state === 'pausing' || state === 'ending';
  return (
    <>
      {state === 'paused' ? (
        <Button kind="primary" icon="play" class="big" onClick={() => void wish({ kind: 'resume' })}>
          Resume
        </Button>
      ) : (
        <Button icon="pause" class="big" disabled={isBusy} onClick={() => void wish({ kind: 'pause' })}>
          {state === 'pausing' ? 'Pausing' : 'Pause'}
        </Button>
      )}
      <Button kind="danger" class="big" disabled={state === 'ending'} onClick={cancel}>
        Cancel
      </Button>
    </>
  );
}

const OUTCOMES = {
  done: 'The print is done.',
  cancelled: 'The print was cancelled.',
  stopped: 'The print stopped before its end. It does not start again by itself.',
} as const;

function Outcome(): JSX.Element {
  const text = outcome.value && !isPrinting.value ? OUTCOMES[outcome.value] : null;
  return (
    <div role="status">
      {text && (
        <p class={`outcome ${outcome.value}`}>
          <Icon name={outcome.value === 'done' ? 'check' : 'warning'} />
          {text}
        </p>
      )}
    </div>
  );
}

export function Job(): JSX.Element | null {
  const open = file.value;
  if (!open && !isPrinting.value && !outcome.value) return null;
  const why = obstacle.value;
  return (
    <section class="card job" aria-label="Print">
      {open ? (
        <div class="job-head">
          <span class="job-icon">
            <Icon name="file" />
          </span>
          <div class="job-name">
            <h2>{open.name}</h2>
            <p class="dim">
              {formatBytes(open.blob.size)}
              {summary.value?.generator ? `, ${summary.value.generator}` : ''}
            </p>
          </div>
          {!isPrinting.value && (
            <span class="row">
              <Button onClick={pickFile}>Other file</Button>
              <Button icon="close" kind="quiet" label="Close the file" onClick={closeFile} />
            </span>
          )}
        </div>
      ) : null}
      <Facts />
      <Progress />
      {(open || isPrinting.value) && (
        <div class="row wrap job-actions">
          <Actions />
          {why && !isPrinting.value && <p class="hint">{why}</p>}
        </div>
      )}
      <Outcome />
      <Findings />
    </section>
  );
}
