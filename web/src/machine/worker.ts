// The machine worker: owns the port, the session and all timers of a connection, one at a time.
//
// Nothing here waits for the page. A Web Lock is held from before the port is opened to after it is closed, so that
// one tab has a printer; a tab that holds a lock is not frozen either.
import { ANSWER_BYTES_MAX, classify } from '../transport/answer';
import { NO_LINE_ERRORS, PortError } from '../transport/transport';
import { find, openSerial } from '../transport/web_serial';
import { type Seconds, seconds } from '../units';
import { Archive, type PrintLog } from './archive';
import { Broadcast } from './broadcast';
import { Connection, Died, type Parts } from './connection';
import { Continuation } from './continuation';
import { locate } from './locate';
import { LockstepLoop } from './lockstep';
import { type Keeping, Machine } from './machine';
import { loadPlanner, type Planner } from './planner';
import type { FromMachine, KeptFile, PortChoice, Snapshot, ToMachine, Trouble, Wish } from './protocol';
import { RealTimeLoop } from './realtime';
import { PrintStore } from './storage';
import { answerTrouble, plannerMissing, portInUse, portTrouble, stopNotSent } from './troubles';

/** Errors for which the first bytes may know a better reason. */
const UNIDENTIFIED = new Set(['board-silent', 'board-unreadable', 'wrong-firmware']);

const scope = self as unknown as { postMessage(message: FromMachine, transfer: Transferable[]): void };
const realNow = (): Seconds => seconds(performance.now() / 1000);

type Connect = ToMachine & { kind: 'connect' };
type Print = ToMachine & { kind: 'print' };

let planner: Planner | undefined;
/** Prints on real printers; one on a virtual printer is gone with the page, and its printer with it. */
let archive: Archive | undefined;
/** Of a print that the board of the present connection holds. */
let continuation: Continuation | undefined;
/** What the page was last told of prints that are kept; one list after the other. */
let listing: Promise<void> = Promise.resolve();
let connection: Connection | undefined;
/** What it was made with. */
let present: Connect | undefined;
/** Tells other tabs of the connection. */
let broadcast: Broadcast | undefined;
/** From before the port is opened until after it is closed. */
let opening: { cancelled: boolean } | undefined;
/** Whether the page shows the planned speed; outlives connections. */
let watchesSpeed = false;

function tell(message: FromMachine): void {
  broadcast?.note(message);
  scope.postMessage(message, message.kind === 'planned-speed' ? [message.pairs.buffer] : []);
}

/** What the port's board said before it was identified, to judge what it is. */
class FirstBytes {
  #bytes: number[] = [];

  take(bytes: Uint8Array): void {
    for (const byte of bytes.subarray(0, ANSWER_BYTES_MAX - this.#bytes.length)) this.#bytes.push(byte);
  }

  /** The message with a more exact reason where the board could not be identified. */
  explain(message: FromMachine): FromMachine {
    if (message.kind !== 'events') return message;
    const events = message.events.map((event) => {
      if (event.kind !== 'trouble' || !UNIDENTIFIED.has(event.trouble.code)) return event;
      const trouble = answerTrouble(classify(Uint8Array.from(this.#bytes)), event.trouble.code);
      return trouble ? { ...event, trouble } : event;
    });
    return { ...message, events };
  }
}

/** Runs `body` with the lock, or not at all; why the connection ended. */
async function withLock(name: string, body: () => Promise<Trouble | null>): Promise<Trouble | null> {
  return await navigator.locks.request(name, { ifAvailable: true }, (lock) => (lock ? body() : portInUse()));
}

/** Tells other tabs of a connection, and stops its machine for them. */
function broadcastOf({ id, name, port }: Connect, current: Connection): Broadcast {
  return new Broadcast({
    id,
    name,
    port,
    look: () => {
      let seen: Snapshot | null = null;
      current.attempt(({ machine, now }) => {
        seen = machine.look(now());
      });
      return seen;
    },
    stop: () => {
      let trouble: Trouble | null = stopNotSent('not-open');
      current.attempt(({ machine, now, tick }) => {
        trouble = machine.wish({ kind: 'emergency-stop' }, now());
        tick();
      });
      return trouble;
    },
  });
}

/** Goes on until the connection is over; returns why it is. */
async function hold(message: Connect, parts: Parts): Promise<Trouble | null> {
  parts.machine.watchesSpeed = watchesSpeed;
  connection = new Connection(parts, tell);
  present = message;
  broadcast = broadcastOf(message, connection);
  let trouble: Trouble | null = null;
  try {
    trouble = await connection.run();
    return trouble;
  } finally {
    broadcast.end(trouble);
    broadcast = undefined;
    connection = undefined;
    present = undefined;
  }
}

async function connectSerial(
  loaded: Planner,
  choice: PortChoice & { kind: 'serial' },
  message: Connect,
): Promise<Trouble | null> {
  const port = find(choice.id, await navigator.serial.getPorts());
  if (!port) throw new PortError('port-gone');
  const name = `stepcast-port:${choice.id.vendor}:${choice.id.product}:${choice.id.index}`;
  return await withLock(name, async () => {
    // Before the port is touched: the machine's file may have errors.
    const session = loaded.openSession(message.config, realNow());
    const transport = await openSerial(port, choice.baud).catch((error: unknown) => {
      session.free();
      throw error;
    });
    if (opening?.cancelled) {
      session.free();
      await transport.close();
      return null;
    }
    const first = new FirstBytes();
    const prints = archiveOf(loaded);
    const machine = new Machine(
      session,
      (message) => tell(first.explain(message)),
      () => transport.lineErrors(),
      keepingIn(prints),
    );
    const loop = new RealTimeLoop(transport, {
      machine,
      now: realNow,
      onBytes: (bytes) => first.take(bytes),
    });
    continuation = new Continuation({
      machine,
      archive: prints,
      tell: (held) => tell({ kind: 'held-print', held }),
      tellNotKept,
      onTakenUp: ({ facts }) => broadcast?.begins(facts),
      tick: loop.tick,
    });
    try {
      return await hold(message, {
        machine,
        now: realNow,
        tick: loop.tick,
        setSpeed: () => undefined,
        record: null,
        lost: transport.lost.then(portTrouble),
        start: (onFailure) => loop.start(onFailure),
        stop: () => loop.stop(),
      });
    } finally {
      continuation?.stop();
      continuation = undefined;
      await machine.logClosed();
    }
  });
}

const archiveOf = (loaded: Planner): Archive => {
  archive ??= new Archive(new PrintStore(), loaded.readJournal);
  return archive;
};

const tellNotKept = (trouble: Trouble): void => tell({ kind: 'not-kept', trouble });

const keepingIn = (prints: Archive): Keeping => ({
  onEvent: (event) => continuation?.note(event),
  onTell: () => continuation?.progress(),
  settle: (log, ending) => prints.settle(log, ending).then(tellKept),
});

/** Tells the page which prints were interrupted. */
function tellKept(): void {
  listing = listing.then(async () => {
    if (planner) tell({ kind: 'kept', prints: await archiveOf(planner).list() });
  });
}

async function forget(id: string): Promise<void> {
  if (planner) await archiveOf(planner).discard(id);
  tellKept();
}

async function tellFile({ id, print, given }: ToMachine & { kind: 'kept-file' }): Promise<void> {
  if (!planner) return;
  const prints = archiveOf(planner);
  const file = await prints.fileOf(print, given);
  const found: KeptFile =
    file instanceof Blob ? await locate(planner, prints, print, file) : { kind: 'missing', trouble: file };
  tell({ kind: 'kept-file', id, found });
}

async function connectVirtual(
  loaded: Planner,
  choice: PortChoice & { kind: 'virtual' },
  message: Connect,
): Promise<Trouble | null> {
  const { config } = message;
  // Every tab has a printer of its own; the lock only keeps the tab from being frozen.
  return await withLock(`stepcast-virtual:${crypto.randomUUID()}`, async () => {
    if (opening?.cancelled) return null;
    const printer = loaded.powerUp(config, choice.board, choice.seed, choice.faults);
    const now = (): Seconds => printer.now();
    const session = loaded.openVirtualSession(config, choice.board, now());
    const machine = new Machine(session, tell, () => NO_LINE_ERRORS);
    const loop = new LockstepLoop(machine, printer, choice.speed, realNow);
    return await hold(message, {
      machine,
      now,
      tick: loop.tick,
      setSpeed: (speed) => loop.setSpeed(speed),
      record: () => printer.record(),
      lost: null,
      start: (onFailure) => loop.start(onFailure),
      stop: () => loop.stop(),
    });
  });
}

async function connect(message: Connect): Promise<void> {
  if (connection || opening) return;
  opening = { cancelled: false };
  try {
    const trouble = await carryOut(message);
    // Only now, with port and lock let go of, may the page ask for the next connection.
    opening = undefined;
    tell({ kind: 'closed', trouble });
    tellKept();
  } catch (error) {
    died(error);
  }
}

const died = (error: unknown): void => tell({ kind: 'died', message: new Died(error).message });

/** Something was thrown where nobody caught it: with a connection, that ends first. */
function uncaught(error: unknown): void {
  if (!connection) died(error);
  // One that is ending lets go of everything by itself.
  else connection.fail(error);
}

/** A connection from its beginning to its end; why it ended. Rejects where the planner cannot be relied on any more. */
async function carryOut(message: Connect): Promise<Trouble | null> {
  try {
    const loaded = await load();
    return message.port.kind === 'serial'
      ? await connectSerial(loaded, message.port, message)
      : await connectVirtual(loaded, message.port, message);
  } catch (error) {
    if (error instanceof Died || error instanceof WebAssembly.RuntimeError) throw error;
    return planner ? (planner.asTrouble(error) ?? portTrouble(error)) : plannerMissing(error);
  }
}

async function load(): Promise<Planner> {
  planner ??= await loadPlanner();
  return planner;
}

function wish(id: number, wanted: Wish): void {
  if (connection && !connection.isOver) {
    connection.attempt(({ machine, now, tick }) => {
      tell({ kind: 'answer', id, trouble: machine.wish(wanted, now()) });
      tick();
    });
    return;
  }
  const isStop = wanted.kind === 'emergency-stop';
  // Who wants everything to stop does not want what is just being opened.
  if (isStop && opening) opening.cancelled = true;
  tell({ kind: 'answer', id, trouble: isStop ? stopNotSent('not-open') : null });
}

/** Where the present connection keeps what is needed to go on with the print after this page is gone; null for nothing. */
async function recordFor({ facts, file, start, continues }: Print): Promise<PrintLog | null> {
  if (!archive || present?.port.kind !== 'serial') return null;
  const { name, config, port } = present;
  const about = { facts, machine: { name, config }, port: port.id, fileBytes: file.size, start, continues };
  return await archive.begin(about, tellNotKept);
}

async function print(message: Print): Promise<void> {
  const { id, file, start, facts } = message;
  const current = connection;
  const parts = current?.parts;
  if (!current || !parts) return tell({ kind: 'answer', id, trouble: null });
  try {
    const trouble = await parts.machine.print(file, start, parts.now, async () => {
      const log = await recordFor(message);
      if (log) archive?.copy(log, file);
      return log;
    });
    if (trouble === null) broadcast?.begins(facts);
    tell({ kind: 'answer', id, trouble });
  } catch (error) {
    current.fail(error);
  }
  current.attempt(({ tick }) => tick());
}

self.onmessage = ({ data }: MessageEvent<ToMachine>): void => {
  switch (data.kind) {
    case 'connect':
      void connect(data);
      break;
    case 'disconnect':
      if (connection) connection.end(null);
      else if (opening) opening.cancelled = true;
      break;
    case 'wish':
      wish(data.id, data.wish);
      break;
    case 'print':
      void print(data);
      break;
    case 'held-file':
      continuation?.give(data.file);
      break;
    case 'kept-file':
      void tellFile(data);
      break;
    case 'forget':
      void forget(data.id);
      break;
    case 'list-kept':
      tellKept();
      break;
    case 'speed':
      connection?.attempt(({ setSpeed }) => setSpeed(data.speed));
      break;
    case 'seen':
      connection?.seen();
      break;
    case 'watch-speed':
      watchesSpeed = data.on;
      if (connection) connection.parts.machine.watchesSpeed = data.on;
      break;
  }
};

self.addEventListener('error', (event) => {
  event.preventDefault();
  uncaught(event.error ?? event.message);
});
self.addEventListener('unhandledrejection', (event) => {
  event.preventDefault();
  uncaught(event.reason);
});

load().then(
  () => {
    tell({ kind: 'loaded' });
    tellKept();
  },
  (error: unknown) => tell({ kind: 'closed', trouble: plannerMissing(error) }),
);
