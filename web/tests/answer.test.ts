// What answers wrongly is told apart by its first bytes.
import { expect, test } from 'vitest';
import { answerTrouble } from '../src/machine/troubles';
import { classify } from '../src/transport/answer';

const bytes = (text: string): Uint8Array => new TextEncoder().encode(text);

test('nothing is silence', () => {
  expect(classify(new Uint8Array())).toBe('silent');
});

test.each([
  'start\r\necho:Marlin 2.1.2\r\n',
  'ok T:20.1 /0.0\r\n',
  'echo:busy: processing\n',
  'Error:Line Number is not\n',
])('%j is Marlin or a relative', (text) => {
  expect(classify(bytes(text))).toBe('marlin');
});

test('a bootloader that asks for a file', () => {
  expect(classify(bytes('CCCCCCCC'))).toBe('bootloader');
});

test('other text is text', () => {
  expect(classify(bytes('GPS $GPGGA,123519\r\n'))).toBe('text');
});

test('a block with its length and its end is the protocol', () => {
  expect(classify(Uint8Array.of(0xff, 5, 0x10, 0x12, 0x34, 0x7e))).toBe('klipper');
});

test('bytes at the wrong rate are noise, with the rate as the next thing to look at', () => {
  const kind = classify(Uint8Array.of(0xe6, 0x80, 0xf8, 0x06, 0x98, 0xfe, 0x1e, 0x80));
  expect(kind).toBe('noise');
  expect(answerTrouble(kind, 'wrong-firmware')?.todo).toMatch(/250000/);
});

test('a board that speaks the protocol keeps the words of the planner', () => {
  expect(answerTrouble('klipper', 'board-silent')).toBeNull();
});
