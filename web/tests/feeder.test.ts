// A job's file reaches the session whole, in order, and never further ahead than it asks.
import { gzipSync } from 'node:zlib';
import { expect, test } from 'vitest';
import { CHUNK_BYTES_MAX } from '../src/files';
import { Feeder } from '../src/machine/feeder';
import { Machine } from '../src/machine/machine';
import { type FromMachine, WHOLE } from '../src/machine/protocol';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

const content = Uint8Array.from({ length: 700_000 }, (_, index) => (index * 31) % 251);

async function feedAll(file: Blob, portion: number): Promise<FakeSession> {
  const session = new FakeSession();
  const feeder = await Feeder.open(file, session);
  for (let round = 0; round < 10_000 && !session.ended; round += 1) {
    session.wants = portion;
    if (!feeder.feed() || feeder.isBehind) await feeder.refill();
  }
  return session;
}

test.each([100_000, 65_536, 700_000])('in portions of %d', async (portion) => {
  const session = await feedAll(new Blob([content]), portion);
  expect(session.ended).toBe(true);
  expect(session.fed.length).toBe(content.length);
  expect(session.fed.equals(content)).toBe(true);
});

test('a packed file is unpacked', async () => {
  const session = await feedAll(new Blob([new Uint8Array(gzipSync(content))]), 100_000);
  expect(session.fed.equals(content)).toBe(true);
});

test('an empty file ends at once', async () => {
  const session = await feedAll(new Blob([]), 1000);
  expect(session.fed.length).toBe(0);
  expect(session.ended).toBe(true);
});

test('nothing is fed that is not wanted', async () => {
  const session = new FakeSession();
  const feeder = await Feeder.open(new Blob([content]), session);
  expect(feeder.feed()).toBe(false);
  session.wants = 10;
  feeder.feed();
  expect(session.fed.length).toBe(10);
});

/** A file whose disk goes away after `bytes` bytes. */
function broken(bytes: number): Blob {
  const file = new Blob([content]);
  let reads = 0;
  file.stream = () =>
    new ReadableStream(
      {
        pull(controller) {
          reads += 1;
          if (reads === 1) controller.enqueue(content.slice(0, bytes));
          else controller.error(new DOMException('gone', 'NotReadableError'));
        },
      },
      { highWaterMark: 0 },
    );
  return file;
}

test('a file that cannot be read is not begun', async () => {
  const machine = new Machine(
    new FakeSession(),
    () => undefined,
    () => NO_LINE_ERRORS,
  );
  const trouble = await machine.print(broken(1000), WHOLE, () => seconds(0));
  expect(trouble?.code).toBe('file-unreadable');
});

/** A print whose file breaks off while it is printed, and that waits for it. */
async function brokenOff(): Promise<{ session: FakeSession; machine: Machine; told: FromMachine[] }> {
  const session = new FakeSession();
  const told: FromMachine[] = [];
  const machine = new Machine(
    session,
    (message) => told.push(message),
    () => NO_LINE_ERRORS,
  );
  let isThere = true;
  const file = new Blob([content]);
  file.stream = () =>
    new ReadableStream({
      pull(controller) {
        if (isThere) controller.enqueue(new Uint8Array(CHUNK_BYTES_MAX));
        else controller.error(new DOMException('gone', 'NotReadableError'));
      },
    });
  expect(await machine.print(file, WHOLE, () => seconds(0))).toBeNull();
  session.job = 'printing';
  isThere = false;
  for (let round = 0; round < 50 && session.wishes.length === 0; round += 1) {
    // More than was read ahead, so that the session waits for what does not come.
    session.wants = 5_000_000;
    machine.poll(seconds(round));
    await machine.catchUp();
    await new Promise((resolve) => setTimeout(resolve, 1));
  }
  session.job = 'paused';
  return { session, machine, told };
}

test('a file that breaks off while it is printed pauses the print and says so', async () => {
  const { session, machine, told } = await brokenOff();
  machine.tell(seconds(99));
  expect(session.wishes).toEqual([{ kind: 'pause' }]);
  const events = told.flatMap((message) => (message.kind === 'events' ? message.events : []));
  expect(events).toMatchObject([{ kind: 'trouble', trouble: { code: 'file-unreadable' } }]);
  // Its end would have made a whole line of the half that came last.
  expect(session.ended).toBe(false);
});

test('a print whose file broke off can be cancelled, not resumed', async () => {
  const { session, machine } = await brokenOff();
  const refusal = machine.wish({ kind: 'resume' }, seconds(100));
  expect(refusal?.code).toBe('file-unreadable');
  expect(refusal?.todo).toContain('Cancel the print');
  machine.tell(seconds(101));
  expect(machine.wish({ kind: 'resume' }, seconds(102))?.code).toBe('file-unreadable');
  expect(machine.wish({ kind: 'cancel' }, seconds(103))).toBeNull();
  expect(session.wishes).toEqual([{ kind: 'pause' }, { kind: 'cancel' }]);
  session.job = 'none';
  session.events.push({ kind: 'cancelled' });
  machine.poll(seconds(104));
  // The next print has nothing to do with it.
  session.job = 'printing';
  expect(await machine.print(new Blob([content]), WHOLE, () => seconds(105))).toBeNull();
  expect(machine.wish({ kind: 'resume' }, seconds(106))).toBeNull();
});
