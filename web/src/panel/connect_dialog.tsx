// Choosing what to connect to: a printer on USB, or the virtual printer in this page.
import { signal } from '@preact/signals';
import type { JSX } from 'preact';
import { useEffect, useId } from 'preact/hooks';
import type { KeptPrint } from '../machine/protocol';
import { endedBy } from '../state/interrupted';
import { connect, plannerFailed, plannerLoaded, refusePort } from '../state/machine';
import { activeProfile, profiles, SHIPPED } from '../state/profiles';
import { change, settings } from '../state/settings';
import { identify, type PortId } from '../transport/web_serial';
import { openDialog } from './dialogs';
import { PanelDialog } from './emergency';
import { faultProblem } from './faults';
import { machineSummary } from './machine_summary';
import { Button, Choice, NumberField } from './parts';
import { ask } from './question';
import { VirtualSpeed } from './virtual_speed';

const HAS_SERIAL = 'serial' in navigator;
const FAULTS_EXAMPLE = 'sensor-open=extruder@90';
const FAULTS_CHARACTERS_MAX = 500;
const FAULTS_HINT =
  'What breaks, and at which second after power-up: sensor-open, sensor-short, heater-dead, heater-stuck-on (=extruder or heater_bed), endstop-stuck-on, endstop-stuck-off (=x, y or z), unplug, replug, board-reset; outage and power-loss (=seconds). Damage to the bytes all the time: corrupt, drop, duplicate, delay (=probability). Several are separated by commas.';

const known = signal<readonly SerialPort[]>([]);
const chosen = signal<SerialPort | null>(null);
const notice = signal<string | null>(null);
/** A script of what goes wrong with the virtual printer; not kept, so that it surprises nobody another day. */
const faults = signal('');

const hex = (value: number | null): string => (value ?? 0).toString(16).padStart(4, '0');

function nameOf({ vendor, product, index }: PortId): string {
  const kind = vendor === null ? 'Serial port' : `USB device ${hex(vendor)}:${hex(product)}`;
  return index > 0 ? `${kind}, number ${index + 1}` : kind;
}

/** The ports that are there; undefined where the browser does not tell. */
async function list(): Promise<readonly SerialPort[] | undefined> {
  try {
    return (await navigator.serial.getPorts()).filter((port) => port.connected !== false);
  } catch (error) {
    refusePort(error);
    notice.value = 'The browser does not tell which ports there are. Reload the page, then try again.';
    return undefined;
  }
}

/** A port that is gone is chosen no longer, and no other takes its place unasked: that may be another printer. */
async function look(): Promise<void> {
  known.value = (await list()) ?? [];
  if (chosen.value === null || known.value.includes(chosen.value)) return;
  chosen.value = null;
  notice.value = 'The port that was chosen is no longer there: plug the printer in again, or choose a port.';
}

/** A known port is offered; when there is only one it is the choice, and still somebody has to press the button. */
async function offer(): Promise<void> {
  known.value = (await list()) ?? [];
  if (chosen.value && known.value.includes(chosen.value)) return;
  chosen.value = known.value.length === 1 ? (known.value[0] ?? null) : null;
}

/** Keeps the list true while the dialog is open. */
function followPorts(): () => void {
  const changed = (): void => void look();
  for (const type of ['connect', 'disconnect'] as const) navigator.serial.addEventListener(type, changed);
  void offer();
  return () => {
    for (const type of ['connect', 'disconnect'] as const)
      navigator.serial.removeEventListener(type, changed);
  };
}

async function choose(): Promise<void> {
  notice.value = null;
  try {
    const picked = await navigator.serial.requestPort();
    await look();
    chosen.value = picked;
  } catch (error) {
    const name = error instanceof DOMException ? error.name : '';
    if (name === 'NotFoundError')
      notice.value =
        'No port was chosen. If yours is not in the list: is the printer on, and does the cable carry data?';
    else if (name === 'SecurityError')
      notice.value =
        'The browser does not allow this page to use serial ports (a setting or a policy forbids it).';
    else refusePort(error);
  }
}

async function go(): Promise<void> {
  const { connectTo, baud, speed } = settings.value;
  const profile = activeProfile.value;
  if (connectTo === 'virtual' || !HAS_SERIAL) {
    connect({ kind: 'virtual', board: 'rp2040', speed, seed: 1, faults: faults.value.trim() }, profile);
  } else {
    // The worker finds the port by its place among those of its kind: that has to be its place now.
    await look();
    if (!chosen.value || openDialog.value !== 'connect') return;
    const id = identify(chosen.value, known.value);
    const choice = { kind: 'serial', id, baud } as const;
    const [ended] = endedBy(id, profile.config);
    if (ended) askWhetherToEnd(ended, () => connect(choice, profile));
    else connect(choice, profile);
  }
  openDialog.value = null;
}

/** A board that is set up for another machine is restarted, and a print that it holds is lost by that. */
function askWhetherToEnd({ facts, machine }: KeptPrint, act: () => void): void {
  ask({
    title: 'Connect with another machine file?',
    text: `The print of ${facts.name} was interrupted; it was begun with the machine “${machine.name}”, as its file was then. If this is its printer and its board still holds the print, connecting with another machine file restarts the board and ends the print.`,
    yes: 'Connect all the same',
    no: 'Do not connect',
    act,
  });
}

function Ports(): JSX.Element {
  const ports = known.value;
  return (
    <div class="stack">
      {ports.length > 0 && (
        <fieldset class="ports">
          <legend>Ports that this page may use</legend>
          {ports.map((port) => (
            <label key={port} class="check">
              <input
                type="radio"
                name="port"
                checked={chosen.value === port}
                onChange={() => {
                  chosen.value = port;
                  notice.value = null;
                }}
              />
              {nameOf(identify(port, ports))}
            </label>
          ))}
        </fieldset>
      )}
      <div class="row wrap">
        <Button onClick={() => void choose()}>
          {ports.length > 0 ? 'Choose another port' : 'Choose a port'}
        </Button>
      </div>
      <div role="status">{notice.value && <p class="hint">{notice.value}</p>}</div>
      <NumberField
        label="Baud rate"
        unit="Bd"
        value={settings.value.baud}
        min={2400}
        max={4_000_000}
        onSet={(baud) => change({ baud: Math.round(baud) })}
      />
      <p class="hint">
        Boards with USB of their own ignore the baud rate; for a UART it is that of the firmware, often
        250000.
      </p>
    </div>
  );
}

function Virtual(): JSX.Element {
  const hintId = useId();
  const problem = faultProblem(faults.value);
  return (
    <div class="stack">
      <p>
        A whole printer inside this page: the same firmware, heaters that warm up, motors that move. Nothing
        real gets warm. It is built from the machine file in use and is gone when the page is closed.
      </p>
      <VirtualSpeed label="Speed" />
      <details class="more">
        <summary>Try faults out</summary>
        <div class="stack">
          <label class="field">
            Faults
            <input
              type="text"
              class="code"
              placeholder={FAULTS_EXAMPLE}
              autocomplete="off"
              autocapitalize="off"
              spellcheck={false}
              maxLength={FAULTS_CHARACTERS_MAX}
              value={faults.value}
              aria-invalid={problem !== null}
              aria-describedby={hintId}
              onInput={(event) => (faults.value = event.currentTarget.value)}
            />
          </label>
          <p class={problem === null ? 'hint' : 'field-hint'} id={hintId} role="status">
            {problem ?? FAULTS_HINT}
          </p>
        </div>
      </details>
      {faults.value.trim() !== '' && problem === null && (
        <p class="hint">These faults will happen: {faults.value}</p>
      )}
    </div>
  );
}

function obstacle(isSerial: boolean): string | null {
  if (plannerFailed.value) return 'The planner could not be loaded.';
  if (!plannerLoaded.value) return 'The planner is still loading.';
  if (!machineSummary.value) return 'The machine file has errors: mend it under Machine.';
  if (!isSerial) return faultProblem(faults.value) === null ? null : 'The faults cannot be read: see above.';
  return chosen.value ? null : 'Choose a port first.';
}

export function ConnectDialog(): JSX.Element {
  const isSerial = HAS_SERIAL && settings.value.connectTo === 'serial';
  const why = obstacle(isSerial);
  useEffect(() => {
    notice.value = null;
    return HAS_SERIAL ? followPorts() : undefined;
  }, []);
  return (
    <PanelDialog title="Connect" onClose={() => (openDialog.value = null)}>
      <form
        class="stack"
        onSubmit={(event) => {
          event.preventDefault();
          if (why === null) void go();
        }}
      >
        {HAS_SERIAL ? (
          <Choice
            label="What to connect to"
            hideLabel
            choices={[
              { value: 'serial', text: 'Printer on USB' },
              { value: 'virtual', text: 'Virtual printer' },
            ]}
            value={isSerial ? 'serial' : 'virtual'}
            onSet={(connectTo) => change({ connectTo })}
          />
        ) : (
          <p class="hint">
            This browser cannot reach USB printers. Chrome, Edge and Opera on a computer can (Web Serial).
            Previews and the virtual printer work here too.
          </p>
        )}
        <label class="field">
          Machine
          <select
            value={activeProfile.value.id}
            onChange={(event) => change({ profile: event.currentTarget.value })}
          >
            {profiles.value.map((profile) => (
              <option key={profile.id} value={profile.id}>
                {profile.name}
              </option>
            ))}
          </select>
        </label>
        {isSerial && activeProfile.value.config === SHIPPED.config && (
          <p class="hint">
            This is the sample machine’s file. For a printer of your own, open its printer.cfg under Machine
            first.
          </p>
        )}
        {isSerial ? <Ports /> : <Virtual />}
        <div class="dialog-foot">
          {why && <p class="hint">{why}</p>}
          <button type="submit" class="button primary big" disabled={why !== null}>
            Connect
          </button>
        </div>
      </form>
    </PanelDialog>
  );
}
