import { afterEach, expect, test, vi } from 'vitest';
import { dateFormat } from '../src/dates';
import { afterPictures, inTasks } from '../src/tasks';

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('what waits for pictures of the page comes behind them, once, and where there are none it comes all the same', () => {
  vi.useFakeTimers();
  const frames: (() => void)[] = [];
  vi.stubGlobal('requestAnimationFrame', (callback: () => void) => frames.push(callback));
  const done: string[] = [];
  afterPictures(2, () => done.push('seen'));
  frames.shift()?.();
  expect(done).toEqual([]);
  frames.shift()?.();
  vi.runAllTimers();
  expect([done, frames]).toEqual([['seen'], []]);

  afterPictures(2, () => done.push('unseen'));
  vi.runAllTimers();
  frames.shift()?.();
  vi.runAllTimers();
  expect([done, frames]).toEqual([['seen', 'unseen'], []]);
});

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
