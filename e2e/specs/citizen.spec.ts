// The page among other tabs: it keeps the screen awake while it prints, advises to pin its tab, and tells of a print
// while it is hidden, where the user wants that. The browser's own parts are stood in for: a headless one has no screen.
import type { Page } from '@playwright/test';
import { travels } from '../fixtures/gcode.ts';
import { expect, type SerialPanel, test } from '../fixtures/serial.ts';
import { strolling } from '../serial/gcode.ts';
import { PrinterDevice } from '../serial/printer.ts';

const FAST = { vendor: 0x1d50, product: 0x614e, shared: true, speed: 50 } as const;

interface StandIns {
  /** Screen locks that are held. */
  screens: number;
  asked: number;
  notes: { title: string; body: string }[];
  permission: NotificationPermission;
  hide(isHidden: boolean): void;
}

/** Stand-ins for the screen, the notifications and the visibility. */
async function standIn(page: Page, permission: NotificationPermission): Promise<void> {
  await page.addInitScript((answer) => {
    const locks = new Set<EventTarget & { released: boolean; release(): Promise<void> }>();
    let hidden = false;
    const state: StandIns = {
      screens: 0,
      asked: 0,
      notes: [],
      permission: 'default',
      hide(isHidden) {
        hidden = isHidden;
        // A browser lets go of the screen when the page is hidden.
        if (hidden) for (const lock of locks) void lock.release();
        document.dispatchEvent(new Event('visibilitychange'));
      },
    };
    Object.defineProperty(document, 'visibilityState', { get: () => (hidden ? 'hidden' : 'visible') });
    Object.defineProperty(navigator, 'wakeLock', {
      value: {
        request: async () => {
          if (hidden) throw new DOMException('hidden', 'NotAllowedError');
          const lock = Object.assign(new EventTarget(), {
            released: false,
            async release() {
              if (locks.delete(lock)) state.screens -= 1;
              lock.released = true;
            },
          });
          locks.add(lock);
          state.screens += 1;
          return lock;
        },
      },
    });
    window.Notification = class {
      static get permission() {
        return state.permission;
      }
      static async requestPermission() {
        state.asked += 1;
        state.permission = answer;
        return answer;
      }
      constructor(title: string, { body = '' }: NotificationOptions = {}) {
        state.notes.push({ title, body });
      }
    } as unknown as typeof Notification;
    Object.assign(globalThis, { standIns: state });
  }, permission);
}

const ask = <T>(page: Page, look: (state: StandIns) => T): Promise<T> =>
  page.evaluate(`(${look})(globalThis.standIns)`) as Promise<T>;

async function opened(
  open: () => Promise<SerialPanel>,
  permission: NotificationPermission,
): Promise<SerialPanel> {
  const panel = await open();
  await standIn(panel.page, permission);
  await panel.open();
  return panel;
}

const titles = (page: Page): Promise<string[]> => ask(page, ({ notes }) => notes.map(({ title }) => title));

test('the screen is kept awake while printing, and again after the page was hidden', async ({ open }) => {
  const panel = await opened(open, 'default');
  const screens = () => ask(panel.page, (state) => state.screens);
  await panel.connectVirtual();
  expect(await screens()).toBe(0);
  await panel.dropText(travels(3000).gcode);
  await panel.startPrint();
  await expect.poll(screens).toBe(1);
  await ask(panel.page, (state) => state.hide(true));
  await expect.poll(screens).toBe(0);
  await ask(panel.page, (state) => state.hide(false));
  await expect.poll(screens).toBe(1);
  await panel.job.getByRole('button', { name: 'Cancel' }).click();
  await panel.answer('End the print?', 'End the print');
  await expect(panel.status).toContainText('Ready');
  await expect.poll(screens).toBe(0);
});

test('notifications: asked for on the click alone, and sent only while the page is hidden', async ({
  open,
}) => {
  const panel = await opened(open, 'granted');
  const { page } = panel;
  await panel.connectVirtual();
  expect(await ask(page, ({ asked }) => asked)).toBe(0);
  const dialog = await panel.openDialog('Settings');
  const box = dialog.getByRole('checkbox', { name: /Tell me when a print ends/ });
  await expect(box).not.toBeChecked();
  await box.check();
  expect(await ask(page, ({ asked }) => asked)).toBe(1);
  await panel.closeDialog(dialog);
  // In view: nothing.
  await panel.dropText(travels(20).gcode);
  await panel.startPrint();
  await expect(panel.job).toContainText('The print is done.');
  expect(await titles(page)).toEqual([]);
  // Hidden: a pause, and the end.
  await panel.dropText(travels(600).gcode, 'long.gcode');
  await panel.startPrint();
  await ask(page, (state) => state.hide(true));
  await panel.job.getByRole('button', { name: 'Pause' }).click();
  await expect.poll(() => titles(page)).toEqual(['The print is paused']);
  await panel.job.getByRole('button', { name: 'Resume' }).click();
  await expect.poll(() => titles(page)).toEqual(['The print is paused', 'The print is done']);
  expect(await ask(page, ({ notes }) => notes.map(({ body }) => body))).toEqual(['long.gcode', 'long.gcode']);
  // Turned off again.
  await ask(page, (state) => state.hide(false));
  const again = await panel.openDialog('Settings');
  await again.getByRole('checkbox', { name: /Tell me/ }).uncheck();
  await panel.closeDialog(again);
  await panel.dropText(travels(20).gcode);
  await panel.startPrint();
  await ask(page, (state) => state.hide(true));
  await expect(panel.job).toContainText('The print is done.');
  expect(await titles(page)).toHaveLength(2);
});

test('a refused permission leaves the box empty and says where it is changed', async ({ open }) => {
  const panel = await opened(open, 'denied');
  const dialog = await panel.openDialog('Settings');
  const box = dialog.getByRole('checkbox', { name: /Tell me/ });
  await box.click();
  await expect(box).not.toBeChecked();
  await panel.closeDialog(dialog);
  await expect(panel.messages).toContainText('does not allow this page to send notifications');
  const again = await panel.openDialog('Settings');
  await expect(again.getByRole('checkbox', { name: /Tell me/ })).toBeDisabled();
  await expect(again).toContainText('change that in its settings for this site');
});

test('a long print on a real printer advises to pin the tab, until that was read', async ({
  bridge,
  open,
}) => {
  const port = bridge.add(new PrinterDevice(), FAST);
  const panel = await open();
  const notices = panel.page.getByRole('status', { name: 'Notices' });
  await panel.pickAndConnect(bridge, port);
  await expect(panel.status).toContainText('Ready');
  const printAndCancel = async (seconds: number, see: () => Promise<void>): Promise<void> => {
    await panel.dropText(strolling(seconds, true), `${seconds}.gcode`);
    await panel.startPrint();
    await see();
    await panel.job.getByRole('button', { name: 'Cancel' }).click();
    await panel.answer('End the print?', 'End the print');
    await expect(panel.status).toContainText('Ready');
  };
  await printAndCancel(600, () => expect(notices).toBeEmpty());
  await printAndCancel(4000, async () => {
    await expect(notices).toContainText('pin this tab');
    await notices.getByRole('button', { name: 'Put this notice away' }).click();
    await expect(notices).toBeEmpty();
  });
  await printAndCancel(4001, () => expect(notices).toBeEmpty());
});
