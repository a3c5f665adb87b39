// Taking files that are dropped or picked. What is in them is judged by the planner, not by their names; but a
// machine's file goes by its name.

import sampleUrl from '../../../samples/test-part.gcode?url';
import { connection, trouble } from '../state/machine';
import { openFile } from '../state/preview';
import { importProfile } from '../state/profiles';
import { openDialog } from './dialogs';

const ACCEPTED = '.gcode,.gco,.g,.gz,.nc,.txt,text/x.gcode';
const MACHINE_FILE = /\.(cfg|conf)$/i;

/** Lets the user pick a file of G-code, for whatever it is wanted. */
export function pickWith(take: (file: File) => void): void {
  const input = document.createElement('input');
  input.type = 'file';
  input.accept = ACCEPTED;
  input.onchange = () => {
    const picked = input.files?.[0];
    if (picked) take(picked);
  };
  input.click();
}

/** Lets the user pick a file to look at. */
export const pickFile = (): void => pickWith((file) => openFile(file, file.name));

const SAMPLE_MISSING = {
  code: 'sample-missing',
  line: null,
  happened: 'The sample could not be loaded.',
  safe: 'Nothing moves, nothing is switched on by it.',
  todo: 'Check that the server of this page still runs, then try again; or open a file of your own.',
};

/** Opens the test part that is shipped. */
export async function openSample(): Promise<void> {
  try {
    const response = await fetch(sampleUrl);
    if (!response.ok) throw new Error(response.statusText);
    openFile(await response.blob(), 'test-part.gcode');
  } catch {
    trouble.value = SAMPLE_MISSING;
  }
}

/** The first file of a drop: a print, or a machine, which becomes a profile of its own. */
export function dropped(data: DataTransfer | null): void {
  const file = data?.files[0];
  if (!file) return;
  if (!MACHINE_FILE.test(file.name)) return openFile(file, file.name);
  // The machine that is connected stays the one in use.
  void importProfile(file, connection.value === 'closed');
  openDialog.value = 'machine';
}
