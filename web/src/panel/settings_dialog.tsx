// Settings: theme, presets for materials, the diagnostic report.
import type { JSX } from 'preact';
import { allowNotifications, canNotify } from '../state/notify';
import { change, PRESETS_MAX, type Preset, settings, type Theme } from '../state/settings';
import { openDialog } from './dialogs';
import { PanelDialog } from './emergency';
import { Button, Choice, download, NumberField } from './parts';
import { diagnosticReport } from './report';

const NOZZLE_MAX_C = 500;
const BED_MAX_C = 200;

function PresetRow({ preset, index }: { readonly preset: Preset; readonly index: number }): JSX.Element {
  const presets = settings.value.presets;
  const set = (changes: Partial<Preset>): void =>
    change({ presets: presets.map((other, at) => (at === index ? { ...other, ...changes } : other)) });
  return (
    <li class="preset">
      <label class="field">
        Name
        <input
          type="text"
          maxLength={24}
          value={preset.name}
          onChange={(event) => set({ name: event.currentTarget.value.trim() || preset.name })}
        />
      </label>
      <NumberField
        label="Nozzle"
        unit="°C"
        value={preset.nozzle}
        min={0}
        max={NOZZLE_MAX_C}
        onSet={(nozzle) => set({ nozzle })}
      />
      <NumberField
        label="Bed"
        unit="°C"
        value={preset.bed}
        min={0}
        max={BED_MAX_C}
        onSet={(bed) => set({ bed })}
      />
      <Button
        icon="close"
        kind="quiet"
        label={`Remove ${preset.name}`}
        onClick={() => change({ presets: presets.filter((_, at) => at !== index) })}
      />
    </li>
  );
}

/** Opt-in: the browser asks the user when the box is ticked, and at no other time. */
function NotificationChoice(): JSX.Element {
  const isRefused = canNotify && Notification.permission === 'denied';
  const isOn = settings.value.notifications && !isRefused;
  const set = async (box: HTMLInputElement): Promise<void> => {
    if (!box.checked) return change({ notifications: false });
    // The box shows what holds, not what was wished for.
    box.checked = await allowNotifications();
  };
  return (
    <>
      <label class="check">
        <input
          type="checkbox"
          checked={isOn}
          disabled={!canNotify || isRefused}
          onChange={(event) => void set(event.currentTarget)}
        />
        Tell me when a print ends, pauses, is held or fails while this page is hidden
      </label>
      {isRefused && (
        <p class="hint">The browser does not allow it: change that in its settings for this site.</p>
      )}
      {!canNotify && <p class="hint">This browser has no notifications for pages.</p>}
    </>
  );
}

export function SettingsDialog(): JSX.Element {
  const { theme, presets } = settings.value;
  const themes: readonly { readonly value: Theme; readonly text: string }[] = [
    { value: 'system', text: 'As the system' },
    { value: 'light', text: 'Light' },
    { value: 'dark', text: 'Dark' },
  ];
  return (
    <PanelDialog title="Settings" onClose={() => (openDialog.value = null)}>
      <div class="stack">
        <h3>Theme</h3>
        <Choice
          label="Theme"
          hideLabel
          choices={themes}
          value={theme}
          onSet={(value) => change({ theme: value })}
        />
        <h3>Temperature presets</h3>
        <ul class="presets">
          {presets.map((preset, index) => (
            <PresetRow key={index} preset={preset} index={index} />
          ))}
        </ul>
        <div class="row">
          <Button
            disabled={presets.length >= PRESETS_MAX}
            onClick={() => change({ presets: [...presets, { name: 'New', nozzle: 200, bed: 60 }] })}
          >
            Add a preset
          </Button>
        </div>
        <h3>Notifications</h3>
        <NotificationChoice />
        <h3>When something is wrong</h3>
        <p class="hint">
          The report holds the machine file, the messages and counts of the connection, nothing of your prints
          but the file’s name. It is saved on this computer and sent nowhere.
        </p>
        <div class="row">
          <Button icon="download" onClick={() => download(diagnosticReport(), 'stepcast-report.txt')}>
            Diagnostic report
          </Button>
        </div>
      </div>
    </PanelDialog>
  );
}
