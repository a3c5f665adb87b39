// Where one looks from, how, and a picture to keep; the machine around the part.
import { expect, test } from '../fixtures/files.ts';
import { sample } from '../pages/panel.ts';
import { inView, Viewer } from '../pages/viewer.ts';

/** The page asks so many times before it gives up. */
const PICTURE_TRIES = 3;
const PNG_BEGINNING = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);

test('the view is turned by buttons and keys, with and without perspective', async ({ panel, page }) => {
  test.setTimeout(240_000);
  const viewer = await inView(panel, sample('test-part.gcode'));
  const seen: Buffer[] = [];
  const expectNew = async (what: string): Promise<void> => {
    const now = await viewer.picture();
    for (const other of seen) expect(now.equals(other), what).toBe(false);
    seen.push(now);
  };
  await expectNew('as it was');
  for (const name of ['Top', 'Front', 'Left', 'Right', 'Back']) {
    await viewer.button(name).click();
    await expectNew(name);
  }
  await viewer.button('All').click();
  await expectNew('All');
  await viewer.button('Without perspective').click();
  await expect(viewer.button('Without perspective')).toHaveAttribute('aria-pressed', 'true');
  await expectNew('without perspective');
  await viewer.view.focus();
  for (const key of ['ArrowLeft', 'ArrowUp', 'Shift+ArrowLeft', '+']) {
    await page.keyboard.press(key);
    await expectNew(key);
  }
});

test('the part stays in view as long as nobody has come nearer', async ({ panel, page }) => {
  test.setTimeout(90_000);
  const viewer = await inView(panel, sample('test-part.gcode'));
  const legend = viewer.legend.getByText('Colours', { exact: true });
  const beside = await viewer.picture();
  await viewer.view.focus();
  await page.keyboard.press('Home');
  expect((await viewer.picture()).equals(beside), 'beside the legend').toBe(true);
  await legend.focus();
  await page.keyboard.press('Enter');
  const alone = await viewer.picture();
  await viewer.view.focus();
  await page.keyboard.press('Home');
  expect((await viewer.picture()).equals(alone), 'without the legend').toBe(true);
});

test.describe('while the file is still coming', () => {
  // The page's main thread carries here what it never does otherwise.
  test.use({ areTasksJudged: false });
  test('what was moved stays as it is', async ({ panel, page }) => {
    test.setTimeout(90_000);
    // The end of the geometry is on its way to the view as long as the test likes.
    await page.addInitScript(() => {
      window.Worker = class extends Worker {
        override postMessage(
          message: { readonly type?: string; readonly port?: MessagePort },
          transfer: Transferable[] | StructuredSerializeOptions = [],
        ): void {
          const { type, port: source } = message;
          if (type !== 'source' || !source) return super.postMessage(message, transfer as Transferable[]);
          const { port1, port2: port } = new MessageChannel();
          const held: unknown[] = [];
          let isHolding = true;
          source.onmessage = ({ data }: MessageEvent<{ readonly request: { readonly type: string } }>) => {
            if (isHolding && (held.length > 0 || data.request.type === 'end')) held.push(data);
            else port1.postMessage(data);
          };
          const built = new Promise<void>((resolve) => {
            this.addEventListener('message', ({ data }: MessageEvent<{ readonly type: string }>) => {
              if (data.type === 'built') resolve();
            });
          });
          Object.assign(window, {
            letGo: () => {
              isHolding = false;
              for (const one of held) port1.postMessage(one);
              return built;
            },
          });
          super.postMessage({ type, port }, [port]);
        }
      };
    });
    await panel.open();
    const viewer = await inView(panel, sample('test-part-small.gcode'));
    await viewer.view.focus();
    await page.keyboard.press('+');
    await page.evaluate(() => (window as unknown as { letGo(): Promise<void> }).letGo());
    const nearer = await viewer.picture();
    await page.keyboard.press('Home');
    expect((await viewer.picture()).equals(nearer), 'it was not put to see all').toBe(false);
  });
});

test('a picture of the view is kept as PNG', async ({ panel, page }) => {
  const viewer = await inView(panel, sample('test-part.gcode'));
  await viewer.picture();
  // In full detail and large: without a graphics card that takes its time.
  test.setTimeout(150_000);
  const coming = page.waitForEvent('download', { timeout: 90_000 });
  await viewer.button('Save a picture').click();
  const download = await coming;
  expect(download.suggestedFilename()).toBe('test-part.png');
  const pieces: Buffer[] = [];
  for await (const piece of await download.createReadStream()) pieces.push(piece as Buffer);
  const bytes = Buffer.concat(pieces);
  expect(bytes.subarray(0, 8).equals(PNG_BEGINNING)).toBe(true);
  expect(bytes.readUInt32BE(16)).toBe(1920);
  expect(bytes.length).toBeGreaterThan(20_000);
});

test('that no picture could be made is said, and tried again', async ({ panel, page }) => {
  // The first tries come to nothing, as on a graphics card that gives up.
  await page.addInitScript((failures) => {
    let left = failures;
    window.Worker = class extends Worker {
      override postMessage(
        message: unknown,
        transfer: Transferable[] | StructuredSerializeOptions = [],
      ): void {
        const { type, id } = message as { readonly type?: string; readonly id?: number };
        if (type !== 'picture' || left === 0) return super.postMessage(message, transfer as Transferable[]);
        left -= 1;
        this.dispatchEvent(new MessageEvent('message', { data: { type, id, blob: null } }));
      }
    };
  }, PICTURE_TRIES);
  await panel.open();
  const viewer = await inView(panel, sample('test-part-small.gcode'));
  await viewer.button('Save a picture').focus();
  await page.keyboard.press('Enter');
  const notices = page.getByRole('status', { name: 'Notices' });
  await expect(notices).toContainText('The picture could not be made');
  test.setTimeout(150_000);
  const coming = page.waitForEvent('download', { timeout: 90_000 });
  await notices.getByRole('button', { name: 'Try again' }).click();
  expect((await coming).suggestedFilename()).toBe('test-part-small.png');
  await expect(notices).not.toContainText('The picture could not be made');
});

test.describe('by touch', () => {
  test.use({ hasTouch: true });
  test('one finger turns the view, two come nearer, a tap chooses', async ({ panel, page }) => {
    test.setTimeout(90_000);
    const viewer = await inView(panel, sample('test-part.gcode'));
    const session = await page.context().newCDPSession(page);
    const touch = async (type: 'touchStart' | 'touchMove' | 'touchEnd', ...xs: number[]): Promise<void> => {
      const touchPoints = xs.map((dx, id) => ({ x: x + dx, y, id }));
      await session.send('Input.dispatchTouchEvent', { type, touchPoints });
    };
    const { x, y } = await viewer.middle();
    const whole = await viewer.picture();
    await touch('touchStart', 0);
    await touch('touchMove', 40);
    await touch('touchMove', 80);
    await touch('touchEnd');
    const turned = await viewer.picture();
    expect(turned.equals(whole), 'turned').toBe(false);
    await touch('touchStart', -40, 40);
    await touch('touchMove', -60, 60);
    await touch('touchMove', -80, 80);
    await touch('touchEnd');
    expect((await viewer.picture()).equals(turned), 'nearer').toBe(false);
    await page.touchscreen.tap(x, y);
    await expect(viewer.segment).toBeVisible();
  });
});

test('what leaves the machine is told by its colour', async ({ panel, page, makeFile }) => {
  const viewer = new Viewer(page);
  const bead = (x: number): string =>
    `G28\nG90\nM82\nM104 S200\nM109 S200\nG92 E0\nG1 Z0.2 F600\nG1 X${x} Y100 F6000\nG1 X${x + 40} Y100 E4 F1200\n`;
  /** Seen from the top and fitted, the same bead looks the same wherever it lies, but for the bed. */
  const look = async (x: number): Promise<Buffer> => {
    await panel.look(makeFile(`bead-${x}.gcode`, bead(x)));
    await viewer.ready();
    await viewer.button('Top').click();
    const { x: left, y: top } = await viewer.middle();
    await viewer.picture();
    return await page.screenshot({ clip: { x: left - 4, y: top - 2, width: 8, height: 4 } });
  };
  const within = await look(90);
  expect((await look(100)).equals(within)).toBe(true);
  expect((await look(900)).equals(within)).toBe(false);
});
