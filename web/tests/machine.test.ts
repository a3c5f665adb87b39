// What a connection tells the page, and when.
import { expect, test } from 'vitest';
import { Machine } from '../src/machine/machine';
import type { FromMachine } from '../src/machine/protocol';
import { seconds } from '../src/units';
import { FakeSession } from './fake_session';

function machine(): { machine: Machine; session: FakeSession; told: FromMachine[] } {
  const told: FromMachine[] = [];
  const session = new FakeSession();
  const tell = (message: FromMachine): void => void told.push(message);
  return { machine: new Machine(session, tell, () => 3), session, told };
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
