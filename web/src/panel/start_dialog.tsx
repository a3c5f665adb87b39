// Where a print is to begin: by layer or by line, for the file that is shown or for an interrupted print. Says what is
// known and what is not. Its button has the file read up to there; what moves is for the user to say after that.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Interruption, KeptPrint } from '../machine/protocol';
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
      <li>You say where Z stands, and look whether the part still sticks to the bed.</li>
      <li>
        You press Resume. The nozzle gets warm enough to come free, goes up above all that has been printed, X
        and Y are homed, everything is heated, and the print goes on with this line.
      </li>
    </ol>
  </div>
);

const NotKnown = ({ isLost }: { readonly isLost: boolean }): JSX.Element => (
  <div class="stack tight">
    <h3>What is not known</h3>
    <ul class="plain-list">
      <li>
        {isLost
          ? 'Where Z stands: without current its motor falls to a full step nearby, and a heavy head may sink.'
          : 'Where Z stands, unless it was homed and has had current since.'}{' '}
        It cannot be homed with a part in the way.
      </li>
      <li>Whether the part is still where it was. One that has cooled may have come off the bed.</li>
    </ul>
  </div>
);

interface KnownProps {
  readonly lost: KeptPrint;
  readonly at: Interruption | null;
}

function KnownOf({ lost: { facts, line, heardOf }, at }: KnownProps): JSX.Element {
  const last = at?.line ?? line;
  return (
    <>
      <dl class="facts">
        <Fact name="File">{facts.name}</Fact>
        <Fact name="Interrupted">{timeOf(heardOf)}</Fact>
        <Fact name="After line">
          {last > 0 ? `${formatNumber(last)} of ${formatNumber(facts.lines)}` : '–'}
        </Fact>
        {at && (
          <Fact name="In layer">
            {formatNumber(at.layer)}, at {formatNumber(at.layerZ, 2)} mm
          </Fact>
        )}
      </dl>
      {at && at.reachLine > last && (
        <p>
          It may have got as far as line {formatNumber(at.reachLine)} before it stopped. What was made after
          line {formatNumber(last)} is made twice. Where you can see on the part how far it got, change the
          line.
        </p>
      )}
    </>
  );
}

interface FormProps {
  readonly blob: Blob;
  readonly plan: Summary;
  readonly proposed: number;
  readonly lost: KeptPrint | null;
  readonly at: Interruption | null;
}

const close = (): void => {
  startRequest.value = null;
};

function Form({ blob, plan, proposed, lost, at }: FormProps): JSX.Element {
  const max = Math.max(LINE_MIN, plan.lines);
  const [line, setLine] = useState(Math.min(Math.max(proposed, LINE_MIN), max));
  const [isWrong, setWrong] = useState(false);
  const [isBusy, setBusy] = useState(false);
  const place = placeOf(plan, line);
  const why = obstacle.value ?? (isWrong ? 'The file has no such place: see above.' : null);
  const go = async (): Promise<void> => {
    if (isBusy) return;
    setBusy(true);
    const isBegun = await printShown(place, lost, at);
    setBusy(false);
    if (isBegun) close();
  };
  return (
    <>
      <div class="row wrap start">
        <NumberField
          label={`Layer (of ${formatNumber(plan.layers.length)})`}
          unit=""
          value={Math.max(1, place.layer)}
          min={1}
          max={plan.layers.length}
          onWrong={setWrong}
          onSet={(layer) => setLine(Math.max(LINE_MIN, lineOfLayer(plan, Math.round(layer))))}
        />
        <NumberField
          label={`Line (of ${formatNumber(plan.lines)})`}
          unit=""
          value={line}
          min={LINE_MIN}
          max={max}
          onWrong={setWrong}
          onSet={(number) => setLine(Math.round(number))}
        />
      </div>
      <Lines blob={blob} line={line} />
      <Facts place={place} plan={plan} />
      {at && at.layerLine > 1 && at.layerLine < line && (
        <div class="row wrap">
          <Button onClick={() => setLine(at.layerLine)}>
            Begin with all of layer {formatNumber(at.layer)}
          </Button>
          <span class="hint">That prints over what is there of this layer.</span>
        </div>
      )}
      <WhatHappens />
      <NotKnown isLost={lost !== null} />
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
      return <OfShown key="shown" blob={request.blob} proposed={request.line} lost={null} at={null} />;
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
          <KnownOf lost={lost} at={null} />
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
            The print was interrupted, and this printer does not hold it: its board forgets it with a loss of
            power, a restart or a stop. Here it can go on from a line of its file. If another printer holds
            it, close this and connect that: there it goes on with its next step.
          </p>
          <KnownOf lost={request.lost} at={request.at} />
          {request.trouble && <Said of={request.trouble} />}
          <OfShown
            key="lost"
            blob={request.blob}
            proposed={lineAfter(request.lost, request.at) ?? LINE_MIN}
            lost={request.lost}
            at={request.at}
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
