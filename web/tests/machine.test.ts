// What a connection tells the page, and when.
import { expect, test, vi } from 'vitest';
import { Machine } from '../src/machine/machine';
import { type FromMachine, WHOLE } from '../src/machine/protocol';
import { fileUnreadable } from '../src/machine/troubles';
import { NO_LINE_ERRORS } from '../src/transport/transport';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

function machine(): { machine: Machine; session: FakeSession; told: FromMachine[] } {
  const told: FromMachine[] = [];
  const session = new FakeSession();
  const tell = (message: FromMachine): void => void told.push(message);
  return { machine: new Machine(session, tell, () => NO_LINE_ERRORS), session, told };
}

test('the planned speed is told with each snapshot while somebody watches it', () => {
  const { machine: made, told } = machine();
  made.tell(seconds(100));
  expect(told.map(({ kind }) => kind)).toEqual(['snapshot']);
  made.watchesSpeed = true;
  made.tell(seconds(100));
  made.watchesSpeed = false;
  made.tell(seconds(101));
  expect(told.map(({ kind }) => kind)).toEqual(['snapshot', 'snapshot', 'planned-speed', 'snapshot']);
  const speed = told[2];
  if (speed?.kind !== 'planned-speed') throw new Error('no planned speed');
  const [from, , until] = speed.pairs;
  // Around now: some of what was, and more than the session plans ahead.
  expect(from).toBeLessThan(-5);
  expect(until).toBeGreaterThan(4);
  expect([...speed.pairs]).toEqual([from, 100 + (from ?? 0), until, 100 + (until ?? 0)]);
});

test('an emergency stop before the board is known is reported, and sent once it can be', () => {
  const { machine: made, session } = machine();
  session.phase = 'identifying';
  session.refusal = fileUnreadable('not connected');
  const refusal = made.wish({ kind: 'emergency-stop' }, seconds(1));
  expect(refusal?.code).toBe('stop-not-sent');
  expect(refusal?.todo).toContain('cut its power');
  made.poll(seconds(2));
  session.phase = 'synchronising';
  session.refusal = null;
  made.poll(seconds(3));
  expect(session.wishes).toHaveLength(3);
  // Once is enough.
  made.poll(seconds(4));
  expect(session.wishes).toHaveLength(3);
  expect(made.wish({ kind: 'emergency-stop' }, seconds(5))).toBeNull();
});

test('after the connection has failed no emergency stop is promised', () => {
  const { machine: made, session } = machine();
  session.phase = 'failed';
  session.refusal = fileUnreadable('not connected');
  expect(made.wish({ kind: 'emergency-stop' }, seconds(1))?.happened).toContain(
    'connection to the board has failed',
  );
  made.poll(seconds(2));
  expect(session.wishes).toHaveLength(1);
});

test('the file of a job that ended in an error is let go of', async () => {
  const { machine: made, session } = machine();
  session.job = 'printing';
  expect(await made.print(new Blob(['G28\n']), WHOLE, () => seconds(0))).toBeNull();
  made.tell(seconds(1));
  session.wants = 1;
  made.poll(seconds(1));
  expect(session.fed.length).toBe(1);
  session.job = 'none';
  made.tell(seconds(2));
  session.wants = 1;
  made.poll(seconds(3));
  expect(session.fed.length).toBe(1);
});

test('what the session threw when a print was to begin is not taken for the file\u2019s fault', async () => {
  const { machine: made, session } = machine();
  vi.spyOn(session, 'startJob').mockImplementation(() => {
    throw new Error('unreachable');
  });
  await expect(made.print(new Blob(['G28\n']), WHOLE, () => seconds(0))).rejects.toThrow('unreachable');
});

test('wake-ups that come late are counted, and told from a second on', () => {
  const { machine: made, told } = machine();
  for (const late of [0.004, 2.5, -0.001, 1.5]) made.woke(seconds(late));
  made.tell(seconds(100));
  expect(told.slice(0, 2)).toEqual([
    { kind: 'gap', seconds: 2.5 },
    { kind: 'gap', seconds: 1.5 },
  ]);
  const now = told[2];
  if (now?.kind !== 'snapshot') throw new Error('no snapshot');
  expect(now.snapshot.wakeUps).toEqual({ missed: 2, latest: 2.5 });
});
