// The page as a whole. The shell (connecting, emergency stop, settings) is there at once; what needs the planner says so.
import { useSignal } from '@preact/signals';
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

export function App(): JSX.Element {
  const isOver = useDrop();
  return (
    <>
      <div class="page-head">
        <TopBar />
        <TroubleBanner />
        <Notices />
      </div>
      <main class="layout">
        <div class="stage">
          <Viewer />
          <Job />
        </div>
        <div class="side">
          <WatchedMachines />
          {!isViewing.value && (
            <>
              <Temperatures />
              <Motion />
              <Tuning />
            </>
          )}
          <Instruments />
          <Console />
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
