// Files that cannot be printed as they are: what is wrong is said by line, and nothing goes to the printer.
import { readFileSync } from 'node:fs';
import { expect, test } from '../fixtures/files.ts';
import { type Panel, sample } from '../pages/panel.ts';
import { pulsesOf } from '../pages/record.ts';

const PREAMBLE = 'G28\nG90\nM82\nG92 E0\nM104 S200\nM109 S200\n';
const SQUARE = 'G1 X50 Y50 Z5 F3000\nG1 X60\nG1 Y60\nG1 X50\nG1 Y50\nM104 S0\n';

const errors = (panel: Panel) => panel.job.getByRole('list', { name: 'What stops the print' });

/** The file cannot be started, and the printer knows nothing of it. */
async function expectNothingSent(panel: Panel): Promise<void> {
  await expect(panel.print).toBeDisabled();
  await expect(panel.status).toContainText('Ready');
  const record = await panel.record();
  expect(pulsesOf(record)).toEqual({ stepper_x: 0, stepper_y: 0, stepper_z: 0, extruder: 0 });
  expect(record.heaters.map(({ duty }) => duty)).toEqual([0, 0]);
}

test('a broken file: what is wrong is told by line', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  // Out of the machine on line 8, and a number that is none on line 10.
  await panel.drop(makeFile('broken.gcode', `${PREAMBLE}G1 X50 F3000\nG1 X999\nG1 X60\nG1 Y1.2.3\n`));
  await expect(errors(panel)).toContainText('Line 8');
  await expect(errors(panel)).toContainText('Line 10');
  await expect(panel.job).toContainText('The file cannot be printed on this machine');
  await expectNothingSent(panel);
});

test('a file cut off in the middle of a line is told', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  const whole = readFileSync(sample('test-part-small.gcode'), 'utf8');
  const at = whole.indexOf('G1 X', whole.length / 2);
  await panel.drop(makeFile('cut-off.gcode', whole.slice(0, at + 6)));
  const lines = whole.slice(0, at).split('\n').length;
  await expect(panel.job).toContainText(new RegExp(`cut off|Line ${lines.toLocaleString('en-GB')}`));
});

test('an unknown macro has to be confirmed by its line, and is then left out', async ({
  panel,
  makeFile,
}) => {
  await panel.connectVirtual();
  await panel.drop(makeFile('macro.gcode', `START_PRINT BED=60\n${PREAMBLE}${SQUARE}`));
  await expect(panel.job).toContainText('A command has to be confirmed first');
  await expect(panel.print).toBeDisabled();
  const line = panel.job.getByRole('checkbox', { name: /Line 1\b.*START_PRINT/ });
  await line.check();
  await expect(panel.print).toBeEnabled();
  await line.uncheck();
  await expect(panel.print).toBeDisabled();
  await line.check();
  await panel.print.click();
  await expect(panel.job).toContainText('The print is done.', { timeout: 45_000 });
  const [x] = (await panel.record()).motors;
  expect(x?.position_mm).toBeCloseTo(50, 1);
});

test('many unknown macros are confirmed a command at a time', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  // More than are listed, and one that only comes after those.
  const macros = Array.from({ length: 1200 }, (_, at) => (at % 2 ? 'AFTER_LAYER' : 'BEFORE_LAYER'));
  const gcode = [PREAMBLE + SQUARE.replace('M104 S0\n', ''), ...macros, 'LATE_MACRO', 'M104 S0', ''].join(
    '\n',
  );
  await panel.drop(makeFile('macros.gcode', gcode));
  await expect(panel.job).toContainText('3 commands have to be confirmed first');
  for (const name of [/Lines .* and 495 more.*BEFORE_LAYER/, /Lines .* more.*AFTER_LAYER/, /More lines/]) {
    await expect(panel.print).toBeDisabled();
    await panel.job.getByRole('checkbox', { name }).check();
  }
  await panel.print.click();
  await expect(panel.job).toContainText('The print is done.', { timeout: 45_000 });
});

test('a binary file is no G-code', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  const noise = Uint8Array.from({ length: 4096 }, (_, at) => (at * 2654435761) >>> 13);
  await panel.drop(makeFile('firmware.bin', noise));
  await expect(errors(panel)).toContainText('not plain G-code');
  await expectNothingSent(panel);
});

test('a model is named, with what to do instead', async ({ panel }) => {
  await panel.connectVirtual();
  await panel.drop(sample('test-part.stl'));
  await expect(errors(panel)).toContainText(/slice/i);
  await expectNothingSent(panel);
});

test('an empty file', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  await panel.drop(makeFile('empty.gcode', ''));
  await expect(errors(panel)).toContainText(/empty|nothing/i);
  await expectNothingSent(panel);
});

test('another file takes the place of a broken one', async ({ panel, makeFile }) => {
  await panel.connectVirtual();
  await panel.drop(makeFile('empty.gcode', ''));
  await expect(errors(panel)).toBeVisible();
  await panel.drop(sample('test-part-small.gcode'));
  await expect(panel.print).toBeEnabled();
  await expect(errors(panel)).toHaveCount(0);
});
