// Where a print is to begin: by layer or by line, for the file that is shown or for an interrupted print. Says what is
// known and what is not. Its button has the file read up to there; what moves is for the user to say after that.
import type { JSX } from 'preact';
import { useEffect, useId, useState } from 'preact/hooks';
import type { KeptPrint } from '../machine/protocol';
import type { Summary } from '../preview/protocol';
import { timeOf } from '../state/interrupted';
import { failure, linesOf, reading, summary } from '../state/preview';
import { printShown } from '../state/print';
import { lineAfter, lineOfLayer, type Place, placeOf } from '../state/start';
import { askToContinue, type StartRequest, startRequest } from '../state/start_request';
import { PanelDialog } from './emergency';
import { Fact } from './facts';
import { formatBytes, formatDuration, formatNumber } from './numbers';
import { obstacle } from './obstacle';
import { pickWith } from './open_file';
import { Button, NumberField } from './parts';
import { Said } from './said';

/** The first line is where every print begins that is not asked about. */
const LINE_MIN = 2;
const LINES_BEFORE = 1;
const LINES_AFTER = 2;

/** Some lines of the file around the one that was chosen. */
function Lines({ blob, line }: { readonly blob: Blob; readonly line: number }): JSX.Element {
  const first = Math.max(1, line - LINES_BEFORE);
  const [found, setFound] = useState<{ readonly first: number; readonly texts: readonly string[] } | null>(
    null,
  );
  useEffect(() => {
    let isWanted = true;
    void linesOf(blob, first, line + LINES_AFTER).then((texts) => {
      if (isWanted) setFound({ first, texts });
    });
    return () => {
      isWanted = false;
    };
  }, [blob, first, line]);
  const isThere = found?.first === first && found.texts.length > line - first;
  return (
    <ol class="lines code" aria-label="The file there" start={first}>
      {Array.from({ length: LINES_BEFORE + 1 + LINES_AFTER }, (_, at) => {
        const number = first + at;
        const text = isThere ? found.texts[at] : '';
        return (
          <li key={number} class={number === line ? 'chosen' : ''} aria-current={number === line}>
            <span class="line-number">{number}</span> {text}
          </li>
        );
      })}
    </ol>
  );
}

function Facts({ place, plan }: { readonly place: Place; readonly plan: Summary }): JSX.Element {
  return (
    <dl class="facts">
      <Fact name="Layer">
        {place.layer === 0
          ? 'before the first'
          : `${formatNumber(place.layer)} of ${formatNumber(place.layers)}`}
      </Fact>
      <Fact name="Height">{place.z === null ? '–' : `${formatNumber(place.z, 2)} mm`}</Fact>
      <Fact name="Time before it">{plan.time === null ? '–' : formatDuration(place.before)}</Fact>
      <Fact name="Time from there">
        {plan.time === null ? '–' : formatDuration(Math.max(0, plan.time - place.before))}
      </Fact>
    </dl>
  );
}

const WhatHappens = (): JSX.Element => (
  <div class="stack tight">
    <h3>What happens</h3>
    <ol class="plain-list">
      <li>The file is read up to this line. Nothing moves and nothing is heated.</li>
      <li>You say where Z stands, home X and Y, and look whether the part still sticks to the bed.</li>
      <li>
        You press Resume. It heats, goes up above all that has been printed, across, down at the place of this
        line, and on.
      </li>
    </ol>
  </div>
);

const NotKnown = ({ lost }: { readonly lost: KeptPrint | null }): JSX.Element => (
  <div class="stack tight">
    <h3>What is not known</h3>
    <ul class="plain-list">
      {lost && (
        <li>
          The very last line: up to two seconds more may have been printed than was told. Look at the part,
          and change the line where you see better.
        </li>
      )}
      <li>
        Where Z stands
        {lost
          ? ': without current motors slip a little, and the head may sink'
          : ', unless it was homed and has had current since'}
        . It cannot be homed with a part in the way.
      </li>
      <li>Whether the part is still where it was. One that has cooled may have come off the bed.</li>
    </ul>
  </div>
);

function KnownOf({ lost }: { readonly lost: KeptPrint }): JSX.Element {
  const { facts, line, heardOf } = lost;
  return (
    <dl class="facts">
      <Fact name="File">{facts.name}</Fact>
      <Fact name="Last known line">
        {line > 0 ? `${formatNumber(line)} of ${formatNumber(facts.lines)}` : '–'}
      </Fact>
      <Fact name="Last heard of">{timeOf(heardOf)}</Fact>
    </dl>
  );
}

interface FormProps {
  readonly blob: Blob;
  readonly plan: Summary;
  readonly proposed: number;
  readonly lost: KeptPrint | null;
}

const close = (): void => {
  startRequest.value = null;
};

function Form({ blob, plan, proposed, lost }: FormProps): JSX.Element {
  const max = Math.max(LINE_MIN, plan.lines);
  const [line, setLine] = useState(Math.min(Math.max(proposed, LINE_MIN), max));
  const [isBusy, setBusy] = useState(false);
  const hintId = useId();
  const place = placeOf(plan, line);
  const why = obstacle.value;
  const go = async (): Promise<void> => {
    if (isBusy) return;
    setBusy(true);
    const isBegun = await printShown(place, lost);
    setBusy(false);
    if (isBegun) close();
  };
  return (
    <>
      <div class="row wrap end">
        <NumberField
          label="Layer"
          unit={`of ${formatNumber(plan.layers.length)}`}
          value={Math.max(1, place.layer)}
          min={1}
          max={plan.layers.length}
          onSet={(layer) => setLine(Math.max(LINE_MIN, lineOfLayer(plan, Math.round(layer))))}
        />
        <NumberField
          label="Line"
          unit={`of ${formatNumber(plan.lines)}`}
          value={line}
          min={LINE_MIN}
          max={max}
          onSet={(number) => setLine(Math.round(number))}
        />
      </div>
      <Lines blob={blob} line={line} />
      <Facts place={place} plan={plan} />
      {place.layer === 0 && (
        <p class="hint" id={hintId}>
          Nothing is printed before this line. To print all of it press Print instead, which homes all axes.
        </p>
      )}
      <WhatHappens />
      <NotKnown lost={lost} />
      <div class="dialog-foot sticky">
        {why && <p class="hint">{why}</p>}
        <Button class="big" onClick={close}>
          Cancel
        </Button>
        <Button kind="primary" class="big" busy={isBusy} why={why} onClick={() => void go()}>
          Get ready at line {formatNumber(line)}
        </Button>
      </div>
    </>
  );
}

/** Of the file that is shown, once it has been read. */
function OfShown(props: Omit<FormProps, 'plan'>): JSX.Element {
  if (failure.value) return <Said of={failure.value} />;
  if (summary.value) return <Form {...props} plan={summary.value} />;
  return (
    <>
      <p role="status">Reading the file.</p>
      <progress max={1} value={reading.value ?? 0} aria-label="Reading the file" />
    </>
  );
}

function Body({ request }: { readonly request: StartRequest }): JSX.Element {
  switch (request.kind) {
    case 'shown':
      return <OfShown key="shown" blob={request.blob} proposed={request.line} lost={null} />;
    case 'looking':
      return <p role="status">Looking for the file of {request.lost.facts.name}.</p>;
    case 'needs-file': {
      const { lost, trouble } = request;
      return (
        <>
          <p>
            There is no whole copy of {lost.facts.name} here. Open the very file that the print was started
            with ({formatBytes(lost.fileBytes)}).
          </p>
          {trouble && <Said of={trouble} />}
          <KnownOf lost={lost} />
          <div class="dialog-foot">
            <Button
              kind="primary"
              class="big"
              icon="file"
              onClick={() => pickWith((file) => void askToContinue(lost, file))}
            >
              Open the file
            </Button>
          </div>
        </>
      );
    }
    case 'lost':
      return (
        <>
          <p>
            The print was interrupted, and the board has forgotten it. It can go on from a line of its file,
            of which a copy was kept.
          </p>
          <KnownOf lost={request.lost} />
          <OfShown
            key="lost"
            blob={request.blob}
            proposed={lineAfter(request.lost) ?? LINE_MIN}
            lost={request.lost}
          />
        </>
      );
  }
}

export function StartDialog(): JSX.Element | null {
  const request = startRequest.value;
  if (!request) return null;
  return (
    <PanelDialog
      title={request.kind === 'shown' ? 'Print from a line' : 'Continue an interrupted print'}
      onClose={close}
    >
      <div class="stack">
        <Body request={request} />
      </div>
    </PanelDialog>
  );
}
