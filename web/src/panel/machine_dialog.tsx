// The machine's file: profiles, editing, what is wrong by line, taking files in and giving them out.
import { useSignal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect, useId } from 'preact/hooks';
import type { ConfigReport, Remark } from '../preview/protocol';
import { connection } from '../state/machine';
import { checkConfig } from '../state/preview';
import {
  activeProfile,
  CONFIG_CHARACTERS_MAX,
  newProfileId,
  type Profile,
  profiles,
  profilesAreKept,
  removeProfile,
  SHIPPED,
  saveProfile,
} from '../state/profiles';
import { change } from '../state/settings';
import { formatNumber } from './numbers';
import { Button, Dialog, download } from './parts';
import { openDialog } from './top_bar';

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

function ProfileRow({
  profile,
  onChange,
}: {
  readonly profile: Profile;
  readonly onChange: (id: string) => void;
}): JSX.Element {
  const create = (name: string, config: string): void => {
    const id = newProfileId();
    void saveProfile({ id, name, config });
    onChange(id);
  };
  const take = async (file: File | undefined): Promise<void> => {
    if (!file || file.size > CONFIG_CHARACTERS_MAX) return;
    create(file.name.replace(/\.cfg$/i, '').slice(0, 60) || 'Machine', await file.text());
  };
  const isShipped = profile.id === SHIPPED.id;
  const isChanged = !isShipped || profile.config !== SHIPPED.config || profile.name !== SHIPPED.name;
  const question = isShipped ? 'Put the shipped file back?' : `Delete the profile “${profile.name}”?`;
  return (
    <div class="row wrap end">
      <label class="field grow">
        Profile
        <select value={profile.id} onChange={(event) => onChange(event.currentTarget.value)}>
          {profiles.value.map(({ id, name }) => (
            <option key={id} value={id}>
              {name}
            </option>
          ))}
        </select>
      </label>
      <Button onClick={() => create(`${profile.name} copy`.slice(0, 60), profile.config)}>Duplicate</Button>
      <label class="button plain file-button">
        <input
          type="file"
          accept=".cfg,.txt,.conf"
          class="unseen"
          onChange={(event) => void take(event.currentTarget.files?.[0])}
        />
        <span>Open printer.cfg</span>
      </label>
      <Button
        disabled={!isChanged}
        onClick={() => window.confirm(question) && void removeProfile(profile.id)}
      >
        {isShipped ? 'Put back' : 'Delete'}
      </Button>
    </div>
  );
}

export function MachineDialog(): JSX.Element {
  const profile = activeProfile.value;
  const isBusy = connection.value !== 'closed';
  return (
    <Dialog title="Machine" wide onClose={() => (openDialog.value = null)}>
      <div class="stack">
        {isBusy && <p class="hint">Disconnect to change the machine: the board was set up from this file.</p>}
        <fieldset class="bare stack" disabled={isBusy}>
          <ProfileRow profile={profile} onChange={(id) => change({ profile: id })} />
          <Editor key={profile.id + profile.config.length} profile={profile} />
        </fieldset>
        {!profilesAreKept.value && (
          <p class="hint">This browser keeps nothing for this page: download what you change.</p>
        )}
      </div>
    </Dialog>
  );
}

function Editor({ profile }: { readonly profile: Profile }): JSX.Element {
  const areaId = useId();
  const name = useSignal(profile.name);
  const text = useSignal(profile.config);
  const report = useSignal<ConfigReport | null>(null);
  const draft = text.value;
  useEffect(() => {
    let isCurrent = true;
    const timer = setTimeout(() => {
      void checkConfig(draft).then((found) => {
        if (isCurrent) report.value = found;
      });
    }, CHECK_DELAY_MS);
    return () => {
      isCurrent = false;
      clearTimeout(timer);
    };
  }, [draft]);
  const isChanged = draft !== profile.config || name.value.trim() !== profile.name;
  const save = (): void =>
    void saveProfile({ ...profile, name: name.value.trim() || profile.name, config: draft });
  return (
    <div class="stack">
      <label class="field">
        Name
        <input
          type="text"
          maxLength={60}
          value={name.value}
          onInput={(event) => (name.value = event.currentTarget.value)}
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
        value={draft}
        onInput={(event) => (text.value = event.currentTarget.value)}
      />
      <div role="status">
        <Verdict report={report.value} />
      </div>
      {report.value && report.value.remarks.length > 0 && (
        <RemarkList remarks={report.value.remarks} area={areaId} />
      )}
      <div class="dialog-foot">
        <Button icon="download" onClick={() => download(draft, `${name.value.trim() || 'printer'}.cfg`)}>
          Download
        </Button>
        <Button kind="primary" class="big" disabled={!isChanged} onClick={save}>
          Save
        </Button>
      </div>
    </div>
  );
}
