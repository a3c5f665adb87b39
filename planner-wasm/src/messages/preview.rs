//! What a file holds.

use gcode::{Diagnostic, FileKind, Severity};
use printer::preview::PreviewReport;
use serde::Serialize;

use super::ErrorMessage;

/// How much a remark matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum FindingSeverity {
    /// The print comes out as meant.
    Info,
    /// Acted upon, though perhaps not as meant.
    Warning,
    /// Skipped, and may have mattered: the user has to confirm this line.
    Blocking,
    /// Wrong: the file cannot be printed as it is.
    Error,
}

/// One remark about a line of G-code.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct Finding {
    /// Counted from 1.
    pub line: u32,
    /// Bytes of the line, counted from 0: the first, and the one behind the last.
    pub columns: [u32; 2],
    /// How much it matters.
    pub severity: FindingSeverity,
    /// A stable name.
    pub code: String,
    /// What is wrong and what to do about it.
    pub message: String,
}

impl From<&Diagnostic> for Finding {
    fn from(diagnostic: &Diagnostic) -> Self {
        let severity = match diagnostic.severity {
            Severity::Info => FindingSeverity::Info,
            Severity::Warning => FindingSeverity::Warning,
            Severity::Blocking => FindingSeverity::Blocking,
            Severity::Error => FindingSeverity::Error,
        };
        Self {
            line: diagnostic.line.0,
            columns: [diagnostic.columns.start, diagnostic.columns.end],
            severity,
            code: diagnostic.code.as_str().to_owned(),
            message: diagnostic.message.clone(),
        }
    }
}

/// A line that has to be confirmed.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct Blocking {
    /// Which one.
    pub line: u32,
    /// Why.
    pub message: String,
}

/// A layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct LayerSummary {
    /// Its first vertex.
    pub first_vertex: u32,
    /// Its first line, for `JobRequest.start_line`: a print that begins there makes the whole layer and nothing of those
    /// before. 1 for the first layer.
    pub first_line: u32,
    /// The nozzle's height at its first extrusion.
    pub z_mm: f64,
    /// Print time; 0 without a machine.
    pub time_s: f64,
}

/// What a kind of extrusion takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct FeatureSummary {
    /// Its number in the vertices.
    pub feature: u8,
    /// Print time; 0 without a machine.
    pub time_s: f64,
    /// Filament laid.
    pub filament_mm: f64,
}

/// An object that the file names.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct ObjectSummary {
    /// As the file calls it.
    pub name: String,
    /// Its middle on the bed, in G-code's coordinates, where the file gives it.
    pub centre_mm: Option<[f64; 2]>,
    /// Filament laid for it.
    pub filament_mm: f64,
}

/// What is printed by one tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct ToolSummary {
    /// Its number in the vertices.
    pub tool: u8,
    /// Filament laid.
    pub filament_mm: f64,
}

/// What a file holds, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct PreviewSummary {
    /// Whether it can be printed once the blocking lines have been confirmed.
    pub printable: bool,
    /// What makes it unprintable.
    pub errors: Vec<ErrorMessage>,
    /// Lines to be confirmed.
    pub blocking: Vec<Blocking>,
    /// All remarks.
    pub findings: Vec<Finding>,
    /// Remarks beyond those listed.
    pub dropped: u64,
    /// Lines in the file.
    pub lines: u32,
    /// Moves, the pieces of arcs among them.
    pub moves: u64,
    /// Filament pushed less filament pulled back.
    pub filament_mm: f64,
    /// The lowest and highest X, Y, Z reached while extruding.
    pub bounds_mm: Option<[[f64; 3]; 2]>,
    /// Vertices, all together.
    pub vertices: u32,
    /// Places that lay outside the vertices' range and were moved to its edge.
    pub clamped: u64,
    /// Vertices beyond what can be shown, which are left out.
    pub left_out: u64,
    /// Layers; those beyond 65 536 are part of the last.
    pub layers: Vec<LayerSummary>,
    /// The kinds of extrusion that occur.
    pub features: Vec<FeatureSummary>,
    /// The objects that the file names, at most 254; the first has number 1 in the vertices.
    pub objects: Vec<ObjectSummary>,
    /// The tools that lay filament.
    pub tools: Vec<ToolSummary>,
    /// Print time of the whole, planned for the machine; `null` without one, or where the plan fails.
    pub print_time_s: Option<f64>,
    /// Of it, moving without extruding, and waiting where the file says so.
    pub travel_time_s: f64,
    /// What the slicer thought.
    pub slicer_time_s: Option<f64>,
    /// The slicer.
    pub generator: Option<String>,
}

impl PreviewSummary {
    /// The page's view of a report.
    pub fn of(report: PreviewReport) -> Self {
        let printable = report.check.is_printable();
        let check = report.check;
        let layers = report.layers.iter().map(|layer| LayerSummary {
            first_vertex: layer.first_vertex,
            first_line: layer.first_line,
            z_mm: layer.z.0,
            time_s: layer.time.0,
        });
        let features = report.features.iter().map(|feature| FeatureSummary {
            feature: feature.feature,
            time_s: feature.time.0,
            filament_mm: feature.filament.0,
        });
        let objects = report.objects.into_iter().map(|object| ObjectSummary {
            name: object.name,
            centre_mm: object.centre_mm,
            filament_mm: object.filament.0,
        });
        let tools =
            report.tools.iter().map(|tool| ToolSummary { tool: tool.tool, filament_mm: tool.filament.0 });
        Self {
            printable,
            errors: check.errors.iter().map(ErrorMessage::from).collect(),
            blocking: check
                .blocking
                .into_iter()
                .map(|blocking| Blocking { line: blocking.line, message: blocking.message })
                .collect(),
            findings: check.diagnostics.iter().map(Finding::from).collect(),
            dropped: check.dropped,
            lines: check.lines,
            moves: check.moves,
            filament_mm: check.filament_mm,
            bounds_mm: check.bounds_mm,
            vertices: report.vertices,
            clamped: report.clamped,
            left_out: report.left_out,
            layers: layers.collect(),
            features: features.collect(),
            objects: objects.collect(),
            tools: tools.collect(),
            print_time_s: report.print_time.map(|time| time.0),
            travel_time_s: report.travel_time.0,
            slicer_time_s: report.slicer_time.map(|time| time.0),
            generator: report.generator,
        }
    }
}

/// What a file is, from its first bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct FileKindReport {
    /// A stable name.
    #[cfg_attr(
        feature = "bindings",
        ts(
            type = "'gcode' | 'gzip' | 'binary-gcode' | '3mf' | 'stl' | 'zip' | 'other-text' | 'other-binary' | 'empty'"
        )
    )]
    pub kind: String,
    /// What to do instead; `null` for what can be read (gzip once it is unpacked).
    pub advice: Option<String>,
}

impl From<FileKind> for FileKindReport {
    fn from(kind: FileKind) -> Self {
        Self { kind: kind.as_str().to_owned(), advice: kind.advice().map(str::to_owned) }
    }
}
