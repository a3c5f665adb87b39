// Where an interrupted print was: its file is read as far as it is wanted, and whatever fails is said.
import { expect, test } from 'vitest';
import { locate } from '../src/machine/locate';
import type { Interruption, Trouble } from '../src/machine/protocol';
import type { Survey } from '../src/machine/session';
import { fileUnreadable } from '../src/machine/troubles';
import { mm, share } from '../src/units';

const AT: Interruption = {
  line: 2,
  startLine: 3,
  reachLine: 4,
  layer: 1,
  layerZ: mm(0.2),
  layerLine: 1,
  zRange: null,
  zPlaces: [],
  zPitch: mm(0),
  zError: mm(0),
  speedFactor: share(1),
  flowFactor: share(1),
  transform: { mesh: null, skew: [0, 0, 0] },
};
const REFUSED: Trouble = { ...fileUnreadable('no'), code: 'continuation-refused' };

class FakeSurvey implements Survey {
  readonly fed: number[] = [];
  ended = false;
  freed = false;
  readonly enough: number;

  constructor(enough: number) {
    this.enough = enough;
  }
  wants(): number {
    return Math.min(5, this.enough - this.fed.length);
  }
  feed(bytes: Uint8Array): void {
    if (bytes.byteLength > this.wants()) throw new Error('more than it wants');
    this.fed.push(...bytes);
  }
  end(): void {
    this.ended = true;
  }
  report(): Interruption | null {
    return this.ended || this.fed.length === this.enough ? AT : null;
  }
  free(): void {
    this.freed = true;
  }
}

const record = { journal: Uint8Array.of(1), config: '[printer]' };
const archive = { recordOf: async () => record };
const file = new Blob(['G28\nG1 X10\nG1 X20\n']);

function planner(survey: Survey | Trouble) {
  return {
    survey: () => {
      if ('code' in survey) throw survey;
      return survey;
    },
    asTrouble: (error: unknown) => (error === survey ? REFUSED : null),
  };
}

test.each([4, 12, 1000])('it reads no more than is wanted: %i bytes', async (enough) => {
  const survey = new FakeSurvey(enough);
  const found = await locate(planner(survey), archive, 'one', file);
  expect(found).toEqual({ kind: 'there', file, at: AT, trouble: null });
  expect(Buffer.from(survey.fed).toString()).toBe((await file.text()).slice(0, enough));
  expect([survey.ended, survey.freed]).toEqual([enough > file.size, true]);
});

test('what the planner refuses is said, and the file is there all the same', async () => {
  expect(await locate(planner(REFUSED), archive, 'one', file)).toEqual({
    kind: 'there',
    file,
    at: null,
    trouble: REFUSED,
  });
});

test('a record that cannot be read', async () => {
  const found = await locate(
    planner(new FakeSurvey(4)),
    { recordOf: () => Promise.reject(new DOMException('gone', 'NotFoundError')) },
    'one',
    file,
  );
  expect(found.kind === 'there' && found.trouble?.code).toMatch(/^storage-/);
});

test('a file that breaks off is missing', async () => {
  const broken = new Blob(['G28\n']);
  const stream = (): ReadableStream<Uint8Array> =>
    new ReadableStream({
      pull: (controller) => controller.error(new DOMException('gone', 'NotReadableError')),
    });
  Object.defineProperty(broken, 'stream', { value: stream });
  const survey = new FakeSurvey(100);
  const found = await locate(planner(survey), archive, 'one', broken);
  expect(found.kind === 'missing' && found.trouble?.code).toBe('file-unreadable');
  expect(survey.freed).toBe(true);
});

test('what nobody foresaw is not hidden', async () => {
  const survey = new FakeSurvey(100);
  survey.feed = () => {
    throw new Error('unreachable');
  };
  await expect(locate(planner(survey), archive, 'one', file)).rejects.toThrow('unreachable');
  expect(survey.freed).toBe(true);
});
