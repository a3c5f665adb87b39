// What one does with a printer by hand: homing, jogging, temperatures, filament, fan, speed, the console.
import { expect, type MakeFile, test } from '../fixtures/files.ts';
import { travels } from '../fixtures/gcode.ts';
import type { Panel } from '../pages/panel.ts';
import { motor } from '../pages/record.ts';

/** At 200 times the speed the machine's idle timeout of 600 s would be over in three. */
const BY_HAND = 'up to 20×';
const STEPS_A_MM = { stepper_x: 80, stepper_z: 400 } as const;

test('home, then jog by the steps that are chosen, never out of the machine', async ({ panel }) => {
  await panel.connectVirtual(BY_HAND);
  const right = panel.motion.getByRole('button', { name: /^Right/ });
  await expect(right).toBeDisabled();
  await expect(panel.motion).toContainText('Home first');
  await panel.home();
  const homed = await panel.record();
  await panel.motion.getByText('10 mm', { exact: true }).click();
  await right.click();
  await expect(panel.fact(panel.motion, 'X')).toHaveText('10.00');
  await panel.motion.getByText('0.1 mm', { exact: true }).click();
  await panel.motion.getByRole('button', { name: /^Up/ }).click();
  await expect(panel.fact(panel.motion, 'Z')).toHaveText('0.10');
  const moved = await panel.record();
  const way = (name: keyof typeof STEPS_A_MM): number =>
    (motor(moved, name).count - motor(homed, name).count) / STEPS_A_MM[name];
  expect(way('stepper_x')).toBe(10);
  expect(way('stepper_z')).toBeCloseTo(0.1, 6);

  // 50 mm to the left of 10 mm ends at the edge.
  await panel.motion.getByText('50 mm', { exact: true }).click();
  await panel.motion.getByRole('button', { name: /^Left/ }).click();
  await expect(panel.fact(panel.motion, 'X')).toHaveText('0.00');
  await expect(panel.alert).toBeEmpty();

  await panel.motion.getByRole('button', { name: 'Motors off' }).click();
  await expect(panel.fact(panel.motion, 'X')).toContainText('not homed');
  expect((await panel.record()).motors.map(({ energised }) => energised)).toEqual([
    false,
    false,
    false,
    false,
  ]);
});

test('temperatures: targets with a decimal comma, presets, what is no number or too hot is not sent', async ({
  panel,
}) => {
  await panel.connectVirtual(BY_HAND);
  const nozzle = panel.target('Nozzle');
  await nozzle.fill('60,5');
  await nozzle.press('Enter');
  await expect(nozzle).toHaveValue('61');
  await expect(panel.heater('Nozzle')).toContainText('Heating');
  await expect(panel.heater('Nozzle')).toContainText('Holding', { timeout: 30_000 });
  const body = (await panel.record()).heaters.find(({ name }) => name === 'extruder')?.temperature_c;
  expect(body).toBeGreaterThan(55);

  for (const wrong of ['900', 'hot', '-5']) {
    await nozzle.fill(wrong);
    await nozzle.press('Enter');
    await expect(panel.heater('Nozzle')).toContainText('From 0 to 260 °C');
    await nozzle.press('Escape');
  }
  await expect(nozzle).toHaveValue('61');

  await panel.temperatures.getByRole('button', { name: 'PETG' }).click();
  await expect(nozzle).toHaveValue('235');
  await expect(panel.target('Bed')).toHaveValue('80');
  await panel.temperatures.getByRole('button', { name: 'Cool down' }).click();
  await expect(nozzle).toHaveValue('0');
  await expect(panel.target('Bed')).toHaveValue('0');
});

test('what is typed heats nothing until it is set', async ({ panel }) => {
  await panel.connectVirtual(BY_HAND);
  const nozzle = panel.target('Nozzle');
  const set = panel.temperatures.getByRole('button', { name: 'Set Nozzle target' });
  await expect(set).toHaveCount(0);
  await nozzle.fill('210');
  await expect(set).toBeEnabled();
  // As when another window is chosen.
  await nozzle.blur();
  await expect(nozzle).toHaveValue('0');
  await expect(set).toHaveCount(0);
  await nozzle.fill('900');
  await expect(set).toBeDisabled();
  // By mouse or finger, and by keyboard.
  await nozzle.fill('65');
  await set.click();
  await expect(nozzle).toHaveValue('65');
  await expect(panel.heater('Nozzle')).toContainText('Heating');
  await nozzle.fill('70');
  await nozzle.press('Tab');
  await expect(set).toBeFocused();
  await set.press('Enter');
  await expect(nozzle).toHaveValue('70');
  const heaters = (await panel.record()).heaters;
  expect(heaters.find(({ name }) => name === 'extruder')?.temperature_c).toBeLessThan(200);

  const bed = panel.target('Bed');
  await bed.fill('90');
  await panel.disconnect();
  await panel.connectVirtual(BY_HAND);
  await expect(bed).toHaveValue('0');
});

test('what is typed when the board stops is put away', async ({ panel }) => {
  await panel.connectVirtual(BY_HAND);
  const nozzle = panel.target('Nozzle');
  await nozzle.fill('210');
  await panel.page.evaluate(() =>
    document.querySelector<HTMLElement>('button[aria-label="Emergency stop"]')?.click(),
  );
  await expect(nozzle).toBeDisabled();
  await expect(nozzle).toHaveValue('0');
  // Nothing was asked of the board that has stopped.
  await expect(panel.alert).toContainText('The emergency stop was asked for.');
  await panel.alert.getByRole('button', { name: 'Restart the board' }).click();
  await expect(nozzle).toBeEnabled();
  await expect(nozzle).toHaveValue('0');
  await panel.page.keyboard.press('Enter');
  await expect(panel.heater('Nozzle')).toContainText('Off');
});

test('filament: refused while cold, pushed once hot', async ({ panel }) => {
  await panel.connectVirtual(BY_HAND);
  const extrude = panel.motion.getByRole('button', { name: 'Extrude' });
  await expect(extrude).toBeDisabled();
  await expect(panel.motion).toContainText('too cold');
  await panel.temperatures.getByRole('button', { name: 'PLA' }).click();
  await expect(extrude).toBeEnabled({ timeout: 30_000 });
  const length = panel.motion.getByRole('textbox', { name: 'Filament' });
  await length.fill('2,5');
  await length.press('Enter');
  await extrude.click();
  const pushed = async (): Promise<number> => motor(await panel.record(), 'extruder').position_mm;
  await expect.poll(pushed).toBeCloseTo(2.5, 1);
  await panel.motion.getByRole('button', { name: 'Retract' }).click();
  await expect.poll(pushed).toBeCloseTo(0, 1);
});

async function printTravels(panel: Panel, makeFile: MakeFile): Promise<void> {
  await panel.drop(makeFile('travels.gcode', travels(3000).gcode));
  await panel.startPrint();
  await expect(panel.fact(panel.job, 'Line')).toHaveText(/[1-9]\d/);
}

test('speed and fan while printing', async ({ panel, makeFile }) => {
  await panel.connectVirtual(BY_HAND);
  await printTravels(panel, makeFile);
  const set = async (name: string, value: string): Promise<void> => {
    const field = panel.tuning.getByRole('textbox', { name });
    await field.fill(value);
    await field.press('Enter');
    await expect(field).toHaveValue(value);
  };
  await set('Part fan', '50');
  await expect.poll(async () => (await panel.record()).fans[0]?.speed).toBeCloseTo(0.5, 1);
  await set('Speed', '150');
  await set('Flow', '95');
  await expect(panel.status).toContainText('Printing');
  // Moving by hand is the print's business now.
  await expect(panel.motion.getByRole('button', { name: /^Left/ })).toBeDisabled();
});

test('the virtual printer is made faster while it prints', async ({ panel, makeFile }) => {
  await panel.connectVirtual('Real time');
  // Eight minutes: in real time it would still be printing when this test is over.
  await panel.drop(makeFile('travels.gcode', travels(300).gcode));
  await panel.startPrint();
  await panel.tuning.getByText('up to 200×').click();
  await expect(panel.job).toContainText('The print is done', { timeout: 50_000 });
});

test('the console: sends, answers, says what it does not know, remembers', async ({ panel }) => {
  await panel.connectVirtual(BY_HAND);
  await panel.send('G28 X');
  await expect(panel.messages).toContainText('X is homed at 0.00 mm.');
  await panel.send('G1 X30 F6000');
  await expect(panel.fact(panel.motion, 'X')).toHaveText('30.00');
  await panel.send('M114');
  await expect(panel.messages).toContainText(/X:?\s?30/);
  await panel.send('NONSENSE 1');
  await expect(panel.messages.getByRole('listitem').last()).toContainText(/NONSENSE|not known/);

  await panel.gcodeField.press('ArrowUp');
  await expect(panel.gcodeField).toHaveValue('NONSENSE 1');
  for (let steps = 0; steps < 3; steps += 1) await panel.gcodeField.press('ArrowUp');
  await expect(panel.gcodeField).toHaveValue('G28 X');
  await panel.gcodeField.press('ArrowDown');
  await expect(panel.gcodeField).toHaveValue('G1 X30 F6000');
});
