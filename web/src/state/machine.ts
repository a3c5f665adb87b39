// The machine as the page knows it, and what the page may ask of it. The other end is the machine worker.
// Knows neither ports nor the protocol.
import { computed, signal } from '@preact/signals';
import type { VirtualState } from '../bindings/VirtualState';
import type {
  FromMachine,
  MachineEvent,
  PortChoice,
  Snapshot,
  ToMachine,
  Trouble,
  Wish,
} from '../machine/protocol';
import { portTrouble, workerDied } from '../machine/troubles';
import { note } from './log';

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
/** How the last print ended. */
export const outcome = signal<'done' | 'cancelled' | 'stopped' | null>(null);

export const isReady = computed(() => connection.value === 'open' && snapshot.value?.phase === 'ready');
export const isShutdown = computed(() => connection.value === 'open' && snapshot.value?.phase === 'shutdown');
export const job = computed(() => (isReady.value ? (snapshot.value?.job ?? 'none') : 'none'));
export const isPrinting = computed(() => job.value !== 'none');
/** Whether the head may be moved by hand. */
export const mayMove = computed(() => isReady.value && (job.value === 'none' || job.value === 'paused'));

let worker: Worker | undefined;
let lastId = 0;
const waiting = new Map<number, (trouble: Trouble | null) => void>();

/** Starts the worker, which loads the planner. */
export function startMachine(): void {
  worker = new Worker(new URL('../machine/worker.ts', import.meta.url), { type: 'module', name: 'machine' });
  worker.onmessage = ({ data }: MessageEvent<FromMachine>) => take(data);
  worker.onerror = (event) => closed(workerDied(event.message));
}

const send = (message: ToMachine): void => worker?.postMessage(message);

function closed(reason: Trouble | null): void {
  const wasOpen = connection.value !== 'closed';
  if (isPrinting.value) outcome.value = 'stopped';
  connection.value = 'closed';
  port.value = null;
  snapshot.value = null;
  plannedSpeed.value = new Float64Array();
  firmware.value = null;
  for (const settle of waiting.values()) settle(null);
  waiting.clear();
  if (reason) report(reason);
  if (reason?.code === 'planner-missing') plannerFailed.value = true;
  if (wasOpen) note('info', 'Disconnected.');
}

function report(reason: Trouble): void {
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
      trouble.value = null;
      outcome.value = null;
      note('info', 'Port open; asking the board who it is.');
      break;
    case 'closed':
      closed(message.trouble);
      break;
    case 'snapshot':
      if (connection.value === 'open') snapshot.value = message.snapshot;
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
    case 'answer': {
      waiting.get(message.id)?.(message.trouble);
      waiting.delete(message.id);
      break;
    }
    case 'gap':
      note('warning', `The computer was held up for ${message.seconds.toFixed(1)} s.`);
      break;
  }
}

const PHASES: Record<Snapshot['phase'], string> = {
  identifying: 'Asking the board who it is.',
  synchronising: 'Measuring the board\u2019s clock.',
  restarting: 'The board restarts.',
  configuring: 'Setting up the board.',
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
      note('info', 'The print goes on.');
      break;
    case 'done':
      outcome.value = 'done';
      note('info', 'The print is done.');
      break;
    case 'cancelled':
      outcome.value = 'cancelled';
      note('info', 'The print was cancelled.');
      break;
    case 'held':
    case 'trouble':
      report(event.trouble);
      break;
    case 'dropped':
      note('warning', `${event.count} messages were left out.`);
      break;
  }
}

export function connect(choice: PortChoice, config: string): void {
  if (connection.value !== 'closed') return;
  connection.value = 'opening';
  port.value = choice;
  virtualRecord.value = null;
  trouble.value = null;
  send({ kind: 'connect', port: choice, config });
}

/** Whether `plannedSpeed` is wanted. */
export const watchSpeed = (on: boolean): void => send({ kind: 'watch-speed', on });

export const disconnect = (): void => send({ kind: 'disconnect' });

/** A port that could not even be chosen. */
export const refusePort = (error: unknown): void => report(portTrouble(error));

function ask(make: (id: number) => ToMachine): Promise<Trouble | null> {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve) => {
    waiting.set(id, resolve);
    send(make(id));
  });
}

/** Asks for something; a refusal is shown. True where it is being done. */
export async function wish(wanted: Wish): Promise<boolean> {
  const refusal = await ask((id) => ({ kind: 'wish', id, wish: wanted }));
  if (refusal) report(refusal);
  return refusal === null;
}

export async function print(file: Blob, confirmedLines: readonly number[]): Promise<boolean> {
  outcome.value = null;
  const refusal = await ask((id) => ({ kind: 'print', id, file, confirmedLines }));
  if (refusal) report(refusal);
  return refusal === null;
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

/** At once, whatever else is going on. */
export function emergencyStop(): void {
  send({ kind: 'wish', id: 0, wish: { kind: 'emergency-stop' } });
  note('error', 'Emergency stop pressed.');
}
