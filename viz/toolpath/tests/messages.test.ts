import { describe, expect, test } from 'vitest';
import { carryOut, type ViewRequest } from '../src/messages';
import type { ToolpathView } from '../src/view';

/** A view that notes which of its methods are called, and with what. */
function noting(): { readonly view: ToolpathView; readonly calls: unknown[][] } {
  const calls: unknown[][] = [];
  const view = new Proxy(
    {},
    {
      get:
        (_, name) =>
        (...given: unknown[]) =>
          calls.push([name, ...given]),
    },
  );
  return { view: view as ToolpathView, calls };
}

const words = new Uint32Array(4);
const box = { min: [0, 0, 0], max: [1, 1, 1] } as const;
const REQUESTS: readonly (readonly [ViewRequest, readonly unknown[]])[] = [
  [{ type: 'append', vertices: words }, [words]],
  [{ type: 'appendChannels', words }, [words]],
  [{ type: 'setColour', mode: 'speed' }, ['speed']],
  [{ type: 'setColourRange', mode: 'speed', range: [1, 2] }, ['speed', [1, 2]]],
  [{ type: 'show', shown: { wipes: true } }, [{ wipes: true }]],
  [{ type: 'setHighlight', vertex: 7 }, [7]],
  [{ type: 'setHighlightedObject', object: 2 }, [2]],
  [{ type: 'setVolume', box }, [box]],
  [{ type: 'setMesh', mesh: null }, [null]],
  [{ type: 'pick', x: 1, y: 2, id: 3 }, [1, 2, 3]],
  [{ type: 'picture', id: 3, size: { width: 4, height: 5 } }, [3, { width: 4, height: 5 }]],
  [{ type: 'setCamera', preset: 'top' }, ['top']],
  [{ type: 'setFollow', follow: true }, [true]],
  [{ type: 'slice', first: 2, end: 4, id: 9 }, [2, 4, 9]],
  [{ type: 'setProjection', projection: 'orthographic' }, ['orthographic']],
];

describe('requests', () => {
  test.each(REQUESTS)('%j is the method of its name', (request, given) => {
    const { view, calls } = noting();
    carryOut(view, request);
    expect(calls).toEqual([[request.type, ...given]]);
  });
});
