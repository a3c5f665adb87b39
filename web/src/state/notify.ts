// Notifications of the system about a print, where the user asked for them and only while the page is hidden: who sees
// the page needs none. Also the advice to pin the tab. Knows no panel.
import { effect } from '@preact/signals';
import { note } from './log';
import { isPrinting, job, outcome, port, trouble } from './machine';
import { notify as show, withdraw } from './notices';
import { printed } from './print';
import { change, settings } from './settings';

/** From here on a print is long enough for the tab to be in danger, in s. */
const LONG_PRINT_S = 1800;
const PIN_ADVICE =
  'A long print: pin this tab (a right click on it, Pin), so that it is not closed by accident or discarded by the browser. The computer must not sleep.';

/** Whether the system can be asked at all. */
export const canNotify = 'Notification' in globalThis;

/** Asks the user's leave; to be called from a click. True where notifications will come. */
export async function allowNotifications(): Promise<boolean> {
  try {
    const answer = await Notification.requestPermission();
    change({ notifications: answer === 'granted' });
    if (answer !== 'granted') note('warning', 'The browser does not allow this page to send notifications.');
    return answer === 'granted';
  } catch {
    return false;
  }
}

function send(title: string, body: string): void {
  if (!settings.peek().notifications || !canNotify || Notification.permission !== 'granted') return;
  if (document.visibilityState !== 'hidden') return;
  try {
    // One after the other in one place: only the last news counts.
    const sent = new Notification(title, { body, tag: 'stepcast', icon: './icon.svg' });
    sent.onclick = () => {
      window.focus();
      sent.close();
    };
  } catch {
    // Phones want it from a service worker; there the page is not meant to print from.
  }
}

const ENDS = {
  done: 'The print is done',
  cancelled: 'The print was cancelled',
  stopped: 'The print stopped before its end',
} as const;

/** Tells of ends, pauses, holds and errors. */
export function followForNotifications(): void {
  const name = (): string => printed.peek()?.file.name ?? 'Print';
  effect(() => {
    if (outcome.value) send(ENDS[outcome.value], name());
  });
  effect(() => {
    if (job.value === 'paused') send('The print is paused', name());
  });
  effect(() => {
    if (trouble.value) send(trouble.value.happened, trouble.value.todo);
  });
}

/** At the start of a long print on a real printer: once and never again, when it was put away. */
export function advisePinning(): void {
  effect(() => {
    if (!isPrinting.value) return withdraw('pin');
    const long = (printed.value?.summary.time ?? 0) >= LONG_PRINT_S;
    if (!long || port.peek()?.kind !== 'serial' || settings.peek().knowsPinning) return;
    show({ kind: 'pin', text: PIN_ADVICE, onClosed: () => change({ knowsPinning: true }) });
  });
}
