// The preview as its users know it: the view, its sliders, legend, facts of a segment, the file's text.
import { expect, type Locator, type Page } from '@playwright/test';
import type { Panel } from './panel.ts';

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

  /** Draws a slider's handle so far. */
  async drag(handle: Locator, by: { readonly x: number; readonly y: number }): Promise<void> {
    const box = await handle.boundingBox();
    if (!box) throw new Error('the handle is not on the page');
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const { mouse } = this.page;
    await mouse.move(x, y);
    await mouse.down();
    await mouse.move(x + by.x / 2, y + by.y / 2);
    await mouse.move(x + by.x, y + by.y);
    await mouse.up();
  }

  /** The middle of the view, where nothing lies over it. */
  async middle(): Promise<{ readonly x: number; readonly y: number }> {
    const box = await this.view.boundingBox();
    if (!box) throw new Error('the view is not on the page');
    return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
  }

  /** Waits until the view shows all that it was asked for in full detail, and the browser shows that. */
  async drawn(): Promise<void> {
    await expect(this.view).toHaveAttribute('aria-busy', 'false', { timeout: 60_000 });
    await this.page.evaluate(
      () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))),
    );
  }

  /** A few pixels of the picture, around a place of the page. */
  async patch(x: number, y: number): Promise<Buffer> {
    return await this.whileBare(async () => {
      await this.settled();
      return await this.page.screenshot({ clip: { x: x - 4, y: y - 4, width: 8, height: 8 } });
    });
  }

  /** What is drawn, once it does not change any more: the whole view with all that lies over it taken away. */
  async picture(): Promise<Buffer> {
    return await this.whileBare(() => this.settled());
  }

  private async whileBare<T>(act: () => Promise<T>): Promise<T> {
    await this.bare(true);
    try {
      return await act();
    } finally {
      await this.bare(false);
    }
  }

  /** Transparent, not away: what has the focus keeps it. Through the object model, which the page's policy lets pass. */
  private async bare(isBare: boolean): Promise<void> {
    await this.region.evaluate(
      (region, [over, isBare]) => {
        for (const one of region.querySelectorAll<HTMLElement>(over)) one.style.opacity = isBare ? '0' : '';
        const view = region.querySelector<HTMLElement>('.canvas-place');
        if (view) view.style.outline = isBare ? 'none' : '';
      },
      [OVER_VIEW, isBare] as const,
    );
  }

  private async settled(): Promise<Buffer> {
    const take = (): Promise<Buffer> => this.view.screenshot({ animations: 'disabled', caret: 'hide' });
    let before: Buffer | null = null;
    for (let tries = 0; tries < TRIES_MAX; tries += 1) {
      await this.drawn();
      const now = await take();
      // A frame of the view's worker may reach the screen a little after the worker has said so.
      if (before && now.equals(before)) return now;
      before = now;
    }
    throw new Error('the picture does not settle');
  }
}

/** Drops a file on the page and waits until it is read. */
export async function inView(panel: Panel, path: string): Promise<Viewer> {
  const viewer = new Viewer(panel.page);
  await panel.drop(path);
  await viewer.ready();
  return viewer;
}

const OVER_VIEW = '.over-left, .legend, .segment-card, .hover-note, .empty';
const TRIES_MAX = 20;
