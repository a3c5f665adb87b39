// A print that a board holds: its journal before the bytes that it is about, the record found and taken up, and every way
// in which that can end. Nothing is wished for that moves anything.
import { beforeEach, expect, test } from 'vitest';
import { Archive } from '../src/machine/archive';
import { Continuation } from '../src/machine/continuation';
import { Machine } from '../src/machine/machine';
import { type HeldPrint, type MachineEvent, type Phase, type Trouble, WHOLE } from '../src/machine/protocol';
import { PrintStore } from '../src/machine/storage';
import { fileUnreadable } from '../src/machine/troubles';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';
import { FakeDisk } from './fake_files';
import { FakeLocks } from './fake_locks';
import { FakeSession } from './fake_session';

const FACTS = { name: 'part.gcode', time: seconds(60), lines: 100 };
const GCODE = 'G28\nG1 X10\n';
const PORT = { vendor: 1, product: 2, index: 0 };
const REFUSED: Trouble = { ...fileUnreadable('no'), code: 'continuation-refused' };

let disk: FakeDisk;
let store: PrintStore;
let archive: Archive;
let session: FakeSession;
let machine: Machine;
let continuation: Continuation;
let held: (HeldPrint | null)[];
let taken: string[];

beforeEach(() => {
  disk = new FakeDisk();
  store = new PrintStore(
    () => disk.handle(),
    async () => Number.POSITIVE_INFINITY,
  );
  const read = (journal: Uint8Array, at: number | null) => {
    const text = Buffer.from(journal).toString();
    const [number = 0] = text.split(' ').map(Number);
    const isHeld = at !== null && text.split(' ').includes(String(at));
    const readableBytes = text.length;
    return { number, hasEnded: text.includes('end'), isHeld, line: 50, elapsed: seconds(9), readableBytes };
  };
  archive = new Archive(store, read, new FakeLocks());
  connect();
});

/** Another page, with the same storage. */
function connect(): void {
  held = [];
  taken = [];
  session = new FakeSession();
  machine = new Machine(
    session,
    () => undefined,
    () => NO_LINE_ERRORS,
    {
      onEvent: (event) => continuation.note(event),
      onTell: () => continuation.progress(),
      settle: (log, ending) => archive.settle(log, ending),
    },
  );
  const [ofMachine, ofArchive] = [machine, archive];
  continuation = new Continuation({
    machine: ofMachine,
    archive: ofArchive,
    tell: (one) => void held.push(one),
    tellNotKept: (trouble) => {
      throw new Error(trouble.happened);
    },
    onTakenUp: ({ facts }) => void taken.push(facts.name),
    tick: () => undefined,
  });
}

const last = (): HeldPrint | null | undefined => held.at(-1);
const kinds = (): (string | undefined)[] => held.map((one) => one?.kind);

function happens(...events: MachineEvent[]): void {
  session.events.push(...events);
  machine.poll(seconds(1));
}
function enter(phase: Phase): void {
  session.phase = phase;
  happens({ kind: 'phase', phase });
}

/** A print under way in a page that is then gone. */
async function interrupted({ hasCopy = true } = {}): Promise<string> {
  const openLog = async () => {
    const about = {
      facts: FACTS,
      machine: { name: 'Mill', config: '' },
      port: PORT,
      fileBytes: GCODE.length,
      start: WHOLE,
      continues: null,
    };
    const log = await archive.begin(about, () => undefined);
    if (log && hasCopy) archive.copy(log, new Blob([GCODE]));
    return log;
  };
  session.job = 'printing';
  expect(await machine.print(new Blob([GCODE]), WHOLE, () => seconds(0), openLog)).toBeNull();
  session.journal = [`${session.journalNumber} `, '77 '];
  machine.poll(seconds(1));
  const [print] = await store.listPrints();
  if (!print) throw new Error('nothing is kept');
  if (hasCopy) await expect.poll(() => store.openFile(print.id).then(() => 'there', String)).toBe('there');
  machine.free();
  await machine.logClosed();
  connect();
  return print.id;
}

async function found(number: number | null): Promise<void> {
  session.held = number;
  enter('holding');
  await expect.poll(() => last()?.kind).not.toBe('looking');
}

test('the journal is on the disk before the bytes that came with it are given', async () => {
  const id = await interrupted();
  await found(77);
  expect(last()?.kind).toBe('finding');
  session.journal = ['78 '];
  session.toSend = [1, 2, 3];
  const sent = machine.poll(seconds(2));
  expect([...sent]).toEqual([1, 2, 3]);
  expect(Buffer.from(await store.readJournal(id)).toString()).toMatch(/77 78 $/);
});

test('a print that is known is taken up, held, and gone on with at the user\u2019s word', async () => {
  const id = await interrupted();
  await found(77);
  expect(kinds()).toEqual(['looking', 'finding']);
  expect(session.takenUp).toEqual([Buffer.from(await store.readJournal(id)).toString()]);
  session.wants = 5;
  machine.poll(seconds(2));
  expect(session.fed.toString()).toBe(GCODE.slice(0, 5));
  // As long as nothing is decided there is no job, and its file goes on being fed.
  session.job = 'none';
  machine.tell(seconds(2));
  session.wants = 100;
  machine.poll(seconds(3));
  expect(session.fed.toString()).toBe(GCODE);
  expect(session.ended).toBe(true);
  session.job = 'held';
  enter('ready');
  const now = last();
  expect(now?.kind === 'held' && (await now.file.text())).toBe(GCODE);
  expect(taken).toEqual(['part.gcode']);
  expect(session.wishes).toEqual([]);
  happens({ kind: 'resumed' });
  expect(last()).toBeNull();
  session.journal = ['end'];
  happens({ kind: 'done' });
  await machine.logClosed();
  expect(await store.listPrints()).toEqual([]);
});

test('how far it is, is told by the file', async () => {
  await interrupted();
  await found(77);
  session.wants = 100;
  machine.poll(seconds(2));
  machine.tell(seconds(2));
  const now = last();
  expect(now?.kind === 'finding' && now.share).toBeCloseTo(0.99);
});

test('a print that nobody knows is said to be so, and stays', async () => {
  const id = await interrupted();
  await found(99);
  expect(last()).toEqual({ kind: 'unknown', trouble: null });
  enter('identifying');
  expect(last()).toBeNull();
  expect((await store.listPrints()).map((print) => print.id)).toEqual([id]);
});

test('without a copy the file is asked for; another one is not fed', async () => {
  const id = await interrupted({ hasCopy: false });
  await found(77);
  expect(last()?.kind).toBe('needs-file');
  continuation.give(new Blob(['G28\nG1 X1\n']));
  await expect.poll(() => held.length).toBe(3);
  const now = last();
  expect(now?.kind === 'needs-file' && now.trouble?.code).toBe('other-file');
  expect(session.takenUp).toEqual([]);
  continuation.give(new Blob([GCODE]));
  await expect.poll(() => last()?.kind).toBe('finding');
  session.job = 'held';
  enter('ready');
  // Next time it is there.
  await expect.poll(() => store.openFile(id).then((file) => file.text(), String)).toBe(GCODE);
});

test('what is refused is said, stays held, and can be tried again', async () => {
  const id = await interrupted();
  await found(77);
  happens({ kind: 'trouble', trouble: REFUSED });
  expect(last()).toMatchObject({ kind: 'refused', trouble: REFUSED });
  session.wants = 100;
  machine.poll(seconds(2));
  expect(session.fed.length, 'nothing more is fed').toBe(0);
  continuation.give(new Blob([GCODE]));
  await expect.poll(() => last()?.kind).toBe('finding');
  happens({ kind: 'trouble', trouble: REFUSED });
  enter('identifying');
  // The board was restarted: what it held is lost, what is known of the print is not.
  await machine.logClosed();
  expect((await archive.list()).map((print) => print.id)).toEqual([id]);
});

test('a file that breaks off while the place is looked for', async () => {
  await interrupted({ hasCopy: false });
  await found(77);
  const broken = new Blob([GCODE]);
  let pieces = 0;
  const stream = (): ReadableStream<Uint8Array> =>
    new ReadableStream({
      pull(controller) {
        pieces += 1;
        if (pieces > 8) controller.error(new DOMException('gone', 'NotReadableError'));
        else controller.enqueue(new TextEncoder().encode('G28\n'));
      },
    });
  Object.defineProperty(broken, 'stream', { value: stream });
  continuation.give(broken);
  await expect.poll(() => last()?.kind).toBe('finding');
  await expect
    .poll(() => {
      session.wants = 100;
      machine.poll(seconds(2));
      return last()?.kind;
    })
    .toBe('refused');
  expect(session.ended).toBe(false);
});

test('the connection ends while the record is looked for: nothing comes of it', async () => {
  await interrupted();
  session.held = 77;
  enter('holding');
  continuation.stop();
  machine.free();
  await archive.list();
  await expect.poll(() => store.listPrints()).toHaveLength(1);
  expect(kinds()).not.toContain('finding');
  expect(session.takenUp).toEqual([]);
});

test('a board that stops ends what it held, and what is known of it stays', async () => {
  const id = await interrupted();
  await found(77);
  session.job = 'held';
  enter('ready');
  session.job = 'none';
  enter('shutdown');
  expect(last()).toBeNull();
  await machine.logClosed();
  expect((await archive.list()).map((print) => print.id)).toEqual([id]);
});
