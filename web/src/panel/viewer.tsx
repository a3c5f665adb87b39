// The preview: the 3D view with what belongs to it, the file's text, and the place where files are dropped.
import type { JSX } from 'preact';
import { meshShown } from '../state/mesh';
import { file, outline, reading } from '../state/preview';
import { settings } from '../state/settings';
import { Icon } from './icons';
import { Later } from './later';
import { formatNumber } from './numbers';
import { openSample, pickFile } from './open_file';
import { Button } from './parts';
import { Canvas, drawnShare, isFlat, viewFailure } from './view/canvas';
import { GcodeText } from './view/gcode_text';
import { Legend } from './view/legend';
import { MeshAlone } from './view/mesh';
import { LayerBar, MoveBar } from './view/range_bars';
import { HoverNote, SegmentCard } from './view/segment_card';
import { ViewTools } from './view/tools';

function NoView({ reason }: { readonly reason: string }): JSX.Element {
  return (
    <details class="view-failure">
      <summary>
        <span role="status">
          {isFlat.value ? 'No 3D view here: layers are shown from above.' : 'There is no 3D view here.'}
        </span>
      </summary>
      <p>
        It needs WebGL 2. Most often graphics acceleration is switched off in the browser’s settings, or the
        graphics driver is blocked. Everything else works without it, printing too.
      </p>
      <p class="hint">{reason}</p>
    </details>
  );
}

/** What the view does not show of the file, or not where it is. */
function Short(): JSX.Element | null {
  const { leftOut = 0, clamped = 0, vertices = 0 } = outline.value ?? {};
  if (leftOut === 0 && clamped === 0) return null;
  return (
    <div class="view-short" role="status">
      {leftOut > 0 && (
        <p>
          The first {formatNumber(vertices)} moves are shown, which is as many as fit; {formatNumber(leftOut)}{' '}
          are not.
        </p>
      )}
      {clamped > 0 && (
        <p>
          {formatNumber(clamped)} {clamped === 1 ? 'place lies' : 'places lie'} far outside the machine and{' '}
          {clamped === 1 ? 'is' : 'are'} shown nearer than that.
        </p>
      )}
    </div>
  );
}

/** What is seen is a rough picture; the full one is being drawn behind it, and that takes a while. */
function Drawing(): JSX.Element | null {
  const share = drawnShare.value;
  if (share === null) return null;
  return <p class="view-short">Full picture: {Math.floor(100 * share)} %</p>;
}

/** Over the plate, or, where the bed's mesh is to be seen, below it. */
function Empty(): JSX.Element {
  return (
    <div class={`empty ${meshShown.value && !isFlat.value ? 'below' : ''}`}>
      <span class="empty-icon">
        <Icon name="file" />
      </span>
      <p class="empty-title">Drop a G-code file here</p>
      <div class="row wrap centre">
        <Button kind="primary" onClick={pickFile}>
          Choose a file
        </Button>
        <Button onClick={() => void openSample()}>Open the sample</Button>
      </div>
      <p class="hint">It stays on this computer.</p>
    </div>
  );
}

export function Viewer(): JSX.Element {
  const progress = reading.value;
  const hasView = viewFailure.value === null || isFlat.value;
  const hasText = settings.value.showText && file.value !== null;
  return (
    <section class="viewer" aria-label="Preview">
      <div class={`viewer-body ${hasText ? 'with-text' : ''}`}>
        <div class="viewer-stage">
          <Canvas />
          {!file.value && <Empty />}
          <div class="over-left">
            {viewFailure.value && <NoView reason={viewFailure.value} />}
            {hasView && <Short />}
            {hasView && <Drawing />}
            {hasView && <ViewTools isFlat={isFlat.value} />}
          </div>
          {!file.value && hasView && !isFlat.value && <MeshAlone />}
          {outline.value && hasView && (
            <>
              <Later pictures={1}>
                <Legend isFlat={isFlat.value} />
              </Later>
              <SegmentCard />
              <HoverNote />
            </>
          )}
        </div>
        {outline.value && hasView && (
          <Later pictures={2}>
            <LayerBar />
          </Later>
        )}
        {hasText && <GcodeText />}
      </div>
      {progress !== null && (
        <progress class="reading" aria-label="Reading the file" max={1} value={progress} />
      )}
      {outline.value && hasView && (
        <Later pictures={3}>
          <MoveBar />
        </Later>
      )}
    </section>
  );
}
