// Taking files that are dropped or picked. What is in them is judged by the planner, not by their names.

import sampleUrl from '../../../samples/test-part.gcode?url';
import { openFile } from '../state/preview';

export const ACCEPTED = '.gcode,.gco,.g,.gz,.nc,.txt,text/x.gcode';

/** Lets the user pick a file. */
export function pickFile(): void {
  const input = document.createElement('input');
  input.type = 'file';
  input.accept = ACCEPTED;
  input.onchange = () => {
    const picked = input.files?.[0];
    if (picked) openFile(picked, picked.name);
  };
  input.click();
}

/** Opens the test part that is shipped. */
export async function openSample(): Promise<void> {
  const response = await fetch(sampleUrl);
  if (response.ok) openFile(await response.blob(), 'test-part.gcode');
}

/** The first file of a drop. */
export function dropped(data: DataTransfer | null): void {
  const file = data?.files[0];
  if (file) openFile(file, file.name);
}
