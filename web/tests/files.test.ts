// Some lines out of a file, however its bytes come.
import { expect, test } from 'vitest';
import { linesOf } from '../src/files';

/** A file whose bytes come in pieces of this size. */
function inPieces(text: string, size: number): Blob {
  const bytes = new TextEncoder().encode(text);
  const blob = new Blob([bytes]);
  const stream = (): ReadableStream<Uint8Array> => {
    let at = 0;
    return new ReadableStream({
      pull(controller) {
        if (at >= bytes.byteLength) return controller.close();
        controller.enqueue(bytes.slice(at, at + size));
        at += size;
      },
    });
  };
  Object.defineProperty(blob, 'stream', { value: stream });
  return blob;
}

const TEXT = 'G28\r\nG1 X1 ; größer\n\nG1 X2\nM84';

test.each([1, 2, 3, 7, 1000])('lines are found in pieces of %i bytes', async (size) => {
  const file = inPieces(TEXT, size);
  expect(await linesOf(file, 1, 99)).toEqual(['G28', 'G1 X1 ; größer', '', 'G1 X2', 'M84']);
  expect(await linesOf(file, 2, 3)).toEqual(['G1 X1 ; größer', '']);
  expect(await linesOf(file, 5, 6)).toEqual(['M84']);
  expect(await linesOf(file, 6, 9)).toEqual([]);
});

test('a line that is too long to look at is cut', async () => {
  const [long, next] = await linesOf(inPieces(`${'x'.repeat(100_000)}\nG28\n`, 999), 1, 2);
  expect(long).toMatch(/^x{120}…$/);
  expect(next).toBe('G28');
});

test('what is not wanted any more is not read on', async () => {
  let asked = 0;
  const texts = await linesOf(inPieces('G28\n'.repeat(1000), 10), 900, 901, () => {
    asked += 1;
    return asked < 3;
  });
  expect([texts, asked]).toEqual([[], 3]);
});

test('a packed file is unpacked', async () => {
  const packed = new Blob([TEXT]).stream().pipeThrough(new CompressionStream('gzip'));
  const file = await new Response(packed).blob();
  expect(await linesOf(file, 4, 4)).toEqual(['G1 X2']);
});
