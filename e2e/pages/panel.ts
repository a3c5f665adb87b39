// The panel as its users know it: by the names of buttons, fields and regions. Knows nothing of how it is made.
import { basename, join } from 'node:path';
import { expect, type Locator, type Page } from '@playwright/test';
import { root } from '../../scripts/lib/target.mjs';
import { recordOf, type VirtualState } from './record.ts';

/** A sample's path. */
export const sample = (name: string): string => join(root, 'samples', name);

/** The drag operation of files, in the browser's mask. */
const COPY = 1;

export type VirtualSpeed = 'Real time' | 'up to 5×' | 'up to 20×' | 'up to 200×';

export class Panel {
  readonly page: Page;
  readonly top: Locator;
  /** What is connected and what it does. */
  readonly status: Locator;
  readonly emergencyStop: Locator;
  /** The trouble that has to be told. */
  readonly alert: Locator;
  readonly preview: Locator;
  readonly job: Locator;
  readonly print: Locator;
  readonly temperatures: Locator;
  readonly motion: Locator;
  readonly tuning: Locator;
  readonly console: Locator;
  readonly messages: Locator;
  readonly gcodeField: Locator;

  constructor(page: Page) {
    this.page = page;
    this.top = page.getByRole('banner').first();
    this.status = this.top.getByRole('status');
    this.emergencyStop = this.top.getByRole('button', { name: 'Emergency stop' });
    this.alert = page.getByRole('alert');
    this.preview = page.getByRole('region', { name: 'Preview' });
    this.job = page.getByRole('region', { name: 'Print', exact: true });
    this.print = this.job.getByRole('button', { name: /^Print( again)?$/ });
    this.temperatures = page.getByRole('region', { name: 'Temperatures' });
    this.motion = page.getByRole('region', { name: 'Motion' });
    this.tuning = page.getByRole('region', { name: 'Speed and fan' });
    this.console = page.getByRole('region', { name: 'Console' });
    this.messages = this.console.getByRole('list', { name: 'Messages' });
    this.gcodeField = this.console.getByRole('textbox', { name: 'G-code to send' });
  }

  async open(): Promise<void> {
    await this.page.goto('/');
    await expect(this.page.getByRole('heading', { name: 'Stepcast' })).toBeVisible();
  }

  dialog(name: 'Connect' | 'Machine' | 'Settings'): Locator {
    return this.page.getByRole('dialog', { name, exact: true });
  }

  /** Opens a dialog by its button in the bar. */
  async openDialog(name: 'Connect' | 'Machine' | 'Settings'): Promise<Locator> {
    await this.top.getByRole('button', { name, exact: true }).click();
    const dialog = this.dialog(name);
    await expect(dialog).toBeVisible();
    return dialog;
  }

  async closeDialog(dialog: Locator): Promise<void> {
    await dialog.getByRole('button', { name: 'Close', exact: true }).click();
    await expect(dialog).toHaveCount(0);
  }

  /** Chooses the virtual printer in the dialog. */
  async chooseVirtual(dialog: Locator, speed: VirtualSpeed, faults = ''): Promise<void> {
    const kinds = dialog.getByRole('group', { name: 'What to connect to' });
    // Browsers without Web Serial offer no choice.
    if (await kinds.isVisible()) await kinds.getByText('Virtual printer').click();
    await dialog.getByRole('group', { name: 'Speed' }).getByText(speed, { exact: true }).click();
    if (faults === '') return;
    await dialog.getByText('Try faults out').click();
    await dialog.getByRole('textbox', { name: 'Faults' }).fill(faults);
  }

  /** Connects the virtual printer and waits until it is ready. */
  async connectVirtual(speed: VirtualSpeed = 'up to 200×', faults = ''): Promise<void> {
    const dialog = await this.openDialog('Connect');
    await this.chooseVirtual(dialog, speed, faults);
    await dialog.getByRole('button', { name: 'Connect', exact: true }).click();
    await expect(dialog).toHaveCount(0);
    await expect(this.status).toContainText('Ready');
  }

  /** Disconnects a printer that is not printing. */
  async disconnect(): Promise<void> {
    await this.top.getByRole('button', { name: 'Disconnect' }).click();
    await expect(this.status).toContainText('Not connected');
  }

  /** Drops a file and waits until it is the one that may be printed. */
  async drop(path: string): Promise<void> {
    await this.look(path);
    await expect(this.job.getByRole('heading', { name: basename(path) })).toBeVisible();
  }

  /** Turns the view by mouse as long as the condition holds; returns how many times. */
  async turnWhile(condition: () => boolean): Promise<number> {
    const { x, y } = await this.middleOfPreview();
    const { mouse } = this.page;
    await mouse.move(x, y);
    await mouse.down();
    let turns = 0;
    for (; condition(); turns += 1) {
      await mouse.move(x + 80 * Math.sin(turns / 3), y + 30 * Math.cos(turns / 3));
    }
    await mouse.up();
    return turns;
  }

  private async middleOfPreview(): Promise<{ x: number; y: number }> {
    const box = await this.preview.boundingBox();
    if (!box) throw new Error('the preview is not on the page');
    return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
  }

  /** Drops a file of this computer on the preview, as the desktop does: dragged in, moved, let go. */
  async look(path: string): Promise<void> {
    const at = await this.middleOfPreview();
    const data = { items: [], files: [path], dragOperationsMask: COPY };
    const session = await this.page.context().newCDPSession(this.page);
    for (const type of ['dragEnter', 'dragOver', 'drop'] as const)
      await session.send('Input.dispatchDragEvent', { type, ...at, data });
    await session.detach();
  }

  /** The number in a `<dt>` … `<dd>` pair of a region, as shown. */
  fact(region: Locator, name: string): Locator {
    return region.getByRole('term').filter({ hasText: name }).locator('xpath=following-sibling::dd');
  }

  /** Where the page says that the head is, in mm. */
  async position(axis: 'X' | 'Y' | 'Z'): Promise<number> {
    return Number(await this.fact(this.motion, axis).innerText());
  }

  heater(name: 'Nozzle' | 'Bed'): Locator {
    return this.temperatures.getByRole('listitem').filter({ hasText: name });
  }

  target(name: 'Nozzle' | 'Bed'): Locator {
    return this.temperatures.getByRole('textbox', { name: `${name} target` });
  }

  /** Answers a question that the page asks before something that cannot be taken back. */
  async answer(question: string, button: string): Promise<void> {
    await this.page
      .getByRole('dialog', { name: question })
      .getByRole('button', { name: button, exact: true })
      .click();
  }

  /** Starts the file that is open, once it may be printed. */
  async startPrint(): Promise<void> {
    await expect(this.print).toBeEnabled();
    await this.print.click();
    await expect(this.status).toContainText('Printing');
  }

  /** Sends a line through the console. */
  async send(gcode: string): Promise<void> {
    await this.gcodeField.fill(gcode);
    await this.gcodeField.press('Enter');
  }

  /** The diagnostic report, downloaded as a user does. */
  async report(): Promise<string> {
    const dialog = await this.openDialog('Settings');
    const coming = this.page.waitForEvent('download');
    await dialog.getByRole('button', { name: 'Diagnostic report' }).click();
    const download = await coming;
    const text: Buffer[] = [];
    for await (const piece of await download.createReadStream()) text.push(piece as Buffer);
    await this.closeDialog(dialog);
    return Buffer.concat(text).toString();
  }

  /** What the virtual printer itself says of its motors, heaters and switches. */
  async record(): Promise<VirtualState> {
    return recordOf(await this.report());
  }

  /** Homes all axes and waits until the position is known. */
  async home(): Promise<void> {
    await this.motion.getByRole('button', { name: 'Home all axes' }).click();
    for (const axis of ['X', 'Y', 'Z'])
      await expect(this.fact(this.motion, axis)).not.toContainText('not homed');
    await expect(this.messages).toContainText('Z is homed');
  }
}
