// The machine as the page knows it, and what the page may ask of it. The other end is the machine worker.
// Knows neither ports nor the protocol.
import { computed, signal } from '@preact/signals';
import type { VirtualState } from '../bindings/VirtualState';
import type {
  FromMachine,
  KeptFile,
  MachineEvent,
  PortChoice,
  PrintFacts,
  PrintStart,
  Snapshot,
  ToMachine,
  Trouble,
  Wish,
} from '../machine/protocol';
import { plannerMissing, portTrouble, stopNotSent, workerDied } from '../machine/troubles';
import { stalled } from './incidents';
import { heldPrint, keptPrints } from './kept';
import { forgetLineErrors, noteLineErrors } from './line_errors';
import { note } from './log';
import { notify, withdraw } from './notices';
import type { Profile } from './profiles';

export type ConnectionState = 'closed' | 'opening' | 'open';

export const plannerLoaded = signal(false);
/** The planner cannot be loaded: nothing but the shell will work. */
export const plannerFailed = signal(false);
export const connection = signal<ConnectionState>('closed');
export const port = signal<PortChoice | null>(null);
export const snapshot = signal<Snapshot | null>(null);
/** The virtual printer's own record; of the last connection once that is closed. */
export const virtualRecord = signal<VirtualState | null>(null);
/** The planned speed around now while it is watched: pairs of s from now and mm/s. */
export const plannedSpeed = signal(new Float64Array());
export const firmware = signal<{ readonly version: string; readonly mcu: string } | null>(null);
/** What the user has to be told, until it is put away or overtaken. */
export const trouble = signal<Trouble | null>(null);
/** No news came for a while: what is known is old, and may not hold any more. */
export const isStale = signal(false);
/** How the last print ended. */
export const outcome = signal<'done' | 'cancelled' | 'stopped' | null>(null);

export const isReady = computed(() => connection.value === 'open' && snapshot.value?.phase === 'ready');
/** The board holds a print whose page is gone. */
export const isHolding = computed(() => connection.value === 'open' && snapshot.value?.phase === 'holding');
export const isShutdown = computed(() => connection.value === 'open' && snapshot.value?.phase === 'shutdown');
export const job = computed(() => (isReady.value ? (snapshot.value?.job ?? 'none') : 'none'));
export const isPrinting = computed(() => job.value !== 'none');
/** Whether the head may be moved by hand. */
export const mayMove = computed(() => isReady.value && (job.value === 'none' || job.value === 'paused'));

/** News come ten times a second; after so long without any they are old, in ms. */
const STALE_MS = 2000;
/** An emergency stop that is not answered by then is taken for lost, in ms. */
const STOP_ANSWER_MS = 1000;
/** A worker that stops this often without a connection in between is not started again. */
const DEATHS_MAX = 3;

/** What came of a wish: null where it is being done, 'gone' where the worker went without an answer. */
type Answer = Trouble | null | 'gone';

let worker: Worker | undefined;
let deaths = 0;
let lastId = 0;
/** A print was begun since the last snapshot. */
let isBegun = false;
/** Why motion was held last. */
let heldFor: Trouble | null = null;
let newsTimer: ReturnType<typeof setTimeout> | undefined;
const waiting = new Map<number, (answer: Answer) => void>();
/** For files of kept prints; a worker that is gone has none. */
const filesWaiting = new Map<number, (found: KeptFile) => void>();
const NO_FILE: KeptFile = { kind: 'missing', trouble: null };

/** Starts the worker, which loads the planner. */
export function startMachine(): void {
  const started = new Worker(new URL('../machine/worker.ts', import.meta.url), {
    type: 'module',
    name: 'machine',
  });
  // What an ended worker sent before it ended may still arrive.
  started.onmessage = ({ data }: MessageEvent<FromMachine>) => {
    if (worker === started) take(data);
  };
  started.onerror = (event) => {
    event.preventDefault();
    // Where its script cannot be loaded, there is no message.
    if (worker === started) died(event.message || 'its script could not be loaded');
  };
  worker = started;
}

/** The worker is of no use any more. Ending it closes its port and lets go of its lock. */
function died(message: string): void {
  worker?.terminate();
  worker = undefined;
  deaths += 1;
  if (!plannerLoaded.value || deaths > DEATHS_MAX) return closed(plannerMissing(message));
  const kind = connection.value === 'closed' ? null : (port.value?.kind ?? null);
  plannerLoaded.value = false;
  closed(workerDied(message, kind));
  startMachine();
}

function news(): void {
  clearTimeout(newsTimer);
  isStale.value = false;
  if (connection.value !== 'open') return;
  newsTimer = setTimeout(() => {
    isStale.value = true;
  }, STALE_MS);
}

const send = (message: ToMachine): void => worker?.postMessage(message);

function closed(reason: Trouble | null): void {
  const wasOpen = connection.value !== 'closed';
  if (isPrinting.value) outcome.value = 'stopped';
  connection.value = 'closed';
  port.value = null;
  snapshot.value = null;
  heldPrint.value = null;
  plannedSpeed.value = new Float64Array();
  firmware.value = null;
  news();
  for (const settle of waiting.values()) settle('gone');
  waiting.clear();
  for (const settle of filesWaiting.values()) settle(NO_FILE);
  filesWaiting.clear();
  if (reason) report(reason);
  if (reason?.code === 'planner-missing') plannerFailed.value = true;
  if (wasOpen) note('info', 'Disconnected.');
}

/** Tells the user. */
export function report(reason: Trouble): void {
  trouble.value = reason;
  note('error', reason.happened);
}

function take(message: FromMachine): void {
  switch (message.kind) {
    case 'loaded':
      plannerLoaded.value = true;
      break;
    case 'opened':
      connection.value = 'open';
      forgetLineErrors();
      deaths = 0;
      news();
      trouble.value = null;
      outcome.value = null;
      note('info', 'Port open; asking the board who it is.');
      break;
    case 'closed':
      closed(message.trouble);
      break;
    case 'died':
      died(message.message);
      break;
    case 'snapshot':
      if (connection.value === 'open') look(message.snapshot);
      send({ kind: 'seen' });
      break;
    case 'planned-speed':
      if (connection.value === 'open') plannedSpeed.value = message.pairs;
      break;
    case 'record':
      virtualRecord.value = message.record;
      break;
    case 'events':
      for (const event of message.events) happened(event);
      break;
    case 'kept':
      keptPrints.value = message.prints;
      break;
    case 'held-print':
      if (connection.value === 'open') heldPrint.value = message.held;
      break;
    case 'not-kept': {
      const { happened, safe, todo } = message.trouble;
      note('warning', happened);
      notify({ kind: 'not-kept', text: `${happened} ${safe} ${todo}` });
      break;
    }
    case 'kept-file':
      filesWaiting.get(message.id)?.(message.found);
      filesWaiting.delete(message.id);
      break;
    case 'answer': {
      waiting.get(message.id)?.(message.trouble);
      waiting.delete(message.id);
      break;
    }
    case 'gap':
      stalled(message.seconds, isPrinting.value);
      break;
  }
}

function look(now: Snapshot): void {
  if (now.link) noteLineErrors(now.link.lineErrors);
  const wasPrinting = isPrinting.value;
  snapshot.value = now;
  news();
  // It ended without a word of how: in an error.
  if ((wasPrinting || isBegun) && !isPrinting.value) outcome.value ??= 'stopped';
  isBegun = false;
}

const PHASES: Record<Snapshot['phase'], string> = {
  identifying: 'Asking the board who it is.',
  synchronising: 'Measuring the board\u2019s clock.',
  restarting: 'The board restarts.',
  configuring: 'Setting up the board.',
  holding: 'The board holds a print whose page is gone.',
  ready: 'The printer is ready.',
  shutdown: 'The board has stopped.',
  failed: 'The connection failed.',
};

function happened(event: MachineEvent): void {
  switch (event.kind) {
    case 'phase':
      if (event.phase !== 'ready' && isPrinting.value) outcome.value = 'stopped';
      if (event.phase === 'ready') trouble.value = null;
      note('info', PHASES[event.phase]);
      break;
    case 'identified':
      firmware.value = { version: event.version, mcu: event.mcu };
      note('info', `Board: ${event.mcu}, firmware ${event.version}.`);
      break;
    case 'message':
      note('info', event.text);
      break;
    case 'notice':
      note(
        event.severity === 'info' ? 'info' : 'warning',
        event.line > 0 ? `Line ${event.line}: ${event.text}` : event.text,
      );
      break;
    case 'homed':
      note('info', `${event.axis} is homed at ${event.position.toFixed(2)} mm.`);
      break;
    case 'paused':
      note('info', 'Paused.');
      break;
    case 'resumed':
      // What was held goes on: why it was does not stand any more.
      if (trouble.value === heldFor) trouble.value = null;
      note('info', 'The print goes on.');
      break;
    case 'done':
      outcome.value = 'done';
      note('info', 'The print is done.');
      break;
    case 'cancelled':
      if (trouble.value === heldFor) trouble.value = null;
      outcome.value = 'cancelled';
      note('info', 'The print was cancelled.');
      break;
    case 'held':
      heldFor = event.trouble;
      report(event.trouble);
      break;
    case 'trouble':
      report(event.trouble);
      break;
    case 'dropped':
      note('warning', `${event.count} messages were left out.`);
      break;
  }
}

/** The file of the print that the board holds, where the page has no copy of it. */
export const giveHeldFile = (file: Blob): void => send({ kind: 'held-file', file });
/** The file of a kept print: its copy, or what the user has given, where that is it. */
export function keptFile(print: string, given: Blob | null): Promise<KeptFile> {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve) => {
    if (!worker) return resolve(NO_FILE);
    filesWaiting.set(id, resolve);
    send({ kind: 'kept-file', id, print, given });
  });
}
/** Nothing of an interrupted print is to be kept. */
export const forgetPrint = (id: string): void => send({ kind: 'forget', id });
/** Another tab may have changed which prints are kept. */
export const lookForPrints = (): void => send({ kind: 'list-kept' });

/** Of this tab's connection, the present or the last one. */
export const connectionId = signal('');

/** `name` is what the user calls the machine, `config` its file. */
export function connect(choice: PortChoice, { name, config }: Pick<Profile, 'name' | 'config'>): void {
  if (connection.value !== 'closed') return;
  connection.value = 'opening';
  connectionId.value = crypto.randomUUID();
  port.value = choice;
  virtualRecord.value = null;
  trouble.value = null;
  send({ kind: 'connect', port: choice, config, id: connectionId.value, name });
}

/** Whether `plannedSpeed` is wanted. */
export const watchSpeed = (on: boolean): void => send({ kind: 'watch-speed', on });

/** A worker that says nothing any more is ended instead. */
export function disconnect(): void {
  if (isStale.value) died('it did not answer');
  else send({ kind: 'disconnect' });
}

/** A port that could not even be chosen. */
export const refusePort = (error: unknown): void => report(portTrouble(error));

function ask(make: (id: number) => ToMachine): Promise<Answer> {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve) => {
    waiting.set(id, resolve);
    send(make(id));
  });
}

/** Shows a refusal. True where what was asked for is being done. */
function isDone(answer: Answer): boolean {
  if (answer !== null && answer !== 'gone') report(answer);
  return answer === null;
}

/** Asks for something; a refusal is shown. True where it is being done. */
export async function wish(wanted: Wish): Promise<boolean> {
  return isDone(await ask((id) => ({ kind: 'wish', id, wish: wanted })));
}

/** `continues` is the interrupted print that it goes on with. */
export async function print(
  file: Blob,
  facts: PrintFacts,
  start: PrintStart,
  continues: string | null = null,
): Promise<boolean> {
  outcome.value = null;
  withdraw('not-kept');
  isBegun = isDone(await ask((id) => ({ kind: 'print', id, file, facts, start, continues })));
  return isBegun;
}

export async function gcode(text: string): Promise<boolean> {
  note('sent', text);
  return wish({ kind: 'gcode', text });
}

export function setVirtualSpeed(speed: number): void {
  if (port.value?.kind !== 'virtual') return;
  port.value = { ...port.value, speed };
  send({ kind: 'speed', speed });
}

/** At once, whatever else is going on. A stop that cannot be sent is shown, and so is one that is not answered. */
export async function emergencyStop(): Promise<void> {
  note('error', 'Emergency stop pressed.');
  const late = setTimeout(() => report(stopNotSent('no-answer')), STOP_ANSWER_MS);
  const answer = await ask((id) => ({ kind: 'wish', id, wish: { kind: 'emergency-stop' } }));
  clearTimeout(late);
  if (answer === null) return;
  report(answer === 'gone' ? stopNotSent('no-answer') : answer);
}
