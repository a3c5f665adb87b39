// Which layers and moves are shown: a standing slider for the layers, a lying one for the moves of the topmost, and play.
import type { JSX } from 'preact';
import { isPrinting } from '../../state/machine';
import { isPlaying, playSpeed, SPEEDS, toggle } from '../../state/playback';
import { outline } from '../../state/preview';
import { lineOfLayer } from '../../state/start';
import { askWhereToBegin } from '../../state/start_request';
import {
  layerCount,
  layerFrom,
  layerTo,
  moveFrom,
  moveTo,
  showLayers,
  showMoves,
  topLayer,
  topMoves,
} from '../../state/view';
import { formatNumber } from '../numbers';
import { obstacle } from '../obstacle';
import { Button } from '../parts';
import { RangeSlider } from './range_slider';

const heightOf = (layer: number): string => formatNumber(outline.value?.layers[layer]?.z ?? 0, 2);

export function LayerBar(): JSX.Element | null {
  const count = layerCount.value;
  if (count < 2) return null;
  const top = topLayer.value;
  const bottom = Math.min(layerFrom.value, top);
  const textOf = (layer: number): string => `Layer ${layer + 1} of ${count}, ${heightOf(layer)} mm`;
  const Label = ({ layer }: { readonly layer: number }): JSX.Element => (
    <p class="layer-text" aria-hidden="true">
      <strong>{formatNumber(layer + 1)}</strong>
      <span class="dim">{heightOf(layer)}</span>
    </p>
  );
  return (
    <fieldset class="layer-bar">
      <legend class="unseen">Layers shown</legend>
      <Label layer={top} />
      <RangeSlider
        isUpright
        min={0}
        max={count - 1}
        from={bottom}
        to={top}
        fromLabel="Lowest layer shown"
        toLabel="Top layer shown"
        textOf={textOf}
        onSet={showLayers}
      />
      <Label layer={bottom} />
    </fieldset>
  );
}

/** Not while something is printed, and not for all of the file. */
function FromLayer(): JSX.Element | null {
  const plan = outline.value;
  const top = topLayer.value;
  if (!plan || layerTo.value === null || top < 1 || isPrinting.value) return null;
  return (
    <Button why={obstacle.value} onClick={() => askWhereToBegin(lineOfLayer(plan, top + 1))}>
      Print from this layer…
    </Button>
  );
}

export function MoveBar(): JSX.Element | null {
  const moves = topMoves.value;
  if (!moves) return null;
  const { first, last } = moves;
  const count = last - first + 1;
  const from = Math.min(Math.max(moveFrom.value ?? first, first), last);
  const to = Math.min(Math.max(moveTo.value ?? last, from), last);
  const textOf = (vertex: number): string =>
    `Move ${formatNumber(vertex - first + 1)} of ${formatNumber(count)}`;
  return (
    <div class="viewer-bar">
      <Button
        icon={isPlaying.value ? 'pause' : 'play'}
        kind="quiet"
        label={isPlaying.value ? 'Pause the moves' : 'Play the moves'}
        onClick={toggle}
      />
      <select
        class="play-speed"
        aria-label="Speed of playing"
        value={playSpeed.value}
        onChange={(event) => {
          playSpeed.value = Number(event.currentTarget.value);
        }}
      >
        {SPEEDS.map((speed) => (
          <option key={speed} value={speed}>
            {speed}×
          </option>
        ))}
      </select>
      <RangeSlider
        min={first}
        max={last}
        from={from}
        to={to}
        fromLabel="First move shown"
        toLabel="Last move shown"
        textOf={textOf}
        onSet={showMoves}
      />
      <span class="move-text">{textOf(to)}</span>
      <FromLayer />
    </div>
  );
}
