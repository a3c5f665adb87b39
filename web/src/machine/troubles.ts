// What can go wrong between the page and the port, in the same three parts as the planner's catalogue.
// Knows nothing of the protocol; what the planner finds wrong is worded there.
import type { AnswerKind } from '../transport/answer';
import { PortError, type PortFailureCode } from '../transport/transport';
import type { Trouble } from './protocol';
import type { StorageCode } from './storage';

const NOTHING_MOVED = 'Nothing was sent to the printer: it did not move and no heater was switched on.';
const ON_ITS_OWN =
  'The printer is on its own. A board with Stepcast\u2019s firmware brings the head to rest on its path and lowers the nozzle to stand-by; any other board switches the heaters off within 5 seconds and stops when its queue of moves is empty, its position lost.';

const trouble = (code: string, happened: string, safe: string, todo: string): Trouble => ({
  code,
  line: null,
  happened,
  safe,
  todo,
});

const PORT: Record<PortFailureCode | 'port-unusable', readonly [string, string, string]> = {
  unplugged: [
    'The printer was unplugged, or its board switched off.',
    ON_ITS_OWN,
    'Look at the printer first. Plug it in again and connect; a print does not start again by itself.',
  ],
  'port-busy': [
    'The port could not be opened.',
    NOTHING_MOVED,
    'Another program or another tab probably holds it: close slicers, serial monitors and other control panels, then connect again. On Linux your user also needs permission for the port (group dialout or uucp).',
  ],
  'port-gone': [
    'The port is not there any more.',
    NOTHING_MOVED,
    'Check the cable and the printer\u2019s power, then choose the port again.',
  ],
  'port-error': [
    'The connection gives nothing but errors.',
    ON_ITS_OWN,
    'Check the baud rate, use a shorter cable without a hub, then connect again and home.',
  ],
  'port-unusable': [
    'The browser could not use the port.',
    NOTHING_MOVED,
    'Reload the page and choose the port again. If it stays so, please report it with the diagnostic report.',
  ],
};

const detail = (error: unknown): string => {
  if (error instanceof PortError) return error.cause === undefined ? '' : detail(error.cause);
  return error instanceof Error ? error.message : String(error);
};

/** A port's failure; what is not a port's own error came before anything was sent. */
export function portTrouble(error: unknown): Trouble {
  const code = error instanceof PortError ? error.code : 'port-unusable';
  const [happened, safe, todo] = PORT[code];
  const text = detail(error);
  return trouble(code, text ? `${happened} (${text})` : happened, safe, todo);
}

/** Another tab drives the printer. */
export const portInUse = (): Trouble =>
  trouble(
    'port-in-use',
    'Another tab of this browser is connected to this printer.',
    NOTHING_MOVED,
    'Go on in that tab, or disconnect there first.',
  );

/** The tab that drove a machine is gone without a word: closed, reloaded, or crashed. */
export const driverGone = (name: string, port: 'serial' | 'virtual', wasPrinting: boolean): Trouble =>
  trouble(
    'driver-gone',
    `The tab that drove ${name} is gone${wasPrinting ? ' in the middle of a print' : ''}.`,
    port === 'serial' ? ON_ITS_OWN : 'The virtual printer was a part of that tab and is gone with it.',
    port === 'serial'
      ? 'Look at the printer first. This tab can take it over: connect here. A print does not start again by itself.'
      : 'Connect a virtual printer here to begin anew.',
  );

/** A file that is not being printed. */
export const fileUnreadable = (error: unknown): Trouble =>
  trouble(
    'file-unreadable',
    `The file could not be read to its end. (${detail(error)})`,
    'Nothing of it was sent to the printer.',
    'Make the file readable again (disk, network drive, permission) and drop it anew. A file that was saved again has to be dropped again, too.',
  );

/** A file that is being printed. */
export const fileBrokeOff = (error: unknown): Trouble =>
  trouble(
    'file-unreadable',
    `The file that is being printed could not be read to its end. (${detail(error)})`,
    'The moves sent so far are carried out, then the print waits with its position known. The heaters stay on until it is cancelled.',
    'Cancel the print: it cannot go on, since the rest of its file is not known. A file that was saved again, moved or deleted has to be dropped anew.',
  );

export const notGcode = (todo: string): Trouble =>
  trouble('file-binary', 'The file is not plain G-code.', NOTHING_MOVED, todo);

export const plannerMissing = (error: unknown): Trouble =>
  trouble(
    'planner-missing',
    `The planner could not be loaded. (${detail(error)})`,
    NOTHING_MOVED,
    'Reload the page. If it stays so, the page was not copied completely, or the browser forbids WebAssembly.',
  );

/** `port` is what was connected; null for nothing. */
export const workerDied = (message: string, port: 'serial' | 'virtual' | null): Trouble =>
  trouble(
    'worker-died',
    `The part of the page that drives the printer has stopped. (${message})`,
    {
      serial: ON_ITS_OWN,
      virtual: 'The virtual printer was a part of the page and is gone with it.',
      none: 'No printer was connected.',
    }[port ?? 'none'],
    port === 'serial'
      ? 'Look at the printer first, then connect again and home; a print does not start again by itself. Please report it with the diagnostic report.'
      : 'It has been started anew: connect again. Please report it with the diagnostic report.',
  );

export const previewDied = (message: string): Trouble =>
  trouble(
    'preview-died',
    `The part of the page that reads files has stopped. (${message})`,
    'It does not drive the printer: a running print is not touched.',
    'Open the file again; reload the page where that does not help. If it stops again, please report it with the diagnostic report.',
  );

const STOP_REASONS = {
  'not-open': 'the port is not open',
  identifying: 'the board has not said yet how it is spoken to',
  failed: 'the connection to the board has failed',
  'no-answer': 'the part of the page that drives the printer does not answer',
} as const;

/** An emergency stop that did not reach the printer, as far as is known. */
export const stopNotSent = (reason: keyof typeof STOP_REASONS): Trouble =>
  trouble(
    'stop-not-sent',
    `No emergency stop could be sent: ${STOP_REASONS[reason]}.`,
    reason === 'identifying'
      ? 'The stop is sent as soon as the board has said it. Until then nothing is known of what the printer does.'
      : 'Nothing is known of what the printer does. A board without orders lowers its heaters or switches them off within 5 seconds, and stops when its queue of moves is empty or before.',
    'If the printer moves or heats, cut its power now.',
  );

const ANSWERS: Partial<Record<AnswerKind, readonly [string, string]>> = {
  silent: [
    'The board does not answer at all.',
    'Check that the printer has power, that this is its port, and for boards with a UART the baud rate. A board that has just been flashed may need a reset.',
  ],
  marlin: [
    'The board answers in text, as Marlin, RepRapFirmware and their relatives do.',
    'This page drives boards with Klipper\u2019s firmware. Flash Klipper-compatible firmware, or print with a program for that firmware.',
  ],
  bootloader: [
    'A bootloader answers, not a firmware: the board waits to be flashed.',
    'Flash Klipper-compatible firmware, or press the board\u2019s reset button to start the one it has.',
  ],
  text: [
    'The board answers in text that this page does not know.',
    'Check that this is the printer\u2019s port, not another device\u2019s. This page drives boards with Klipper\u2019s firmware.',
  ],
  noise: [
    'The board answers, but nothing that can be read.',
    'The baud rate is probably wrong: 250000 and 115200 are common. Take the one that the firmware was built with.',
  ],
};

/** A more exact word for a board that could not be identified, by what it said; null where there is none. */
export function answerTrouble(answer: AnswerKind, code: string): Trouble | null {
  const words = ANSWERS[answer];
  return words ? trouble(code, words[0], NOTHING_MOVED, words[1]) : null;
}

const NOT_KEPT = 'The print itself is not touched; but it could not be continued after this page is gone.';
const STORAGE: Record<StorageCode, readonly [string, string]> = {
  unavailable: [
    'The browser keeps no files for this page.',
    'Open the page in an ordinary window, and allow it to store data.',
  ],
  full: [
    'There is no room to keep the print.',
    'Free space on this computer\u2019s disk, or delete old prints here.',
  ],
  'in-use': ['Another tab has this print open.', 'Go on in that tab, or close it.'],
  missing: ['This print is not kept any more.', 'Start it anew from its file.'],
  incomplete: ['The copy of the print\u2019s file is not whole.', 'Open the file again.'],
  'too-long': ['The journal of the print has grown too long.', 'Start the print anew from its file.'],
  broken: [
    'The browser\u2019s storage does not work.',
    'Reload the page. If it stays so, clear the data of this site in the browser\u2019s settings.',
  ],
};

/** Something about a print's journal or file that could not be kept or read. */
export function storageTrouble(code: StorageCode, error: unknown): Trouble {
  const [happened, todo] = STORAGE[code];
  const text = detail(error);
  return trouble(
    `storage-${code}`,
    text && text !== code ? `${happened} (${text})` : happened,
    NOT_KEPT,
    todo,
  );
}

/** Without the copy of the file; the journal is kept all the same. */
export const copyMissing = (code: StorageCode): Trouble =>
  trouble(
    'copy-missing',
    `The print\u2019s file could not be copied. (${code === 'full' ? 'there is no room' : STORAGE[code][0].replace(/\.$/, '')})`,
    'The print itself is not touched. To go on with it after this page is gone, its file would have to be opened again.',
    'Keep the file as it is until the print is done.',
  );

/** The user gave a file that cannot be the one. */
export const otherFile = (name: string): Trouble =>
  trouble(
    'other-file',
    `That is not the file that was being printed: ${name} had another size or other content.`,
    'Nothing was sent to the printer; the board goes on holding the print.',
    'Open the very file that the print was started with; one that was sliced again does not fit.',
  );
