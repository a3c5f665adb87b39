// The buttons over the 3D view: where one looks from, how, and what besides.
import type { CameraPreset } from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { note } from '../../state/log';
import { notify, withdraw } from '../../state/notices';
import { file, outline } from '../../state/preview';
import { change, settings } from '../../state/settings';
import { pictureOf } from '../../state/view_answers';
import { save } from '../parts';
import { view } from './canvas';
import { makeRoom } from './legend';

const PRESETS: readonly { readonly preset: CameraPreset; readonly name: string; readonly label: string }[] = [
  { preset: 'iso', name: 'All', label: 'Show all of it, from in front and above' },
  { preset: 'top', name: 'Top', label: 'View from the top' },
  { preset: 'front', name: 'Front', label: 'View from the front' },
  { preset: 'left', name: 'Left', label: 'View from the left' },
  { preset: 'right', name: 'Right', label: 'View from the right' },
  { preset: 'back', name: 'Back', label: 'View from the back' },
];

/** Of a picture that is kept; the shape is the view's. */
const PICTURE_WIDTH_PX = 1920;
const TRIES_MAX = 3;

const NOTICE = 'picture';

/** Saves a picture of the view, or says that there is none. */
async function savePicture(shape: number): Promise<void> {
  const height = Math.round(PICTURE_WIDTH_PX / Math.min(Math.max(shape, 0.25), 4));
  let blob: Blob | null = null;
  // One that is begun before the view has all of a new file comes to nothing.
  for (let tries = 0; !blob && tries < TRIES_MAX; tries += 1)
    blob = await pictureOf(PICTURE_WIDTH_PX, height);
  const name = (file.peek()?.name ?? 'toolpath').replace(/\.(gcode|gco|g|gz|nc|txt)$/i, '');
  if (blob) {
    withdraw(NOTICE);
    save(blob, `${name}.png`);
    return;
  }
  const text =
    'The picture could not be made: the view was busy with another file, or the graphics card gave up.';
  note('error', text);
  notify({
    kind: NOTICE,
    text,
    action: { text: 'Try again', act: () => void savePicture(shape), why: null },
  });
}

interface ToggleProps {
  readonly name: string;
  readonly label: string;
  readonly isOn: boolean;
  readonly onSet: (isOn: boolean) => void;
}

const Toggle = ({ name, label, isOn, onSet }: ToggleProps): JSX.Element => (
  <button
    type="button"
    class="direction"
    title={label}
    aria-label={label}
    aria-pressed={isOn}
    onClick={() => onSet(!isOn)}
  >
    {name}
  </button>
);

function Picture(): JSX.Element {
  const [isBusy, setBusy] = useState(false);
  const go = async (): Promise<void> => {
    if (isBusy) return;
    setBusy(true);
    const box = document.querySelector('.canvas-place')?.getBoundingClientRect();
    await savePicture(box ? box.width / Math.max(box.height, 1) : 1);
    setBusy(false);
  };
  return (
    <button
      type="button"
      class="direction"
      title="Save a picture of the view as PNG"
      aria-label="Save a picture"
      aria-disabled={isBusy}
      aria-busy={isBusy}
      onClick={() => void go()}
    >
      {isBusy ? 'Saving …' : 'PNG'}
    </button>
  );
}

export function ViewTools({ isFlat }: { readonly isFlat: boolean }): JSX.Element {
  const { isOrthographic, followNozzle, showText } = settings.value;
  return (
    <div class="view-tools">
      {!isFlat && (
        <fieldset class="directions">
          <legend class="unseen">View</legend>
          {PRESETS.map(({ preset, name, label }) => (
            <button
              key={preset}
              type="button"
              class="direction"
              title={label}
              onClick={() => view.value?.setCamera(preset)}
            >
              {name}
            </button>
          ))}
        </fieldset>
      )}
      <fieldset class="directions">
        <legend class="unseen">How it is shown</legend>
        {!isFlat && (
          <Toggle
            name="Parallel"
            label="Without perspective"
            isOn={isOrthographic}
            onSet={(isOn) => change({ isOrthographic: isOn })}
          />
        )}
        <Toggle
          name="Follow"
          label="Follow the nozzle"
          isOn={followNozzle}
          onSet={(isOn) => change({ followNozzle: isOn })}
        />
        {outline.value && <Picture />}
        {file.value && (
          <Toggle
            name="G-code"
            label="Show the G-code"
            isOn={showText}
            onSet={(isOn) => {
              change({ showText: isOn });
              if (isOn) makeRoom();
            }}
          />
        )}
      </fieldset>
    </div>
  );
}
