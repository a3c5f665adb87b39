import { expect, test } from 'vitest';
import { dateFormat } from '../src/dates';
import { inTasks } from '../src/tasks';

test('the first step is done at once, the others in tasks of their own', async () => {
  const done: string[] = [];
  const over = new Promise<void>((resolve) => {
    inTasks(
      () => done.push('first'),
      () => done.push('second'),
      resolve,
    );
  });
  expect(done).toEqual(['first']);
  await Promise.resolve();
  expect(done).toEqual(['first']);
  await over;
  expect(done).toEqual(['first', 'second']);
  inTasks();
});

test('a date is written as the formats of the browser write it', () => {
  const options = { hour: '2-digit', minute: '2-digit', hourCycle: 'h23' } as const;
  const [format, at] = [dateFormat(options), new Date(2026, 1, 3, 14, 5)];
  expect([format(at), format(at)]).toEqual(['14:05', '14:05']);
  expect(format(at)).toBe(new Intl.DateTimeFormat(undefined, options).format(at));
});
