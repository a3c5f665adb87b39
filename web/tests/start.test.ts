// A print that begins in the middle of its file: lines and layers as places, where Z can stand, and what has to be known
// before it may go on.
import { beforeEach, expect, test, vi } from 'vitest';
import type {
  FromMachine,
  Interruption,
  KeptFile,
  KeptPrint,
  Snapshot,
  StartAt,
  ToMachine,
} from '../src/machine/protocol';
import type { Layer } from '../src/preview/protocol';
import { lineAfter, lineOfLayer, nearestPlace, placeOf } from '../src/state/start';
import { celsius, mm, seconds, share } from '../src/units';
import { FakeSession } from './fake_session';
import { type FakeWorker, fakeWorkers } from './fake_worker';

const layers: Layer[] = [
  [1, 0.2],
  [40, 0.4],
  [70, 0.6],
].map(([line = 0, z = 0], at) => ({ first: at * 100, line, z: mm(z), time: seconds(30) }));
const plan = { layers };
/** One part after the other: the second begins at the bed again. */
const sequential = { layers: layers.map((layer, at) => (at === 2 ? { ...layer, z: mm(0.2) } : layer)) };

const PRINT: KeptPrint = {
  id: 'one',
  facts: { name: 'part.gcode', time: seconds(90), lines: 100 },
  machine: { name: 'Mill', config: '' },
  port: { vendor: 1, product: 2, index: 0 },
  line: 55,
  startLine: null,
  elapsed: seconds(40),
  confirmedLines: [7],
  heardOf: 0,
  fileBytes: 5,
};
const AT: Interruption = {
  line: 56,
  startLine: 57,
  reachLine: 60,
  layer: 2,
  layerZ: mm(0.4),
  layerLine: 40,
  zRange: [mm(0.4), mm(0.4)],
  zPlaces: [mm(0.4), mm(0.56), mm(0.24)],
  zPitch: mm(0.16),
  zError: mm(0.01),
  speedFactor: share(1.5),
  flowFactor: share(1),
  transform: { mesh: null, skew: [0, 0, 0] },
};

test.each([
  [1, 1, 0.2, 0, 0],
  [39, 1, 0.2, 0.2, (30 * 38) / 39],
  [40, 2, 0.4, 0.2, 30],
  [55, 2, 0.4, 0.4, 45],
  [70, 3, 0.6, 0.4, 60],
  [99, 3, 0.6, 0.6, 60],
])('line %i is in layer %i at %f mm, above %f mm, after %f s', (line, layer, z, top, before) => {
  const place = placeOf(plan, line);
  expect(place).toMatchObject({ line, layer, layers: 3, z, top });
  expect(place.before).toBeCloseTo(before, 9);
});

test('the top is the highest that has been printed, whatever is printed then', () => {
  expect(placeOf(sequential, 70)).toMatchObject({ layer: 3, z: 0.2, top: 0.4 });
});

test('a file without layers has lines all the same', () => {
  expect(placeOf({ layers: [] }, 5)).toEqual({ line: 5, layer: 0, layers: 0, z: null, top: 0, before: 0 });
  expect(lineOfLayer({ layers: [] }, 3)).toBe(1);
});

test('a layer begins with its line', () => {
  expect([1, 2, 3].map((layer) => lineOfLayer(plan, layer))).toEqual([1, 40, 70]);
});

test('an interrupted print goes on behind what is known to be made', () => {
  expect(lineAfter(PRINT)).toBe(56);
  expect(lineAfter(PRINT, AT)).toBe(57);
  expect(lineAfter({ ...PRINT, line: 0 })).toBeNull();
  expect(lineAfter({ ...PRINT, line: 0, startLine: 30 })).toBe(30);
  expect(lineAfter({ ...PRINT, line: 100 })).toBe(100);
});

const NOW: Snapshot = { ...new FakeSession().snapshot(), wakeUps: { missed: 0, latest: seconds(0) } };
const START: StartAt = {
  line: 57,
  position: [mm(1), mm(2), mm(0.4)],
  clearZ: mm(2.4),
  nozzle: celsius(210),
  bed: celsius(60),
};

let page: typeof import('../src/state/machine');
let start: typeof import('../src/state/start');
let request: typeof import('../src/state/start_request');
let preview: typeof import('../src/state/preview');
let machine: FakeWorker<FromMachine, ToMachine>;

beforeEach(async () => {
  vi.resetModules();
  vi.stubGlobal('localStorage', { getItem: () => null, setItem: () => undefined });
  const workers = fakeWorkers<FromMachine, ToMachine>();
  page = await import('../src/state/machine');
  start = await import('../src/state/start');
  request = await import('../src/state/start_request');
  preview = await import('../src/state/preview');
  page.startMachine();
  const [only] = workers;
  if (!only) throw new Error('no worker');
  machine = only;
  machine.say({ kind: 'loaded' });
  page.connect({ kind: 'serial', id: PRINT.port, baud: 250_000 }, { name: 'Mill', config: '' });
  machine.say({ kind: 'opened' });
  start.followStart();
  request.followStartRequest();
  show({});
});

const show = (now: Partial<Snapshot>): void =>
  machine.say({ kind: 'snapshot', snapshot: { ...NOW, ...now } });

test('it may go on once Z is known and the user has looked at the part', () => {
  start.begin(placeOf(plan, 57), null);
  show({ job: 'printing' });
  expect(start.startObstacle.value).toBeNull();
  show({ job: 'paused', start: START });
  expect(start.startObstacle.value).toContain('where Z stands');
  show({ job: 'paused', start: START, homed: [false, false, true] });
  expect(start.startObstacle.value).toContain('the part is where it was');
  start.isPartThere.value = true;
  expect(start.startObstacle.value).toBeNull();
  expect(start.starting.value?.place.line).toBe(57);
  show({ job: 'printing' });
  expect(start.starting.value).toBeNull();
});

test('a measured Z is near one of the places where the motor can stand, wherever it was moved meanwhile', () => {
  const near = (known: number | null, measured: number): number =>
    nearestPlace(start.placeNear(AT, known) ?? Number.NaN, AT.zPitch, measured);
  const begun = { place: placeOf(plan, 57), at: AT };
  start.begin(begun.place, AT);
  expect(near(null, 0.47)).toBeCloseTo(0.4, 9);
  expect(near(null, 0.49)).toBeCloseTo(0.56, 9);
  // Taken for the first of them, moved up by 10 mm, and measured there.
  start.noteZ(begun, null, 0.4);
  expect(near(10.4, 10.5)).toBeCloseTo(10.56, 9);
  start.noteZ(begun, 10.4, 10.56);
  expect(near(10.56, 10.41)).toBeCloseTo(10.4, 9);
  // Whoever takes it for something else between them can still get back to them.
  start.noteZ(begun, 10.56, 10.5);
  expect(near(10.5, 10.5)).toBeCloseTo(10.56, 9);
  expect(near(0.5, 0.5)).toBeCloseTo(0.56, 9);
});

test('places of the motor are told as heights over the bed', () => {
  const here = start.overBed(AT, -0.1);
  expect(here?.zPlaces[0]).toBeCloseTo(0.5, 9);
  expect(here?.zRange?.[1]).toBeCloseTo(0.5, 9);
  expect(here?.zPitch).toBe(AT.zPitch);
  expect(start.overBed(null, 1)).toBeNull();
});

test('where nothing is known of such places none is named', () => {
  const blind = { ...AT, zPlaces: [] };
  expect(start.placeNear(null, 1)).toBeNull();
  expect(start.placeNear(blind, null)).toBeNull();
  start.begin(placeOf(plan, 57), blind);
  start.noteZ({ place: placeOf(plan, 57), at: blind }, null, 3);
  expect(start.placeNear(blind, 3)).toBeNull();
  expect(start.placeNear({ ...AT, zPitch: mm(0) }, null)).toBeNull();
});

test('a pause later on is one like any other', () => {
  show({ job: 'paused' });
  expect([start.isToBegin.value, start.startObstacle.value]).toEqual([false, null]);
});

test.each<[string, () => void]>([
  ['is cancelled', () => machine.say({ kind: 'events', events: [{ kind: 'cancelled' }] })],
  ['loses its printer', () => machine.say({ kind: 'closed', trouble: null })],
])('what is being begun is forgotten where it %s', (_, end) => {
  start.begin(placeOf(plan, 57), null);
  show({ job: 'printing' });
  end();
  expect(start.starting.value).toBeNull();
});

test('what is begun next has to be looked at anew', () => {
  start.begin(placeOf(plan, 57), null);
  start.isPartThere.value = true;
  start.begin(placeOf(plan, 57), null);
  expect(start.isPartThere.value).toBe(false);
});

/** Answers the page's last question for a file. */
function answer(found: KeptFile): void {
  const asked = machine.sent.findLast((message) => message.kind === 'kept-file');
  if (asked?.kind !== 'kept-file') throw new Error('no file was asked for');
  machine.say({ kind: 'kept-file', id: asked.id, found });
}

test('the file of an interrupted print is looked for, then asked for, and shown', async () => {
  const asking = request.askToContinue(PRINT);
  expect(request.startRequest.value).toEqual({ kind: 'looking', lost: PRINT });
  answer({ kind: 'missing', trouble: null });
  await asking;
  expect(request.startRequest.value).toEqual({ kind: 'needs-file', lost: PRINT, trouble: null });
  const file = new Blob(['G28\n']);
  const again = request.askToContinue(PRINT, file);
  expect(machine.sent.at(-1)).toMatchObject({ kind: 'kept-file', print: PRINT.id, given: file });
  answer({ kind: 'there', file, at: AT, trouble: null });
  await again;
  expect(request.startRequest.value).toMatchObject({ kind: 'lost', lost: PRINT, blob: file, at: AT });
  expect(preview.file.value).toEqual({ name: 'part.gcode', blob: file });
  expect(machine.sent.some(({ kind }) => kind === 'print' || kind === 'wish')).toBe(false);
  // Another file is looked at: the question was about this one.
  preview.openFile(new Blob(['G29\n']), 'other.gcode');
  expect(request.startRequest.value).toBeNull();
});

test('what is put away before it is found does not come back', async () => {
  const asking = request.askToContinue(PRINT);
  request.startRequest.value = null;
  answer({ kind: 'there', file: new Blob(['G28\n']), at: AT, trouble: null });
  await asking;
  expect([request.startRequest.value, preview.file.value]).toEqual([null, null]);
});

test('a worker that is gone has no file', async () => {
  const asking = request.askToContinue(PRINT);
  machine.say({ kind: 'closed', trouble: null });
  await asking;
  expect(request.startRequest.value?.kind).toBe('needs-file');
});
