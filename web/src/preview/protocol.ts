// What the page and the preview worker say to each other. Shapes only.
import type { HeaterName, Trouble } from '../machine/protocol';
import type { Celsius, Mm, Seconds } from '../units';

export type Severity = 'info' | 'warning' | 'blocking' | 'error';

/** A remark on a line of a file; line 0 is the file as a whole. */
export interface Remark {
  readonly line: number;
  readonly severity: Severity;
  readonly text: string;
}

export interface Layer {
  /** The layer's first vertex. */
  readonly first: number;
  readonly z: Mm;
  /** A print that begins with this line makes the whole layer; 1 for the first. */
  readonly line: number;
  readonly time: Seconds;
}

export interface FeatureShare {
  /** The feature's number in the vertices. */
  readonly feature: number;
  readonly time: Seconds;
  readonly filament: Mm;
}

/** An object that a file names. */
export interface ObjectShare {
  readonly name: string;
  /** Its middle on the bed, in G-code's coordinates, where the file gives it. */
  readonly centre: readonly [Mm, Mm] | null;
  readonly filament: Mm;
}

export interface ToolShare {
  /** The tool's number in the vertices. */
  readonly tool: number;
  readonly filament: Mm;
}

/** A picture of the print that its slicer put into the file. */
export interface Thumbnail {
  /** PNG or JPEG. */
  readonly picture: Blob;
  /** In pixels. */
  readonly width: number;
  readonly height: number;
}

/** What a file amounts to on the machine that was given. */
export interface Summary {
  readonly errors: readonly Trouble[];
  /** Lines that somebody has to confirm before they are passed over. */
  readonly blocking: readonly Remark[];
  readonly remarks: readonly Remark[];
  /** Findings beyond those kept. */
  readonly dropped: number;
  readonly lines: number;
  readonly moves: number;
  readonly filament: Mm;
  readonly bounds: { readonly min: readonly [Mm, Mm, Mm]; readonly max: readonly [Mm, Mm, Mm] } | null;
  readonly vertices: number;
  readonly layers: readonly Layer[];
  /** From the planner; null where the machine is not known. */
  readonly time: Seconds | null;
  readonly features: readonly FeatureShare[];
  /** The first has number 1 in the vertices. */
  readonly objects: readonly ObjectShare[];
  /** Those that lay filament. */
  readonly tools: readonly ToolShare[];
  /** Moves that are not shown: there are more than the view can hold. */
  readonly leftOut: number;
  /** Places so far off the machine that they are shown nearer. */
  readonly clamped: number;
  /** The program that wrote the file, where it says so. */
  readonly generator: string | null;
}

export interface HeaterLimits {
  readonly name: HeaterName;
  readonly max: Celsius;
  /** Filament may be pushed from here on; null for beds. */
  readonly extrudeMin: Celsius | null;
}

export interface MachineAxis {
  readonly name: string;
  readonly min: Mm;
  readonly max: Mm;
}

/** A bed's shape as it was measured. */
export interface MachineMesh {
  readonly name: string;
  /** X and Y of the first point. */
  readonly origin: readonly [Mm, Mm];
  /** From point to point along X and along Y. */
  readonly step: readonly [Mm, Mm];
  /** Row by row, the lowest Y first. */
  readonly rows: readonly (readonly Mm[])[];
}

/** What a printer.cfg describes. */
export interface MachineSummary {
  readonly axes: readonly MachineAxis[];
  /** How far the head reaches from the middle of a round bed; null where it is not round. */
  readonly bedRadius: Mm | null;
  /** Those that a print may load. */
  readonly meshes: readonly MachineMesh[];
  readonly heaters: readonly HeaterLimits[];
  /** The longest push of filament at once; null where the file sets none. */
  readonly extrudeMax: Mm | null;
  /** mm/s of filament alone. */
  readonly extrudeSpeedMax: number | null;
  readonly hasFan: boolean;
  /** The filament's diameter; null where the file sets none. */
  readonly filament: Mm | null;
  /** For boards on a UART. */
  readonly baud: number;
}

export interface ConfigReport {
  readonly remarks: readonly Remark[];
  /** Null where the text does not describe a machine that can be driven. */
  readonly machine: MachineSummary | null;
}

export interface VertexHeader {
  readonly originMm: readonly [number, number, number];
  readonly stepMm: number;
}

export type ToPreview =
  | {
      readonly kind: 'open';
      readonly job: number;
      readonly file: Blob;
      readonly name: string;
      readonly config: string | null;
    }
  /** The outline is shown: the planner may have the processor. */
  | { readonly kind: 'plan'; readonly job: number }
  /** Nothing is to be read any more, or shown of what was. */
  | { readonly kind: 'close'; readonly job: number }
  /** Where the geometry goes: requests of the 3D view, each with its job, past the page's main thread. */
  | { readonly kind: 'draw'; readonly port: MessagePort }
  /** Asks for lines of the open file, as far as it has been read; what was asked before is of no interest any more. */
  | {
      readonly kind: 'text';
      readonly id: number;
      readonly job: number;
      readonly first: number;
      readonly last: number;
    }
  | { readonly kind: 'check-config'; readonly id: number; readonly text: string }
  /** Asks for lines of a file; what was asked before is of no interest any more. */
  | {
      readonly kind: 'lines';
      readonly id: number;
      readonly file: Blob;
      readonly first: number;
      readonly last: number;
    };

export type FromPreview =
  | { readonly kind: 'loaded' }
  | { readonly kind: 'failed'; readonly job: number | null; readonly trouble: Trouble }
  /**
   * Where lines lie on the path, in order. `marks`: pairs of a line and the vertex where its segment ends, some dozens of vertices
   * apart. `steps`: one byte a vertex, how many lines further than the one before it it comes from; 255 where a mark says.
   */
  | {
      readonly kind: 'places';
      readonly job: number;
      readonly marks: readonly Uint32Array<ArrayBuffer>[];
      readonly steps: readonly Uint8Array<ArrayBuffer>[];
    }
  | { readonly kind: 'thumbnails'; readonly job: number; readonly thumbnails: readonly Thumbnail[] }
  /** The file is packed and too large to be kept unpacked: any look at its text reads it from its beginning. */
  | { readonly kind: 'slow-text'; readonly job: number }
  | { readonly kind: 'progress'; readonly job: number; readonly share: number; readonly lines: number }
  /** The geometry is whole: the summary without times, and without what the machine cannot do. */
  | { readonly kind: 'outline'; readonly job: number; readonly outline: Summary }
  | { readonly kind: 'summary'; readonly job: number; readonly summary: Summary }
  /** Fewer where the file ends before; none where it cannot be read. */
  | { readonly kind: 'lines'; readonly id: number; readonly texts: readonly string[] }
  /** Answers `text`; fewer where the file ends before, none where another question came meanwhile. */
  | { readonly kind: 'text'; readonly id: number; readonly texts: readonly string[] }
  | { readonly kind: 'config'; readonly id: number; readonly report: ConfigReport };
