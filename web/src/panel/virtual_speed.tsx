// How fast the virtual printer's time passes: chosen when connecting, changed at any time after.
import type { JSX } from 'preact';
import { port, setVirtualSpeed } from '../state/machine';
import { change, SPEED_MAX, settings } from '../state/settings';
import { Choice } from './parts';

const SPEEDS = [1, 5, 20, SPEED_MAX] as const;
type Speed = (typeof SPEEDS)[number];
const CHOICES = SPEEDS.map((value) => ({ value, text: value === 1 ? 'Real time' : `up to ${value}×` }));

export function VirtualSpeed({ label }: { readonly label: string }): JSX.Element {
  const speed = port.value?.kind === 'virtual' ? port.value.speed : settings.value.speed;
  return (
    <>
      <Choice
        label={label}
        choices={CHOICES}
        value={SPEEDS.find((value) => value === speed) ?? (1 satisfies Speed)}
        onSet={(value) => {
          change({ speed: value });
          setVirtualSpeed(value);
        }}
      />
      {speed > 1 && (
        <p class="hint">
          All of its time passes faster, also the one after which an idle printer switches off.
        </p>
      )}
    </>
  );
}
