// What is said of a file in which nothing was found but what a test says.
import type { Summary } from '../src/preview/protocol';

const NOTHING: Summary = {
  errors: [],
  blocking: [],
  remarks: [],
  dropped: 0,
  lines: 5000,
  moves: 0,
  filament: 0 as Summary['filament'],
  bounds: null,
  vertices: 0,
  layers: [],
  time: null,
  features: [],
  objects: [],
  tools: [],
  leftOut: 0,
  clamped: 0,
  generator: null,
};

export const summaryOf = (found: Partial<Summary> = {}): Summary => ({ ...NOTHING, ...found });
