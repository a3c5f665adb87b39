// The machine worker: owns the port, the session and all timers of a connection, one at a time.
//
// Nothing here waits for the page. A Web Lock is held from before the port is opened to after it is closed, so that
// one tab has a printer; a tab that holds a lock is not frozen either.
import type { VirtualState } from '../bindings/VirtualState';
import { ANSWER_BYTES_MAX, classify } from '../transport/answer';
import { PortError } from '../transport/transport';
import { find, openSerial } from '../transport/web_serial';
import { type Seconds, seconds } from '../units';
import { LockstepLoop } from './lockstep';
import { Machine } from './machine';
import { loadPlanner, type Planner } from './planner';
import type { FromMachine, PortChoice, ToMachine, Trouble } from './protocol';
import { RealTimeLoop } from './realtime';
import { answerTrouble, plannerMissing, portInUse, portTrouble, workerDied } from './troubles';

/** How often the page is told how things are, in ms. */
const TELL_MS = 100;
/** Errors for which the first bytes may know a better reason. */
const UNIDENTIFIED = new Set(['board-silent', 'board-unreadable', 'wrong-firmware']);

interface Connection {
  readonly machine: Machine;
  readonly now: () => Seconds;
  readonly tick: () => void;
  readonly setSpeed: (speed: number) => void;
  /** The printer's own record, where it is a virtual one. */
  readonly record: (() => VirtualState) | null;
  /** Ends the connection; the lock is let go after it. */
  readonly end: (trouble: Trouble | null) => Promise<void>;
}

const scope = self as unknown as { postMessage(message: FromMachine, transfer: Transferable[]): void };
const realNow = (): Seconds => seconds(performance.now() / 1000);

let planner: Planner | undefined;
let connection: Connection | undefined;
let opening: { cancelled: boolean } | undefined;
/** Whether the page shows the planned speed; outlives connections. */
let watchesSpeed = false;

const tell = (message: FromMachine): void =>
  scope.postMessage(message, message.kind === 'planned-speed' ? [message.pairs.buffer] : []);

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

/** The loop is up: tells the page, until the connection is over; returns why it is. */
function hold(
  make: (over: (trouble: Trouble | null) => void) => Omit<Connection, 'end'> & { stop: () => Promise<void> },
): Promise<Trouble | null> {
  return new Promise((resolve) => {
    let over = false;
    const end = async (trouble: Trouble | null): Promise<void> => {
      if (over) return;
      over = true;
      clearInterval(timer);
      connection = undefined;
      // While there still is a clock to ask: stopping lets go of the virtual printer.
      tellAll();
      await parts.stop();
      parts.machine.free();
      resolve(trouble);
    };
    const parts = make((trouble) => void end(trouble));
    connection = { ...parts, end };
    parts.machine.watchesSpeed = watchesSpeed;
    const tellAll = (): void => {
      parts.machine.tell(parts.now());
      if (parts.record) tell({ kind: 'record', record: parts.record() });
    };
    const timer = setInterval(tellAll, TELL_MS);
    tell({ kind: 'opened' });
  });
}

async function connectSerial(
  loaded: Planner,
  choice: PortChoice & { kind: 'serial' },
  config: string,
): Promise<Trouble | null> {
  const port = find(choice.id, await navigator.serial.getPorts());
  if (!port) throw new PortError('port-gone');
  const name = `stepcast-port:${choice.id.vendor}:${choice.id.product}:${choice.id.index}`;
  return await withLock(name, async () => {
    // Before the port is touched: the machine's file may have errors.
    const session = loaded.openSession(config, realNow());
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
    return await hold((over) => {
      const machine = new Machine(
        session,
        (message) => tell(first.explain(message)),
        () => transport.lineErrors(),
      );
      const loop = new RealTimeLoop(transport, {
        machine,
        now: realNow,
        onBytes: (bytes) => first.take(bytes),
      });
      void transport.lost.then((error) => over(portTrouble(error)));
      loop.start();
      return {
        machine,
        now: realNow,
        tick: loop.tick,
        setSpeed: () => undefined,
        record: null,
        stop: () => loop.stop(),
      };
    });
  });
}

async function connectVirtual(
  loaded: Planner,
  choice: PortChoice & { kind: 'virtual' },
  config: string,
): Promise<Trouble | null> {
  // Every tab has a printer of its own; the lock only keeps the tab from being frozen.
  return await withLock(`stepcast-virtual:${crypto.randomUUID()}`, () =>
    hold((over) => {
      const printer = loaded.powerUp(config, choice.board, choice.seed, choice.faults);
      const now = (): Seconds => printer.now();
      const session = loaded.openVirtualSession(config, choice.board, now());
      const machine = new Machine(session, tell, () => 0);
      const loop = new LockstepLoop(machine, printer, choice.speed, realNow);
      loop.start((error) => over(workerDied(String(error))));
      return {
        machine,
        now,
        tick: loop.tick,
        setSpeed: (speed) => loop.setSpeed(speed),
        record: () => printer.record(),
        stop: () => loop.stop(),
      };
    }),
  );
}

async function connect(message: ToMachine & { kind: 'connect' }): Promise<void> {
  if (connection || opening) return;
  opening = { cancelled: false };
  const trouble = await carryOut(message);
  // Only now, with port and lock let go of, may the page ask for the next connection.
  opening = undefined;
  tell({ kind: 'closed', trouble });
}

/** A connection from its beginning to its end; why it ended. */
async function carryOut(message: ToMachine & { kind: 'connect' }): Promise<Trouble | null> {
  try {
    const loaded = await load();
    return message.port.kind === 'serial'
      ? await connectSerial(loaded, message.port, message.config)
      : await connectVirtual(loaded, message.port, message.config);
  } catch (error) {
    return planner ? (planner.asTrouble(error) ?? portTrouble(error)) : plannerMissing(error);
  }
}

async function load(): Promise<Planner> {
  planner ??= await loadPlanner();
  return planner;
}

async function answer(
  id: number,
  act: (connection: Connection) => Promise<Trouble | null> | Trouble | null,
): Promise<void> {
  const current = connection;
  if (!current) return tell({ kind: 'answer', id, trouble: null });
  const trouble = await act(current);
  tell({ kind: 'answer', id, trouble });
  current.tick();
}

self.onmessage = ({ data }: MessageEvent<ToMachine>): void => {
  switch (data.kind) {
    case 'connect':
      void connect(data);
      break;
    case 'disconnect':
      if (connection) void connection.end(null);
      else if (opening) opening.cancelled = true;
      break;
    case 'wish':
      void answer(data.id, ({ machine, now }) => machine.wish(data.wish, now()));
      break;
    case 'print':
      void answer(data.id, ({ machine, now }) => machine.print(data.file, data.confirmedLines, now));
      break;
    case 'speed':
      connection?.setSpeed(data.speed);
      break;
    case 'watch-speed':
      watchesSpeed = data.on;
      if (connection) connection.machine.watchesSpeed = data.on;
      break;
  }
};

load().then(
  () => tell({ kind: 'loaded' }),
  (error: unknown) => tell({ kind: 'closed', trouble: plannerMissing(error) }),
);
