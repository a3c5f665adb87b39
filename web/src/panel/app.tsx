// The page as a whole. The shell (connecting, emergency stop, settings) is there at once; what needs the planner says so.
import { signal, useSignal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect } from 'preact/hooks';
import { isPrinting } from '../state/machine';
import { isViewing } from '../state/watched';
import { ConnectDialog } from './connect_dialog';
import { Console } from './console';
import { openDialog } from './dialogs';
import { HeldDialog } from './held_dialog';
import { Instruments } from './instruments';
import { Job } from './job';
import { MachineDialog } from './machine_dialog';
import { Motion } from './motion';
import { Notices } from './notices';
import { dropped } from './open_file';
import { Asked } from './question';
import { SettingsDialog } from './settings_dialog';
import { StartDialog } from './start_dialog';
import { Temperatures } from './temperatures';
import { TopBar } from './top_bar';
import { TroubleBanner } from './trouble_banner';
import { Tuning } from './tuning';
import { Viewer } from './viewer';
import { WatchedMachines } from './watched';

const holdsFile = (event: DragEvent): boolean => event.dataTransfer?.types.includes('Files') ?? false;

/** Files may be dropped anywhere on the page; true while one is held above it. */
function useDrop(): boolean {
  const over = useSignal(false);
  useEffect(() => {
    const stop = new AbortController();
    const on = <K extends 'dragover' | 'dragleave' | 'drop'>(
      type: K,
      act: (event: DragEvent) => void,
    ): void => window.addEventListener(type, act, { signal: stop.signal });
    on('dragover', (event) => {
      if (!holdsFile(event)) return;
      event.preventDefault();
      over.value = true;
    });
    on('dragleave', (event) => {
      if (event.relatedTarget === null) over.value = false;
    });
    on('drop', (event) => {
      if (!holdsFile(event)) return;
      event.preventDefault();
      over.value = false;
      dropped(event.dataTransfer);
    });
    return () => stop.abort();
  }, []);
  return over.value;
}

/** The page's parts below its head in the order in which they come when it starts. */
export const PARTS = ['viewer', 'job', 'machine', 'rest'] as const;
/** The last of them that is there. */
export const shownUpTo = signal<(typeof PARTS)[number] | null>(null);

export function App(): JSX.Element {
  const isOver = useDrop();
  const last = shownUpTo.value === null ? -1 : PARTS.indexOf(shownUpTo.value);
  const isThere = (part: (typeof PARTS)[number]): boolean => PARTS.indexOf(part) <= last;
  return (
    <>
      <div class="page-head">
        <TopBar />
        <TroubleBanner />
        <Notices />
      </div>
      <main class="layout">
        <div class="stage">
          {isThere('viewer') && <Viewer />}
          {isThere('job') && <Job />}
        </div>
        <div class="side">
          <WatchedMachines />
          {isThere('machine') && !isViewing.value && (
            <>
              <Temperatures />
              <Motion />
              <Tuning />
            </>
          )}
          {isThere('rest') && (
            <>
              <Instruments />
              <Console />
            </>
          )}
        </div>
      </main>
      {isOver && (
        <div class="drop-veil" aria-hidden="true">
          {isPrinting.value ? 'Drop to look at the file; the print goes on' : 'Drop the G-code file'}
        </div>
      )}
      {openDialog.value === 'connect' && <ConnectDialog />}
      {openDialog.value === 'machine' && <MachineDialog />}
      {openDialog.value === 'settings' && <SettingsDialog />}
      <HeldDialog />
      <StartDialog />
      <Asked />
    </>
  );
}
