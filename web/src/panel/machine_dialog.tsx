// The machine's file: profiles, editing, what is wrong by line, taking files in and giving them out.
import { computed, signal, useSignal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect, useId, useLayoutEffect } from 'preact/hooks';
import type { ConfigReport, Remark } from '../preview/protocol';
import { connection } from '../state/machine';
import { checkConfig } from '../state/preview';
import {
  activeProfile,
  CONFIG_CHARACTERS_MAX,
  importNotice,
  importProfile,
  newProfileId,
  type Profile,
  profiles,
  profilesAreKept,
  removeProfile,
  SHIPPED,
  saveProfile,
} from '../state/profiles';
import { change } from '../state/settings';
import { openDialog } from './dialogs';
import { PanelDialog } from './emergency';
import { formatNumber } from './numbers';
import { Button, download } from './parts';

/** The text is checked when nothing has been typed for so long, in ms. */
const CHECK_DELAY_MS = 300;

/** Marks a line in a text area and brings it into view. */
function goTo(area: HTMLTextAreaElement, line: number): void {
  const lines = area.value.split('\n');
  const start = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
  area.focus();
  area.setSelectionRange(start, start + (lines[line - 1]?.length ?? 0));
  const height = Number.parseFloat(getComputedStyle(area).lineHeight);
  area.scrollTop = Math.max(0, (line - 4) * height);
}

interface RemarkListProps {
  readonly remarks: readonly Remark[];
  readonly area: string;
}

function RemarkList({ remarks, area }: RemarkListProps): JSX.Element {
  const show = (line: number): void => {
    const element = document.getElementById(area);
    if (element instanceof HTMLTextAreaElement) goTo(element, line);
  };
  return (
    <ul class="config-remarks">
      {remarks.map(({ line, severity, text }, index) => (
        <li key={index} class={severity}>
          {line > 0 ? (
            <button type="button" class="link" onClick={() => show(line)}>
              Line {line}
            </button>
          ) : (
            <strong>File</strong>
          )}{' '}
          {text}
        </li>
      ))}
    </ul>
  );
}

function Verdict({ report }: { readonly report: ConfigReport | null }): JSX.Element {
  if (!report) return <p class="hint">Checking …</p>;
  const { machine } = report;
  if (!machine) return <p class="verdict bad">This file has errors, so it cannot be used.</p>;
  const room = machine.axes.map(({ min, max }) => formatNumber(max - min, 1, 0)).join(' × ');
  return <p class="verdict good">A machine with room for {room} mm.</p>;
}

interface ProfileRowProps {
  readonly profile: Profile;
  readonly isBusy: boolean;
  /** Whether the text on the screen may be put away. */
  readonly mayLeave: () => boolean;
}

function ProfileRow({ profile, isBusy, mayLeave }: ProfileRowProps): JSX.Element {
  const isShipped = profile.id === SHIPPED.id;
  const isChanged = !isShipped || profile.config !== SHIPPED.config || profile.name !== SHIPPED.name;
  const question = isShipped ? 'Put the shipped file back?' : `Delete the profile “${profile.name}”?`;
  const duplicate = (): void => {
    if (!mayLeave()) return;
    void saveProfile({ ...profile, id: newProfileId(), name: `${profile.name} copy`.slice(0, 60) });
  };
  const take = (input: HTMLInputElement): void => {
    const file = input.files?.[0];
    if (file && mayLeave()) void importProfile(file);
    // The same file may be picked again after it was changed.
    input.value = '';
  };
  return (
    <fieldset class="row wrap end" disabled={isBusy}>
      <legend class="unseen">Profiles</legend>
      <label class="field grow">
        Profile
        <select
          value={profile.id}
          onChange={({ currentTarget }) => {
            if (mayLeave()) change({ profile: currentTarget.value });
            else currentTarget.value = profile.id;
          }}
        >
          {profiles.value.map(({ id, name }) => (
            <option key={id} value={id}>
              {name}
            </option>
          ))}
        </select>
      </label>
      <Button onClick={duplicate}>Duplicate</Button>
      <label class="button plain file-button">
        <input
          type="file"
          accept=".cfg,.txt,.conf"
          class="unseen"
          onChange={(event) => take(event.currentTarget)}
        />
        <span>Open printer.cfg</span>
      </label>
      <Button
        disabled={!isChanged}
        onClick={() => window.confirm(question) && void removeProfile(profile.id)}
      >
        {isShipped ? 'Put back' : 'Delete'}
      </Button>
    </fieldset>
  );
}

/** A profile's name and text as they stand on the screen. */
const draft = signal<Pick<Profile, 'name' | 'config'>>(SHIPPED);
const isDraftChanged = computed(
  () => draft.value.config !== activeProfile.value.config || draft.value.name !== activeProfile.value.name,
);

export function MachineDialog(): JSX.Element {
  const profile = activeProfile.value;
  const isBusy = connection.value !== 'closed';
  // Only without a connection: the browser's own question stops the page.
  const mayLeave = (): boolean =>
    isBusy || !isDraftChanged.value || window.confirm('Leave without saving what you changed?');
  const close = (): void => {
    importNotice.value = null;
    openDialog.value = null;
  };
  return (
    <PanelDialog title="Machine" wide onClose={close} mayClose={mayLeave}>
      <div class="stack">
        {isBusy && <p class="hint">Disconnect to change the machine: the board was set up from this file.</p>}
        <ProfileRow profile={profile} isBusy={isBusy} mayLeave={mayLeave} />
        <div role="status">{importNotice.value && <p class="hint">{importNotice.value}</p>}</div>
        <Editor key={profile.id} profile={profile} isBusy={isBusy} />
        {!profilesAreKept.value && (
          <p class="hint">This browser keeps nothing for this page: download what you change.</p>
        )}
      </div>
    </PanelDialog>
  );
}

/** What the planner says to a text, a moment after it was last changed. */
function useReport(text: string): ConfigReport | null {
  const report = useSignal<ConfigReport | null>(null);
  useEffect(() => {
    let isCurrent = true;
    const timer = setTimeout(() => {
      void checkConfig(text).then((found) => {
        if (isCurrent) report.value = found;
      });
    }, CHECK_DELAY_MS);
    return () => {
      isCurrent = false;
      clearTimeout(timer);
    };
  }, [text]);
  return report.value;
}

function Editor({ profile, isBusy }: { readonly profile: Profile; readonly isBusy: boolean }): JSX.Element {
  const areaId = useId();
  const isSaved = useSignal(false);
  // What was put back or read anew replaces what stands here; what was saved from here is the same.
  useLayoutEffect(() => {
    draft.value = { name: profile.name, config: profile.config };
  }, [profile.name, profile.config]);
  const { name, config } = draft.value;
  const report = useReport(config);
  const edit = (changes: Partial<Profile>): void => {
    isSaved.value = false;
    draft.value = { ...draft.value, ...changes };
  };
  const save = (): void => {
    isSaved.value = true;
    void saveProfile({ ...profile, name: name.trim() || profile.name, config });
  };
  return (
    <div class="stack">
      <label class="field">
        Name
        <input
          type="text"
          maxLength={60}
          value={name}
          disabled={isBusy}
          onInput={(event) => edit({ name: event.currentTarget.value })}
        />
      </label>
      <label class="field" for={areaId}>
        printer.cfg
      </label>
      <textarea
        id={areaId}
        class="code config"
        spellcheck={false}
        maxLength={CONFIG_CHARACTERS_MAX}
        wrap="off"
        value={config}
        readOnly={isBusy}
        onInput={(event) => edit({ config: event.currentTarget.value })}
      />
      <div role="status">
        <Verdict report={report} />
      </div>
      {report && report.remarks.length > 0 && <RemarkList remarks={report.remarks} area={areaId} />}
      <div class="dialog-foot sticky">
        <span role="status" class="hint">
          {isSaved.value && !isDraftChanged.value ? 'Saved.' : ''}
        </span>
        <Button icon="download" onClick={() => download(config, `${name.trim() || 'printer'}.cfg`)}>
          Download
        </Button>
        <Button kind="primary" class="big" disabled={isBusy || !isDraftChanged.value} onClick={save}>
          Save
        </Button>
      </div>
    </div>
  );
}
