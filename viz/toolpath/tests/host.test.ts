import { afterEach, expect, test, vi } from 'vitest';
import { ToolpathHost } from '../src/host';
import type { WorkerRequest } from '../src/messages';

afterEach(() => vi.unstubAllGlobals());

const SIZE = { width: 4, height: 3, ratio: 1 };

/** A host, and what its worker is told; `onChange` asks at once when the change is drawn. */
function asking() {
  const told: WorkerRequest['type'][] = [];
  vi.stubGlobal('OffscreenCanvas', class {});
  vi.stubGlobal(
    'Worker',
    class {
      postMessage({ type }: WorkerRequest): void {
        told.push(type);
      }
    },
  );
  const canvas = { transferControlToOffscreen: () => ({}) } as unknown as HTMLCanvasElement;
  const host: ToolpathHost = new ToolpathHost(canvas, { size: SIZE, onChange: () => host.settle(1) });
  told.length = 0;
  return { host, told };
}

test('who is told of a change asks behind it', () => {
  const { host, told } = asking();
  host.resize(SIZE);
  host.fit();
  host.discard(2);
  expect(told).toEqual(['resize', 'settle', 'fit', 'settle', 'discard', 'settle']);
});

test('questions, the nozzle and the print are no changes', () => {
  const { host, told } = asking();
  host.pick(1, 2, 3);
  host.setNozzle([1, 2, 3]);
  host.setPrintedUpTo(7);
  expect(told).toEqual(['pick', 'setNozzle', 'setPrintedUpTo']);
});
