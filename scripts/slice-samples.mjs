#!/usr/bin/env node
// Slices samples/test-part.stl again, the way the committed samples were made.
//
//   node scripts/make-sample-model.mjs && node scripts/slice-samples.mjs
//
// Needs PrusaSlicer (`prusa-slicer`, measured with 2.5.0), Slic3r (`slic3r`, 1.3.0) and CuraEngine (`CuraEngine`, 4.13.0) on
// the PATH, and Cura's definitions of settings (CURA_RESOURCES, or where Debian's package `cura` puts them). None is needed
// to build, test or use Stepcast: what they wrote is committed. Other versions of a slicer give other files, and the
// first line of each file holds the time it was made, so a new run always shows up as a change.
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { homedir, tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const model = join('samples', 'test-part.stl');
const BYTES_MAX = 2_000_000;
const cura = process.env.CURA_RESOURCES ?? '/usr/share/cura/resources';

const samples = [
  {
    name: 'test-part.gcode',
    command: 'prusa-slicer',
    args: (output) => [
      '--load', 'samples/profiles/prusaslicer.ini', '--center', '150,150', '--loglevel', '1',
      '--export-gcode', '--output', output, model,
    ],
  },
  {
    name: 'test-part-small.gcode',
    command: 'slic3r',
    args: (output) => [
      '--load', 'samples/profiles/slic3r.ini', '--scale', '0.55', '--print-center', '100,100',
      '--output', output, model,
    ],
  },
  {
    name: 'test-part-tiny.gcode',
    command: 'CuraEngine',
    env: { CURA_ENGINE_SEARCH_PATH: ['definitions', 'extruders'].map((folder) => join(cura, folder)).join(':') },
    args: (output) => [
      'slice', '-j', join(cura, 'definitions', 'fdmprinter.def.json'),
      ...curaSettings(), '-e0', ...curaSettings(), '-o', output, '-l', model,
    ],
  },
];

/** CuraEngine's settings: a key and a value a line, `\n` for a line end. */
function curaSettings() {
  const lines = readFileSync(join(root, 'samples', 'profiles', 'cura.txt'), 'utf8').split('\n');
  const settings = lines.filter((line) => line !== '' && !line.startsWith('#'));
  return settings.flatMap((line) => ['-s', line.replaceAll('\\n', '\n')]);
}

/** Thumbnails are pictures for a printer's screen; they say nothing to a planner. */
const withoutThumbnails = (text) => text.replace(/^; thumbnail\w* begin[^]*?^; thumbnail\w* end\r?\n/gm, '');

function slice({ name, command, args, env }) {
  const folder = mkdtempSync(join(tmpdir(), 'stepcast-slice-'));
  const output = join(folder, name);
  try {
    const run = spawnSync(command, args(output), { cwd: root, encoding: 'utf8', env: { ...process.env, ...env } });
    if (run.error?.code === 'ENOENT') throw new Error(`not run: ${command} is not on the PATH`);
    if (run.status !== 0) throw new Error(`${command} failed:\n${run.stdout}${run.stderr}`);
    const text = withoutThumbnails(readFileSync(output, 'utf8'));
    for (const place of [root, folder, homedir()]) {
      if (text.includes(place + '/')) throw new Error(`${name} names a path of this machine: ${place}`);
    }
    if (text.length > BYTES_MAX) throw new Error(`${name} has ${text.length} bytes, more than ${BYTES_MAX}`);
    writeFileSync(join(root, 'samples', name), text);
    const estimate = /^; estimated printing time.*= (.*)$/m.exec(text)?.[1] ?? 'no estimate';
    console.log(`samples/${name}: ${text.length} bytes, ${estimate}`);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

try {
  samples.forEach(slice);
} catch (error) {
  console.error(error.message);
  process.exitCode = 1;
}
