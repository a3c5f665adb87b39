// The planner's session and virtual printer for the machine worker: the generated WebAssembly behind the page's types.
// The one place that knows the planner's messages about machines.
import type { InterruptionView } from '../bindings/InterruptionView';
import type { JobRequest } from '../bindings/JobRequest';
import type { JournalView } from '../bindings/JournalView';
import type { Snapshot as PlannerSnapshot } from '../bindings/Snapshot';
import type { UiEvent } from '../bindings/UiEvent';
import type { UiRequest } from '../bindings/UiRequest';
import type { VirtualState } from '../bindings/VirtualState';
import initialise, {
  Survey as PlannerSurvey,
  PrinterSession,
  read_journal,
  VirtualPrinter,
} from '../bindings/wasm/planner_wasm.js';
import { inWords, plannerTrouble } from '../planner_error';
import { NO_LINE_ERRORS } from '../transport/transport';
import { celsius, type Mm, mm, type Seconds, seconds, share } from '../units';
import type { Axis, Interruption, MachineEvent, PrintStart, Snapshot, Trouble, Wish } from './protocol';
import type { JournalSummary, Session, SessionSnapshot, SimulatedPrinter, Survey } from './session';

/** Speeds of moves by hand, mm/s; the machine's own limits hold besides. */
const JOG_SPEED: Record<Axis, number> = { X: 100, Y: 100, Z: 10 };
const AXES = ['X', 'Y', 'Z'] as const;

const lower = (axis: Axis): 'x' | 'y' | 'z' => axis.toLowerCase() as 'x' | 'y' | 'z';

export interface Planner {
  /** Throws what `asTrouble` understands where the machine's file has errors. */
  openSession(config: string, now: Seconds): Session;
  /** For the printer that `powerUp` makes from the same file and board. */
  openVirtualSession(config: string, board: string, now: Seconds): Session;
  powerUp(config: string, board: string, seed: number, faults: string): SimulatedPrinter;
  /** Null where it cannot be read. `held` is what a session's `heldPrint` gave. */
  readJournal(journal: Uint8Array, held: number | null): JournalSummary | null;
  /** Of a print's journal and the machine's file as it was then. Throws, as it does later, what `asTrouble` understands. */
  survey(config: string, journal: Uint8Array): Survey;
  /** The planner's error, or null where something else was thrown. */
  asTrouble(error: unknown): Trouble | null;
}

export async function loadPlanner(): Promise<Planner> {
  await initialise();
  return {
    openSession: (config, now) => new WasmSession(new PrinterSession(config, now)),
    openVirtualSession: (config, board, now) =>
      new WasmSession(PrinterSession.for_virtual_printer(config, board, now)),
    powerUp: (config, board, seed, faults) => new WasmPrinter(config, board, seed, faults),
    readJournal: (journal, held) => {
      const text = read_journal(journal, held ?? undefined);
      return text === undefined ? null : fromJournal(JSON.parse(text) as JournalView);
    },
    survey: (config, journal) => new WasmSurvey(new PlannerSurvey(config, journal)),
    asTrouble: plannerTrouble,
  };
}

const fromInterruption = (view: InterruptionView): Interruption => ({
  line: view.line,
  startLine: view.start_line,
  reachLine: view.reach_line,
  layer: view.layer,
  layerZ: mm(view.layer_z_mm),
  layerLine: view.layer_line,
  zRange: view.z_range_mm && [mm(view.z_range_mm[0]), mm(view.z_range_mm[1])],
  zPlaces: view.z_places_mm.map(mm),
  zPitch: mm(view.z_pitch_mm),
  zError: mm(view.z_error_mm),
  speedFactor: share(view.speed_factor),
  flowFactor: share(view.flow_factor),
  transform: view.transform,
});

const fromJournal = (view: JournalView): JournalSummary => ({
  number: view.print,
  hasEnded: view.has_ended,
  isHeld: view.is_held,
  line: view.line,
  elapsed: seconds(view.elapsed_s),
  readableBytes: Number(view.readable_bytes),
});

/** Runs what may be refused. */
function refusal(act: () => void): Trouble | null {
  try {
    act();
    return null;
  } catch (error) {
    const trouble = plannerTrouble(error);
    if (trouble) return trouble;
    throw error;
  }
}

function toRequest(wish: Wish): UiRequest {
  switch (wish.kind) {
    case 'gcode':
      return { type: 'gcode', text: wish.text };
    case 'home':
      return { type: 'home', axes: wish.axes.map(lower) };
    case 'jog':
      return {
        type: 'jog',
        axis: lower(wish.axis),
        distance_mm: wish.distance,
        speed_mm_s: JOG_SPEED[wish.axis],
      };
    case 'set-position':
      return { type: 'set-position', axis: lower(wish.axis), position_mm: wish.position };
    case 'extrude':
      return { type: 'extrude', length_mm: wish.length, speed_mm_s: wish.speed };
    case 'temperature':
      return { type: 'set-temperature', heater: wish.heater, target_c: wish.target };
    case 'fan':
      return { type: 'set-fan', speed: wish.value };
    case 'speed-factor':
      return { type: 'set-speed-factor', factor: wish.value };
    case 'flow-factor':
      return { type: 'set-flow-factor', factor: wish.value };
    default:
      return { type: wish.kind };
  }
}

/** An event in the page's words; null for what the snapshot tells as well. */
function fromEvent(event: UiEvent): MachineEvent | null {
  switch (event.type) {
    case 'phase':
      return { kind: 'phase', phase: event.phase };
    case 'identified':
      return { kind: 'identified', version: event.version, mcu: event.mcu };
    case 'homed':
      return { kind: 'homed', axis: AXES[event.axis] ?? 'X', position: mm(event.position_mm) };
    case 'message':
      return { kind: 'message', text: event.text };
    case 'notice':
      return {
        kind: 'notice',
        line: event.finding.line,
        severity: event.finding.severity,
        text: event.finding.message,
      };
    case 'paused':
    case 'resumed':
      return { kind: event.type };
    case 'job-done':
      return { kind: 'done' };
    case 'job-cancelled':
      return { kind: 'cancelled' };
    case 'held':
      return { kind: 'held', trouble: inWords(event.error) };
    case 'error':
      return { kind: 'trouble', trouble: inWords(event.error) };
    case 'dropped':
      return { kind: 'dropped', count: Number(event.count) };
    case 'temperature':
    case 'progress':
      return null;
  }
}

type Place = readonly [number, number, number, number];
const place = ([x, y, z, e]: Place): NonNullable<Snapshot['position']> => [mm(x), mm(y), mm(z), mm(e)];

const point = ([x, y, z]: readonly [number, number, number]): readonly [Mm, Mm, Mm] => [mm(x), mm(y), mm(z)];

function fromSnapshot(now: PlannerSnapshot): SessionSnapshot {
  const position = now.live_mm ?? now.position_mm;
  const { link } = now;
  return {
    phase: now.phase,
    heaters: now.temperatures.map((heater) => ({
      name: heater.heater,
      temperature: celsius(heater.temperature_c),
      target: celsius(heater.target_c),
      duty: share(heater.duty),
      isStandby: heater.standby,
    })),
    position: position && place(position),
    zLift: mm(now.z_lift_mm),
    mesh: now.mesh,
    homed: now.homed,
    job: now.job.status,
    start: now.job.start && {
      line: now.job.start.line,
      position: point(now.job.start.position_mm),
      clearZ: mm(now.job.start.clear_z_mm),
      nozzle: celsius(now.job.start.nozzle_c),
      bed: celsius(now.job.start.bed_c),
    },
    line: now.job.line,
    elapsed: seconds(now.job.elapsed_s),
    queued: now.queued_s === null ? null : seconds(now.queued_s),
    queuedLeast: now.job.queued_least_s === null ? null : seconds(now.job.queued_least_s),
    speedFactor: share(now.speed_factor),
    flowFactor: share(now.flow_factor),
    fan: share(now.fan),
    link: link && {
      bytesSent: Number(link.sent_bytes),
      bytesReceived: Number(link.received_bytes),
      bytesRetransmitted: Number(link.retransmitted_bytes),
      timeouts: Number(link.timeouts),
      roundTrip: link.round_trip_s === null ? null : seconds(link.round_trip_s),
      lineErrors: NO_LINE_ERRORS,
    },
  };
}

class WasmSession implements Session {
  readonly #inner: PrinterSession;

  constructor(inner: PrinterSession) {
    this.#inner = inner;
  }

  receive(bytes: Uint8Array, now: Seconds): void {
    this.#inner.receive(bytes, now);
  }

  poll(now: Seconds): Uint8Array<ArrayBuffer> {
    return this.#inner.poll(now) as Uint8Array<ArrayBuffer>;
  }

  wake(): Seconds {
    return seconds(this.#inner.wake_s());
  }

  takeEvents(): MachineEvent[] {
    const text = this.#inner.take_events();
    if (text === '[]') return [];
    const events = JSON.parse(text) as UiEvent[];
    return events.flatMap((event) => fromEvent(event) ?? []);
  }

  wish(wish: Wish, now: Seconds): Trouble | null {
    return refusal(() => this.#inner.request(JSON.stringify(toRequest(wish)), now));
  }

  startJob(
    { confirmedLines, line, transform }: PrintStart,
    journal: number | null,
    now: Seconds,
  ): Trouble | null {
    const isAll = confirmedLines === 'all';
    const request: JobRequest = {
      confirmed_lines: isAll ? [] : [...confirmedLines],
      confirm_all: isAll,
      journal,
      start_line: line,
      ...(transform && { transform: { mesh: transform.mesh, skew: [...transform.skew] } }),
    };
    return refusal(() => this.#inner.start_job(JSON.stringify(request), now));
  }

  takeJournal(): string {
    return this.#inner.take_journal();
  }

  heldPrint(): number | null {
    return this.#inner.held_print() ?? null;
  }

  takeUp(journal: Uint8Array): Trouble | null {
    return refusal(() => this.#inner.take_up(journal));
  }

  jobWants(): number {
    return this.#inner.job_wants();
  }

  jobFeed(bytes: Uint8Array): void {
    this.#inner.job_feed(bytes);
  }

  jobEnd(): void {
    this.#inner.job_end();
  }

  plannedSpeed(now: Seconds, behind: Seconds, ahead: Seconds): Float64Array<ArrayBuffer> {
    return this.#inner.planned_speed(now, behind, ahead) as Float64Array<ArrayBuffer>;
  }

  snapshot(now: Seconds): SessionSnapshot {
    return fromSnapshot(JSON.parse(this.#inner.snapshot(now)) as PlannerSnapshot);
  }

  free(): void {
    this.#inner.free();
  }
}

class WasmSurvey implements Survey {
  readonly #inner: PlannerSurvey;

  constructor(inner: PlannerSurvey) {
    this.#inner = inner;
  }

  wants(): number {
    return this.#inner.wants();
  }

  feed(bytes: Uint8Array): void {
    this.#inner.feed(bytes);
    this.#advance();
  }

  end(): void {
    this.#inner.finish();
    this.#advance();
  }

  #advance(): void {
    while (this.#inner.advance());
  }

  report(): Interruption | null {
    const text = this.#inner.report();
    return text === undefined ? null : fromInterruption(JSON.parse(text) as InterruptionView);
  }

  free(): void {
    this.#inner.free();
  }
}

class WasmPrinter implements SimulatedPrinter {
  readonly #inner: VirtualPrinter;

  constructor(config: string, board: string, seed: number, faults: string) {
    this.#inner = new VirtualPrinter(config, board, seed, faults);
  }

  now(): Seconds {
    return seconds(this.#inner.now_s());
  }

  write(bytes: Uint8Array): void {
    this.#inner.write(bytes);
  }

  runUntil(until: Seconds): Uint8Array<ArrayBuffer> {
    return this.#inner.run_until_s(until) as Uint8Array<ArrayBuffer>;
  }

  record(): VirtualState {
    return JSON.parse(this.#inner.state()) as VirtualState;
  }

  free(): void {
    this.#inner.free();
  }
}
