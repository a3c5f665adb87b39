// Keeps a print from being lost by accident: asks before the page is left, keeps the screen awake.
import { effect } from '@preact/signals';
import { isPrinting } from '../state/machine';

const ask = (event: BeforeUnloadEvent): void => event.preventDefault();

/** Holds a wake lock while `wanted`; the browser lets go of it when the page is hidden. */
class ScreenLock {
  #wanted = false;
  #lock: WakeLockSentinel | undefined;
  #asking = false;

  constructor() {
    document.addEventListener('visibilitychange', () => void this.#update());
  }

  want(wanted: boolean): void {
    this.#wanted = wanted;
    void this.#update();
  }

  async #update(): Promise<void> {
    if (!('wakeLock' in navigator) || this.#asking) return;
    if (!this.#wanted) {
      await this.#lock?.release();
      this.#lock = undefined;
      return;
    }
    if (document.visibilityState !== 'visible' || (this.#lock && !this.#lock.released)) return;
    this.#asking = true;
    try {
      this.#lock = await navigator.wakeLock.request('screen');
    } catch {
      // Refused (battery saver): the print does not depend on it.
    } finally {
      this.#asking = false;
    }
    if (!this.#wanted) await this.#update();
  }
}

export function guardPrint(): void {
  const screen = new ScreenLock();
  effect(() => {
    if (isPrinting.value) window.addEventListener('beforeunload', ask);
    else window.removeEventListener('beforeunload', ask);
    screen.want(isPrinting.value);
  });
}
