// The planner's preview and configuration check for the preview worker: the generated WebAssembly behind the page's
// types. The one place that knows the planner's messages about files.
import type { ConfigReport as PlannerConfigReport } from '../bindings/ConfigReport';
import type { FileKindReport } from '../bindings/FileKindReport';
import type { PreviewSummary } from '../bindings/PreviewSummary';
import initialise, { file_kind, Preview, parse_config } from '../bindings/wasm/planner_wasm.js';
import type { Trouble } from '../machine/protocol';
import { notGcode } from '../machine/troubles';
import { inWords, plannerTrouble } from '../planner_error';
import { celsius, mm, seconds } from '../units';
import type { ConfigReport, Summary, Thumbnail, VertexHeader } from './protocol';

/** A file being read. */
export interface FilePreview {
  /** How many bytes may be fed now; all are wanted again once there are no vertices to take. */
  wants(): number;
  feed(chunk: Uint8Array): void;
  finish(): void;
  header(): VertexHeader;
  /** Works on what was fed; the vertices that came of it, none when all is done. The array is the caller's. */
  takeVertices(): Uint32Array<ArrayBuffer>;
  /** Pairs of a line and the vertex where its segment ends, new since last time. */
  takeMarks(): Uint32Array<ArrayBuffer>;
  /** How many lines further than the one before it each vertex comes from, new since last time; 255 where a mark says. */
  takeLineSteps(): Uint8Array<ArrayBuffer>;
  /** The file's pictures of the print, new since last time. */
  takeThumbnails(): readonly Thumbnail[];
  /** What the planner knows of the vertices, in their order, later than they come; new since last time. */
  takeChannels(): Uint32Array<ArrayBuffer>;
  /** Works on what was fed for channels and summary alone: in place of taking vertices. */
  readOn(): void;
  /** After `finish`. */
  summary(): Summary;
  free(): void;
}

export interface Reader {
  preview(config: string | null): FilePreview;
  /** The geometry alone, in a fraction of the time; its summary has no times, and not what the machine cannot do. */
  outline(config: string): FilePreview;
  checkConfig(text: string): ConfigReport;
  /** What stands against reading a file as G-code, judged by its first bytes; null where nothing does. */
  refuse(head: Uint8Array, name: string): Trouble | null;
  asTrouble(error: unknown): Trouble | null;
}

export async function loadReader(): Promise<Reader> {
  await initialise();
  return {
    preview: (config) => {
      const preview = new Preview(config ?? undefined);
      if (config !== null) preview.want_channels();
      return new WasmPreview(preview);
    },
    outline: (config) => new WasmPreview(Preview.outline(config)),
    checkConfig,
    refuse,
    asTrouble: plannerTrouble,
  };
}

/** So much of a file says what it is. */
const HEAD_BYTES = 4096;

function refuse(head: Uint8Array, name: string): Trouble | null {
  const { advice } = JSON.parse(file_kind(head.subarray(0, HEAD_BYTES), name)) as FileKindReport;
  return advice === null ? null : notGcode(advice);
}

const AXES = ['X', 'Y', 'Z'] as const;

function checkConfig(text: string): ConfigReport {
  const report = JSON.parse(parse_config(text)) as PlannerConfigReport;
  const { machine } = report;
  return {
    remarks: report.findings.map(({ line, severity, message }) => ({ line, severity, text: message })),
    machine: machine && {
      axes: AXES.map((name, axis) => ({
        name,
        min: mm(machine.min_mm[axis] ?? 0),
        max: mm(machine.max_mm[axis] ?? 0),
      })),
      bedRadius: machine.bed_radius_mm === null ? null : mm(machine.bed_radius_mm),
      meshes: machine.meshes.map(({ name, min_mm, step_mm, heights_mm }) => ({
        name,
        origin: [mm(min_mm[0]), mm(min_mm[1])],
        step: [mm(step_mm[0]), mm(step_mm[1])],
        rows: heights_mm.map((row) => row.map(mm)),
      })),
      heaters: machine.heaters.map(({ name, max_c, min_extrude_c }) => ({
        name,
        max: celsius(max_c),
        extrudeMin: min_extrude_c === null ? null : celsius(min_extrude_c),
      })),
      extrudeMax: machine.max_extrude_mm === null ? null : mm(machine.max_extrude_mm),
      extrudeSpeedMax: machine.max_extrude_velocity_mm_s,
      hasFan: machine.has_fan,
      filament: machine.filament_mm === null ? null : mm(machine.filament_mm),
      baud: machine.baud,
    },
  };
}

type Corner = readonly [number, number, number];
const corner = ([x, y, z]: Corner) => [mm(x), mm(y), mm(z)] as const;

function fromSummary(summary: PreviewSummary): Summary {
  const bounds = summary.bounds_mm;
  return {
    errors: summary.errors.map(inWords),
    blocking: summary.blocking.map(({ line, message }) => ({ line, severity: 'blocking', text: message })),
    remarks: summary.findings.map(({ line, severity, message }) => ({ line, severity, text: message })),
    dropped: Number(summary.dropped),
    lines: summary.lines,
    moves: Number(summary.moves),
    filament: mm(summary.filament_mm),
    bounds: bounds && { min: corner(bounds[0]), max: corner(bounds[1]) },
    vertices: summary.vertices,
    layers: summary.layers.map(({ first_vertex, first_line, z_mm, time_s }) => ({
      first: first_vertex,
      z: mm(z_mm),
      line: first_line,
      time: seconds(time_s),
    })),
    time: summary.print_time_s === null ? null : seconds(summary.print_time_s),
    features: summary.features.map(({ feature, time_s, filament_mm }) => ({
      feature,
      time: seconds(time_s),
      filament: mm(filament_mm),
    })),
    objects: summary.objects.map(({ name, centre_mm, filament_mm }) => ({
      name,
      centre: centre_mm && [mm(centre_mm[0]), mm(centre_mm[1])],
      filament: mm(filament_mm),
    })),
    tools: summary.tools.map(({ tool, filament_mm }) => ({ tool, filament: mm(filament_mm) })),
    leftOut: Number(summary.left_out),
    clamped: Number(summary.clamped),
    generator: summary.generator,
  };
}

class WasmPreview implements FilePreview {
  readonly #inner: Preview;

  constructor(inner: Preview) {
    this.#inner = inner;
  }

  wants(): number {
    return this.#inner.wants();
  }

  feed(chunk: Uint8Array): void {
    this.#inner.feed(chunk);
  }

  finish(): void {
    this.#inner.finish();
  }

  header(): VertexHeader {
    const [x = 0, y = 0, z = 0] = this.#inner.origin_mm;
    return { originMm: [x, y, z], stepMm: this.#inner.step_mm };
  }

  takeVertices(): Uint32Array<ArrayBuffer> {
    return this.#inner.take_vertices() as Uint32Array<ArrayBuffer>;
  }

  takeMarks(): Uint32Array<ArrayBuffer> {
    return this.#inner.take_marks() as Uint32Array<ArrayBuffer>;
  }

  takeLineSteps(): Uint8Array<ArrayBuffer> {
    return this.#inner.take_line_steps() as Uint8Array<ArrayBuffer>;
  }

  takeThumbnails(): readonly Thumbnail[] {
    return this.#inner.take_thumbnails().map((thumbnail) => {
      const { mime, width, height } = thumbnail;
      const picture = new Blob([thumbnail.bytes as Uint8Array<ArrayBuffer>], { type: mime });
      thumbnail.free();
      return { picture, width, height };
    });
  }

  takeChannels(): Uint32Array<ArrayBuffer> {
    return this.#inner.take_channels() as Uint32Array<ArrayBuffer>;
  }

  readOn(): void {
    this.#inner.read_on();
  }

  summary(): Summary {
    return fromSummary(JSON.parse(this.#inner.summary()) as PreviewSummary);
  }

  free(): void {
    this.#inner.free();
  }
}
