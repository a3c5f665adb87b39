// Files for the specs: real slices, shortened, and what their text alone says. Knows no planner.
import { readFileSync } from 'node:fs';
import { sample } from '../pages/panel.ts';

/** A move to the next layer, as the slicer of the small sample writes it. */
const LAYER = /^G1 Z\d/;
/** Where the slicer's own end begins. */
const END = '; Filament-specific end gcode';

/** The first layers of a real slice with its own start and end: heating, homing, retractions, cooling down. */
export function slice(layers: number): string {
  const lines = readFileSync(sample('test-part-small.gcode'), 'utf8').split('\n');
  // The first is a lift in the start G-code.
  const starts = lines.flatMap((line, index) => (LAYER.test(line) ? [index] : [])).slice(1);
  const end = lines.findIndex((line) => line.startsWith(END));
  const cut = starts[layers];
  if (cut === undefined || end < cut) throw new Error(`the sample has no ${layers} layers and an end`);
  return [...lines.slice(0, cut), ...lines.slice(end)].join('\n');
}

/** The text up to and with the first line that begins so. */
export function upTo(gcode: string, command: string): string {
  const lines = gcode.split('\n');
  const index = lines.findIndex((line) => line.startsWith(command));
  if (index < 0) throw new Error(`the file has no ${command}`);
  return lines.slice(0, index + 1).join('\n');
}

/** Where X, Y and Z stand at the end of a text, in mm, after G0, G1, G28, G90 and G91 alone. */
export function endOf(gcode: string): [number, number, number] {
  const place: [number, number, number] = [0, 0, 0];
  let isRelative = false;
  const step = (word: string): void => {
    const axis = 'XYZ'.indexOf(word.charAt(0));
    if (axis < 0) return;
    const value = Number(word.slice(1));
    place[axis] = isRelative ? (place[axis] ?? 0) + value : value;
  };
  for (const line of gcode.split('\n')) {
    const [command = '', ...words] = line.replace(/;.*/, '').trim().split(/\s+/);
    if (command === 'G90' || command === 'G91') isRelative = command === 'G91';
    else if (command === 'G28') place.fill(0);
    else if (command === 'G0' || command === 'G1') words.forEach(step);
  }
  return place;
}

/**
 * A print of XY moves alone that heats both heaters without waiting, or leaves them cold, rests after homing, and takes
 * at least so long.
 */
export function strolling(seconds: number, isCold = false): string {
  const speedMmS = 100;
  const sides = Math.ceil((seconds * speedMmS) / 100);
  const corners = ['X150 Y50', 'X150 Y150', 'X50 Y150', 'X50 Y50'];
  const moves = Array.from({ length: sides }, (_, side) => `G1 ${corners[side % corners.length]}`);
  const heat = isCold ? [] : ['M140 S60', 'M104 S200'];
  const start = [...heat, 'G28', 'G4 P8000', 'G1 X50 Y50 Z5 F6000'];
  return [...start, ...moves, 'M104 S0', 'M140 S0', ''].join('\n');
}

/** The same with a layer every few sides: moves of Z, the fan, and a wait, so that there are several runs of motion. */
export function climbing(seconds: number, isCold = true): string {
  const lines = strolling(seconds, isCold).split('\n');
  const at = lines.findIndex((line) => line.startsWith('G1 X50')) + 1;
  const sides = lines.slice(at, -3);
  const layers = sides.flatMap((line, side) => {
    const layer = side / 8;
    if (!Number.isInteger(layer) || side === 0) return [line];
    const wait = layer % 2 === 0 ? ['M400', 'G4 P200'] : [];
    return [
      `G1 Z${(5 + layer / 5).toFixed(1)} F600`,
      `M106 S${(40 * layer) % 256}`,
      ...wait,
      `${line} F6000`,
    ];
  });
  return [...lines.slice(0, at), ...layers, 'M107', ...lines.slice(-3)].join('\n');
}

/** A tower of square walls, and what there is to know of its layers. */
export interface Tower {
  readonly gcode: string;
  /** Of a layer, counted from 1: the line that announces it. */
  readonly lineOf: (layer: number) => number;
  /** Its height, mm. */
  readonly zOf: (layer: number) => number;
  readonly corners: readonly (readonly [number, number])[];
}

/** Hot, with retractions and ways between layers; a layer takes about three seconds. */
export function tower(layers: number): Tower {
  const corners = [
    [80, 80],
    [120, 80],
    [120, 120],
    [80, 120],
    [80, 80.5],
  ] as const;
  const lines = ['M140 S60', 'M104 S200', 'G28', 'G90', 'M83', 'G1 Z5 F600', 'M109 S200', 'M106 S128'];
  const starts: number[] = [];
  const zOf = (layer: number): number => Number((layer * 0.2).toFixed(2));
  for (let layer = 1; layer <= layers; layer += 1) {
    starts.push(lines.length + 1);
    const [[x, y], ...sides] = corners;
    lines.push(';LAYER_CHANGE', `;Z:${zOf(layer)}`, 'G1 E-0.8 F2400', `G1 Z${zOf(layer)} F600`);
    lines.push(`G1 X${x} Y${y} F6000`, 'G1 E0.8 F2400', 'G1 F3600');
    lines.push(...sides.map(([x, y]) => `G1 X${x} Y${y} E1.33`));
  }
  lines.push('G1 E-0.8 F2400', `G1 Z${zOf(layers) + 5} F600`, 'M104 S0', 'M140 S0', 'M107');
  return { gcode: `${lines.join('\n')}\n`, lineOf: (layer) => starts[layer - 1] ?? 0, zOf, corners };
}
