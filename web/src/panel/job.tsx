// The file as a print: what it takes, what stands against it, and starting, pausing, ending it.
import { effect, signal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { dateFormat } from '../dates';
import type { Summary, Thumbnail } from '../preview/protocol';
import { connection, isPrinting, job, outcome, snapshot, wish } from '../state/machine';
import {
  closeFile,
  failure,
  file,
  type OpenFile,
  openFile,
  outline,
  summary,
  thumbnails,
} from '../state/preview';
import {
  finishesIn,
  heatingUp,
  isShown,
  type PrintedFile,
  type Progress,
  printed,
  printShown,
  progress,
  reached,
} from '../state/print';
import { isToBegin, starting, startObstacle } from '../state/start';
import { askWhereToBegin } from '../state/start_request';
import { Fact } from './facts';
import { Findings } from './findings';
import { Icon } from './icons';
import { formatBytes, formatDuration, formatNumber } from './numbers';
import { obstacle } from './obstacle';
import { pickFile } from './open_file';
import { Button } from './parts';
import { ask } from './question';
import { StartSteps } from './start_steps';

function cancel(): void {
  ask({
    title: 'End the print?',
    text: 'It cannot be continued. The heaters are switched off.',
    yes: 'End the print',
    no: 'Go on printing',
    act: () => void wish({ kind: 'cancel' }),
  });
}

const metres = (length: number): string => formatNumber(length / 1000, 2);

/** What the file that is shown takes; until the planner has gone through it, without the time. */
function Plan({ plan }: { readonly plan: Summary }): JSX.Element {
  const unknown = summary.value || failure.value ? '–' : 'Computing …';
  return (
    <dl class="facts">
      <Fact name="Print time">{plan.time === null ? unknown : formatDuration(plan.time)}</Fact>
      <Fact name="Filament">{metres(plan.filament)} m</Fact>
      <Fact name="Layers">{formatNumber(plan.layers.length)}</Fact>
      <Fact name="Height">{formatNumber(plan.bounds?.max[2] ?? 0, 2)} mm</Fact>
    </dl>
  );
}

const clock = dateFormat({ hour: 'numeric', minute: '2-digit' });
const clockWithDay = dateFormat({
  weekday: 'short',
  hour: 'numeric',
  minute: '2-digit',
});

/** The time of day, in so many seconds; with the day where that is another. */
function timeIn(left: number): string {
  const [now, then] = [new Date(), new Date(Date.now() + left * 1000)];
  return (now.getDate() === then.getDate() && left < 86_400 ? clock : clockWithDay)(then);
}

/** How far the print is. */
function Running({ far, filament }: { readonly far: Progress; readonly filament: number }): JSX.Element {
  const now = snapshot.value;
  const ends = finishesIn.value;
  const z = now?.homed[2] ? now.position?.[2] : undefined;
  return (
    <dl class="facts">
      <Fact name="Done">
        <span class="percent">{formatNumber(Math.floor(far.share * 100))} %</span>
      </Fact>
      <Fact name="Remaining">{far.left === null ? '–' : formatDuration(far.left)}</Fact>
      <Fact name="Finished at">{ends === null || job.value !== 'printing' ? '–' : timeIn(ends)}</Fact>
      <Fact name="Elapsed">{formatDuration(far.elapsed)}</Fact>
      <Fact name="Layer">
        {formatNumber(far.layer)} of {formatNumber(far.layers)}
      </Fact>
      <Fact name="Height">{z === undefined ? '–' : `${formatNumber(z, 2)} mm`}</Fact>
      <Fact name="Filament">
        {metres(far.filament ?? 0)} of {metres(filament)} m
      </Fact>
      <Fact name="Line">{formatNumber(far.line)}</Fact>
      <Fact name="Queued on the board">{now?.queued == null ? '–' : `${formatNumber(now.queued, 1)} s`}</Fact>
    </dl>
  );
}

const HEATERS = { extruder: 'nozzle', heater_bed: 'bed' } as const;

/** What a print that begins in the middle of its file is waiting for. */
function waitingToBegin(line: number): string {
  if (isToBegin.value) return startObstacle.value ?? `Ready to begin with line ${formatNumber(line)}.`;
  return `Reading the file up to line ${formatNumber(line)}. Nothing moves.`;
}

/** What the print is waiting for, in words. */
function waiting(): string | null {
  const begun = starting.value;
  if (begun && job.value !== 'ending') return waitingToBegin(begun.place.line);
  if (job.value === 'paused')
    return 'Paused. The heaters stay on; the head can be moved by hand and goes back.';
  if (job.value === 'held')
    return 'Held: the head rests on its path, with no step lost. Look at the print, then resume or cancel it.';
  const heater = heatingUp.value;
  if (heater) {
    const [now, target] = [heater.temperature, heater.target].map((value) => formatNumber(value));
    return `Heating the ${HEATERS[heater.name]}: ${now} of ${target}\u00a0°C.`;
  }
  return job.value === 'printing' && snapshot.value?.queued === null && snapshot.value.elapsed === 0
    ? 'Getting ready.'
    : null;
}

/** Longer than between the two halves of a double click, in ms. */
const DOUBLE_CLICK_MS = 500;
/** Whether what was pressed last is still being done. */
const isUnderWay = signal(false);

/** Resolves with the next news of the machine, or with the end of the connection. */
function nextSnapshot(): Promise<void> {
  const before = snapshot.peek();
  return new Promise((resolve) => {
    const stop = effect(() => {
      if (snapshot.value === before && connection.value !== 'closed') return;
      resolve();
      queueMicrotask(() => stop());
    });
  });
}

/**
 * Print, Pause and Resume stand in one place: until the first is done and a double click is over, a press means none of
 * them.
 */
async function once(act: () => Promise<unknown>): Promise<void> {
  if (isUnderWay.value) return;
  isUnderWay.value = true;
  const pause = new Promise((resolve) => setTimeout(resolve, DOUBLE_CLICK_MS));
  try {
    await act();
    await nextSnapshot();
    await pause;
  } finally {
    isUnderWay.value = false;
  }
}

function Actions(): JSX.Element {
  const state = job.value;
  const busy = isUnderWay.value;
  if (state === 'none') {
    const again = outcome.value !== null && isShown.value;
    return (
      <>
        <Button
          kind="primary"
          icon="play"
          class="big"
          busy={busy}
          why={obstacle.value}
          onClick={() => {
            if (obstacle.value === null) void once(() => printShown());
          }}
        >
          {again ? 'Print again' : 'Print'}
        </Button>
        <Button
          class="big"
          why={obstacle.value}
          onClick={() => askWhereToBegin(Math.max(2, reached.value + 1))}
        >
          Print from a line…
        </Button>
      </>
    );
  }
  const isBusy = state === 'pausing' || state === 'ending';
  return (
    <>
      {state === 'paused' || state === 'held' ? (
        <Button
          kind="primary"
          icon="play"
          class="big"
          busy={busy}
          why={startObstacle.value}
          onClick={() => {
            if (startObstacle.value === null) void once(() => wish({ kind: 'resume' }));
          }}
        >
          Resume
        </Button>
      ) : (
        <Button
          icon="pause"
          class="big"
          busy={busy}
          disabled={isBusy}
          onClick={() => void once(() => wish({ kind: 'pause' }))}
        >
          {state === 'pausing' ? 'Pausing' : 'Pause'}
        </Button>
      )}
      <Button kind="danger" class="big" disabled={state === 'ending'} onClick={cancel}>
        {state === 'ending' ? 'Ending' : 'Cancel'}
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

/** A side of the picture in the card, in pixels of a sharp screen. */
const PICTURE_PX = 112;

/** The smallest of the slicer's pictures that is sharp here, else its largest; of the file that is shown. */
function pictureOf(all: readonly Thumbnail[]): Thumbnail | null {
  const bySize = [...all].sort((a, b) => a.height - b.height);
  return bySize.find(({ height }) => height >= PICTURE_PX) ?? bySize.at(-1) ?? null;
}

function FilePicture(): JSX.Element {
  const place = useRef<HTMLImageElement>(null);
  const found = isPrinting.value && !isShown.value ? null : pictureOf(thumbnails.value);
  const picture = found?.picture ?? null;
  useEffect(() => {
    const image = place.current;
    if (!image || !picture) return;
    const url = URL.createObjectURL(picture);
    image.src = url;
    return () => URL.revokeObjectURL(url);
  }, [picture]);
  if (!picture)
    return (
      <span class="job-icon">
        <Icon name="file" />
      </span>
    );
  return <img ref={place} class="job-picture" alt="The print, as its slicer drew it" />;
}

/** The file of the card: the one that is printed, else the one that is shown. */
function Head({
  open,
  generator,
}: {
  readonly open: OpenFile;
  readonly generator: string | null;
}): JSX.Element {
  return (
    <div class="job-head">
      <FilePicture />
      <div class="job-name">
        <h2 title={open.name}>{open.name}</h2>
        <p class="dim">
          {formatBytes(open.blob.size)}
          {generator ? `, ${generator}` : ''}
        </p>
      </div>
      {isPrinting.value ? (
        <Button onClick={pickFile}>Look at another file</Button>
      ) : (
        <span class="row">
          <Button onClick={pickFile}>Other file</Button>
          <Button icon="close" kind="quiet" label="Close the file" onClick={closeFile} />
        </span>
      )}
    </div>
  );
}

/** Another file is looked at while one is printed. */
function Visitor({ job }: { readonly job: PrintedFile }): JSX.Element | null {
  const open = file.value;
  if (isShown.value) return null;
  return (
    <p class="row wrap visitor">
      <span class="grow">
        {open
          ? `In view: ${open.name}. It is not what is being printed.`
          : 'The printed file is not in view.'}
      </span>
      <Button onClick={() => openFile(job.file.blob, job.file.name)}>Show the print</Button>
    </p>
  );
}

export function Job(): JSX.Element | null {
  const running = isPrinting.value ? printed.value : null;
  const open = running?.file ?? file.value;
  const far = progress.value;
  const plan = outline.value;
  if (!open && !isPrinting.value && !outcome.value) return null;
  const hint = isPrinting.value ? waiting() : obstacle.value;
  return (
    <section class="card job" aria-label="Print">
      {open && <Head open={open} generator={(running?.summary ?? plan)?.generator ?? null} />}
      {running && far && <Running far={far} filament={running.summary.filament} />}
      {!isPrinting.value && plan && <Plan plan={plan} />}
      {far && <progress max={1} value={far.share} aria-label="Print progress" />}
      {(open || isPrinting.value) && (
        <div class="row wrap job-actions">
          <Actions />
          {hint && <p class="hint grow">{hint}</p>}
        </div>
      )}
      <StartSteps />
      {running && <Visitor job={running} />}
      <Outcome />
      <Findings />
    </section>
  );
}
