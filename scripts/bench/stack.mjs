// Makes a large file of real toolpaths: the sample's print again and again, beside and above each other. Plain Node.
import { closeSync, openSync, readFileSync, writeSync } from 'node:fs';
import { join } from 'node:path';

import { root } from '../lib/target.mjs';

/** Copies beside each other along X and along Y; what is more stands on top. */
const ROW = 7;
const PITCH_MM = 40;
const HEIGHT_MM = 12.2;
const FIRST_LAYER = '\n;LAYER_CHANGE\n';
const MB = 1_000_000;

/** A word of a move, shifted; with as many digits as the slicer writes. */
const shifted = (text, letter, byMm) =>
  text.replace(new RegExp(`^(G[01] [^;\\n]*?${letter})(-?[\\d.]+)`, 'gm'), (_, before, value) => `${before}${+(Number(value) + byMm).toFixed(3)}`);

/** The sample in three pieces: what comes before the first layer, its layers, what follows them. */
function sample() {
  const text = readFileSync(join(root, 'samples', 'test-part.gcode'), 'utf8');
  const begin = text.indexOf(FIRST_LAYER) + 1;
  const lastLayer = text.lastIndexOf(FIRST_LAYER);
  const end = text.indexOf('\n;TYPE:Custom\n', lastLayer) + 1;
  if (begin <= 0 || end <= lastLayer) throw new Error('the sample has no layers, or no end of its own');
  return [text.slice(0, begin), text.slice(begin, end), text.slice(end)];
}

/** Writes a file of at least so many MB. */
export function stack(path, mb) {
  const [before, layers, after] = sample();
  const file = openSync(path, 'w');
  try {
    let bytes = writeSync(file, before);
    for (let copy = 0; bytes + after.length < mb * MB; copy += 1) {
      const [column, row, level] = [copy % ROW, Math.floor(copy / ROW) % ROW, Math.floor(copy / ROW ** 2)];
      const middle = (ROW - 1) / 2;
      let text = shifted(layers, 'X', (column - middle) * PITCH_MM);
      text = shifted(text, 'Y', (row - middle) * PITCH_MM);
      bytes += writeSync(file, shifted(text, 'Z', level * HEIGHT_MM));
    }
    writeSync(file, after);
  } finally {
    closeSync(file);
  }
}

if (process.argv[1] === import.meta.filename) stack(process.argv[2], Number(process.argv[3]));
