import { expect, test } from 'vitest';
import type { SourcedRequest, ViewRequest } from '../src/messages';
import { Source } from '../src/source';

const header = { originMm: [0, 0, 0], stepMm: 1 } as const;
const begin: ViewRequest = { type: 'begin', header };
const append: ViewRequest = { type: 'append', vertices: new Uint32Array(4) };

/** A source, what it carried out, and a way to say something from the other end. */
function listening() {
  const done: string[] = [];
  const source = new Source(({ type }) => done.push(type));
  const port = { onmessage: null, close: () => undefined } as unknown as MessagePort;
  source.listen(port);
  const say = (job: number, request: ViewRequest): void => {
    const message = { data: { job, request } } as MessageEvent<SourcedRequest>;
    port.onmessage?.call(port, message);
  };
  return { source, say, done };
}

test('what comes of a job that was put away is dropped', () => {
  const { source, say, done } = listening();
  source.discard(1);
  say(1, begin);
  say(1, append);
  source.discard(2);
  say(1, append);
  say(1, begin);
  expect(done).toEqual(['clear', 'fit', 'begin', 'append', 'clear', 'fit']);
});

test('a new job that is faster than the word that the old one is over is not lost by it', () => {
  const { source, say, done } = listening();
  say(3, begin);
  say(3, append);
  source.discard(3);
  expect(done).toEqual(['clear', 'fit', 'begin', 'append']);
});

test('what comes of a job before its beginning is dropped', () => {
  const { say, done } = listening();
  say(2, append);
  say(2, begin);
  say(2, append);
  expect(done).toEqual(['clear', 'fit', 'begin', 'append']);
});
