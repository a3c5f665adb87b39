// No serious fault that axe can find, in both themes, on a wide and on a narrow window, in each state of the page.
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { expect, type MakeFile, test } from '../fixtures/files.ts';
import { travels } from '../fixtures/gcode.ts';
import type { Panel } from '../pages/panel.ts';

const WINDOWS = {
  wide: { width: 1440, height: 900 },
  narrow: { width: 390, height: 844 },
} as const;
/** A line to be confirmed, so that its list is looked at too. */
const UNKNOWN = 'START_PRINT BED=60';
const SERIOUS = new Set(['serious', 'critical']);

// A trace would keep a copy of the whole page for each of axe's questions.
test.use({ trace: 'off' });
// Axe works in the page, in tasks of 100 ms and more: other specs judge the page's own.
test.use({ areTasksJudged: false });

/** Transitions would be measured half-way. */
const still = (page: Page): Promise<void> => page.emulateMedia({ reducedMotion: 'reduce' });

async function expectAccessible(page: Page, state: string): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  const serious = violations
    .filter(({ impact }) => SERIOUS.has(impact ?? ''))
    .flatMap(({ id, nodes }) =>
      nodes.map(({ target, failureSummary }) => `${id}: ${target} ${failureSummary}`),
    );
  expect(serious, state).toEqual([]);
}

/** Nothing sticks out at the side. */
async function expectFits(page: Page, state: string): Promise<void> {
  const [content, width] = await page.evaluate(
    () => [document.documentElement.scrollWidth, innerWidth] as const,
  );
  expect(content, `${state}: the page is as wide as its window`).toBeLessThanOrEqual(width);
}

async function walk(panel: Panel, makeFile: MakeFile): Promise<void> {
  const { page } = panel;
  const look = async (state: string): Promise<void> => {
    await expectAccessible(page, state);
    await expectFits(page, state);
  };
  await look('nothing connected, no file');
  for (const name of ['Connect', 'Machine', 'Settings'] as const) {
    const dialog = await panel.openDialog(name);
    if (name === 'Machine') await expect(dialog).toContainText('A machine with room');
    await look(`the dialog ${name}`);
    await panel.closeDialog(dialog);
  }
  // Slow enough that the print goes on while it is looked at.
  await panel.connectVirtual('up to 20×');
  await look('connected');
  await panel.drop(makeFile('travels.gcode', `${UNKNOWN}\n${travels(3000).gcode}`));
  await panel.job.getByRole('checkbox', { name: /Line 1\b/ }).check();
  await expect(panel.print).toBeEnabled();
  await look('a file is loaded');
  await panel.job.getByRole('button', { name: 'Print from a line…' }).click();
  const begin = page.getByRole('dialog', { name: 'Print from a line' });
  await expect(begin.locator('[aria-current="true"]')).not.toBeEmpty();
  await look('where a print is to begin');
  await begin.getByRole('textbox', { name: /^Line/ }).fill('40');
  await begin.getByRole('textbox', { name: /^Line/ }).press('Enter');
  await begin.getByRole('button', { name: /^Get ready at line 40/ }).click();
  await expect(panel.status).toContainText('Paused');
  await look('what there is to do before it begins');
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.job).toContainText('The print was cancelled.');
  await panel.startPrint();
  await look('printing');
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await look('a question');
  await panel.answer('End the print?', 'Go on printing');
  await panel.emergencyStop.click();
  await expect(panel.status).toContainText('Stopped');
  await look('stopped');
}

for (const theme of ['light', 'dark'] as const)
  for (const [size, viewport] of Object.entries(WINDOWS))
    test.describe(`${theme}, ${size}`, () => {
      test.use({ colorScheme: theme, viewport });
      test('has no serious fault for those who do not see or point', async ({ panel, makeFile }) => {
        test.setTimeout(180_000);
        await still(panel.page);
        await walk(panel, makeFile);
      });
    });
