import { expect, test } from 'vitest';
import { Unpacked } from '../src/preview/unpacked';

const bytes = (text: string): Uint8Array<ArrayBuffer> => new Uint8Array(Buffer.from(text));

test('what was added is there, in order, while more comes', async () => {
  const unpacked = new Unpacked();
  unpacked.add(bytes('G28\n'));
  expect(await unpacked.text()?.text()).toBe('G28\n');
  const long = `; ${'x'.repeat(5 << 20)}\n`;
  unpacked.add(bytes(long));
  unpacked.add(bytes('M84\n'));
  expect(
    await unpacked
      .text()
      ?.slice(4 + long.length)
      .text(),
  ).toBe('M84\n');
  expect(unpacked.text()?.size).toBe(8 + long.length);
});

test('what is too large is given up, and stays so', () => {
  const unpacked = new Unpacked(10);
  unpacked.add(bytes('0123456789'));
  expect(unpacked.isGivenUp).toBe(false);
  unpacked.add(bytes('0'));
  expect(unpacked.isGivenUp).toBe(true);
  expect(unpacked.text()).toBeNull();
  unpacked.add(bytes('1'));
  expect(unpacked.text()).toBeNull();
});
