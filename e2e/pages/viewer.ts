// The preview as its users know it: the view, its sliders, legend, facts of a segment, the file's text.
import { expect, type Locator, type Page } from '@playwright/test';

export class Viewer {
  readonly page: Page;
  readonly region: Locator;
  /** The picture itself, which turns and is clicked. */
  readonly view: Locator;
  readonly topLayer: Locator;
  readonly lowestLayer: Locator;
  readonly firstMove: Locator;
  readonly lastMove: Locator;
  readonly legend: Locator;
  readonly colourBy: Locator;
  readonly segment: Locator;
  readonly text: Locator;

  constructor(page: Page) {
    this.page = page;
    this.region = page.getByRole('region', { name: 'Preview' });
    this.view = this.region.getByRole('application');
    this.topLayer = this.region.getByRole('slider', { name: 'Top layer shown' });
    this.lowestLayer = this.region.getByRole('slider', { name: 'Lowest layer shown' });
    this.firstMove = this.region.getByRole('slider', { name: 'First move shown' });
    this.lastMove = this.region.getByRole('slider', { name: 'Last move shown' });
    this.legend = this.region.getByRole('group').filter({ hasText: 'Colours' });
    this.colourBy = this.region.getByRole('combobox', { name: 'Colour by' });
    this.segment = this.region.getByRole('region', { name: 'Segment' });
    this.text = this.region.getByRole('listbox', { name: 'G-code' });
  }

  button(name: string): Locator {
    return this.region.getByRole('button', { name, exact: true });
  }

  checkbox(name: string): Locator {
    return this.region.getByRole('checkbox', { name, exact: true });
  }

  /** Waits until the file is read and its sliders are there. */
  async ready(): Promise<void> {
    await expect(this.region.getByRole('progressbar', { name: 'Reading the file' })).toHaveCount(0);
    await expect(this.lastMove).toBeVisible();
  }

  /** A slider's value, counted as the page counts it. */
  async valueOf(slider: Locator): Promise<number> {
    return Number(await slider.getAttribute('aria-valuenow'));
  }

  async limitsOf(slider: Locator): Promise<{ readonly min: number; readonly max: number }> {
    const read = async (name: string): Promise<number> => Number(await slider.getAttribute(name));
    return { min: await read('aria-valuemin'), max: await read('aria-valuemax') };
  }

  /** A fact of the segment that is looked at. */
  fact(name: string): Locator {
    return this.segment
      .getByRole('term')
      .filter({ hasText: new RegExp(`^${name}$`) })
      .locator('xpath=following-sibling::dd');
  }

  async openText(): Promise<void> {
    const button = this.button('Show the G-code');
    if ((await button.getAttribute('aria-pressed')) !== 'true') await button.click();
    await expect(this.text).toBeVisible();
  }

  /** A line of the text that is in view. */
  line(number: number): Locator {
    return this.text.locator(`#gcode-line-${number}`);
  }
}
