// A port that was lost and is there again: offered, never taken by itself. Knows no banner.
import { computed, effect, signal } from '@preact/signals';
import type { PortChoice } from '../machine/protocol';
import { find, identify, isSameKind, type PortId } from '../transport/web_serial';
import { connect, connection, port, trouble } from './machine';
import { activeProfile, type Profile } from './profiles';

/** Troubles that end with the port there again. */
const LOSSES = new Set(['unplugged', 'port-error', 'port-gone']);

interface Lost {
  readonly choice: PortChoice & { kind: 'serial' };
  readonly profile: Profile;
}

/** What this tab was last connected to. */
let last: Lost | null = null;
const lost = signal<Lost | null>(null);
const ports = signal<readonly SerialPort[]>([]);

/** The port that was lost, there again; null where it is not, or cannot be told from another. */
const returned = computed<SerialPort | null>(() => {
  const { choice } = lost.value ?? {};
  if (!choice || connection.value !== 'closed') return null;
  const alike = ports.value.filter((one) => isSameKind(one, choice.id));
  return alike.length === 1 ? (alike[0] ?? null) : null;
});

/** Whether one press connects to it again. */
export const mayReconnect = computed(() => returned.value !== null && LOSSES.has(trouble.value?.code ?? ''));

async function look(): Promise<void> {
  try {
    ports.value = (await navigator.serial.getPorts()).filter((one) => one.connected !== false);
  } catch {
    // The dialog says why, when somebody asks for ports there.
    ports.value = [];
  }
}

export function reconnect(): void {
  const [before, found] = [lost.value, returned.value];
  if (!before || !found) return;
  const id: PortId = identify(found, ports.value);
  if (find(id, ports.value) === found) connect({ ...before.choice, id }, before.profile);
}

/** Keeps watch over the port that this tab uses. */
export function followPort(): void {
  if (!('serial' in navigator)) return;
  effect(() => {
    const [state, choice] = [connection.value, port.value];
    if (state !== 'closed' && choice?.kind === 'serial') {
      last = { choice, profile: activeProfile.peek() };
      lost.value = null;
    } else if (state === 'closed' && last && LOSSES.has(trouble.value?.code ?? '')) {
      lost.value = last;
      last = null;
      // A line that only hangs up leaves its port where it is.
      void look();
    }
  });
  for (const type of ['connect', 'disconnect'] as const)
    navigator.serial.addEventListener(type, () => void (lost.value && look()));
}
