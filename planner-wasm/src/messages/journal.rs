//! What a print's journal says, for those who ask whether to go on with it.

use printer::{
    interruption::Interruption,
    journal::Journal,
    transform::{Skew, TransformRecord},
};
use serde::{Deserialize, Serialize};

/// A journal, as far as it could be read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct JournalView {
    /// The print's own number.
    pub print: u32,
    /// It came to its end, one way or another.
    pub has_ended: bool,
    /// The board that was asked about holds this very print.
    pub is_held: bool,
    /// The line of the last move that was seen to be made; 0 where none was.
    pub line: u32,
    /// Print time then, in s.
    pub elapsed_s: f64,
    /// How many bytes could be read; what follows them was torn off or damaged.
    pub readable_bytes: u32,
}

impl JournalView {
    /// Of a journal; `held` is the number under which a board holds a print.
    pub fn of(journal: &Journal, held: Option<u32>) -> Self {
        let (line, elapsed) = journal.progress.unwrap_or_default();
        Self {
            print: journal.print,
            has_ended: journal.has_ended,
            is_held: held.is_some_and(|id| journal.knows(id)),
            line,
            elapsed_s: elapsed.0,
            // A journal is not read beyond 64 MiB.
            readable_bytes: journal.bytes as u32,
        }
    }
}

/// Where a print was when it was interrupted, for those who go on with it from a line after its board has lost everything.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct InterruptionView {
    /// The line of the last move that is known to have been made, 0 where none is.
    pub line: u32,
    /// The line to begin with (`JobRequest.start_line`): nothing is left out, and some seconds may be made twice.
    pub start_line: u32,
    /// It has not got beyond this line.
    pub reach_line: u32,
    /// Print time at `line`.
    pub elapsed_s: f64,
    /// The layer of the line, counted from 1.
    pub layer: u32,
    /// That layer's height.
    pub layer_z_mm: f64,
    /// The line with which that layer begins.
    pub layer_line: u32,
    /// Where the lines have the nozzle at the end of `line`.
    pub position_mm: [f64; 3],
    /// The lowest and highest Z at which the power may have gone; `null` where Z was being moved by hand or homed.
    pub z_range_mm: Option<[f64; 2]>,
    /// Where Z can stand once its motor has current again, the likeliest first: one of them is to be claimed
    /// (`set-position`). Empty where nothing can be said.
    pub z_places_mm: Vec<f64>,
    /// How far such places are apart: whoever has measured Z takes the nearest.
    pub z_pitch_mm: f64,
    /// How far off the right place is at most. Where there is none: how far from `z_range_mm` Z may stand.
    pub z_error_mm: f64,
    /// The factors that held, for `set-speed-factor` and `set-flow-factor`.
    pub speed_factor: f64,
    /// See `speed_factor`.
    pub flow_factor: f64,
    /// What made up for skew and bed before the file's first line, loaded by hand: for `JobRequest.transform`.
    pub transform: TransformView,
}

/// What makes up for skew and bed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct TransformView {
    /// The name of the bed's mesh (`[bed_mesh NAME]`); `null` without one.
    pub mesh: Option<String>,
    /// How far Y leans in X, Z in X and Z in Y, in mm/mm.
    pub skew: [f64; 3],
}

impl From<TransformView> for TransformRecord {
    fn from(view: TransformView) -> Self {
        let [xy, xz, yz] = view.skew;
        Self { skew: Skew { xy, xz, yz }, mesh: view.mesh }
    }
}

impl From<TransformRecord> for TransformView {
    fn from(record: TransformRecord) -> Self {
        let Skew { xy, xz, yz } = record.skew;
        Self { mesh: record.mesh, skew: [xy, xz, yz] }
    }
}

impl From<&Interruption> for InterruptionView {
    fn from(found: &Interruption) -> Self {
        let [speed_factor, flow_factor] = found.factors;
        Self {
            line: found.line,
            start_line: found.start_line,
            reach_line: found.reach_line,
            elapsed_s: found.elapsed.0,
            layer: found.layer,
            layer_z_mm: found.layer_z.0,
            layer_line: found.layer_line,
            position_mm: found.position.map(|mm| mm.0),
            z_range_mm: found.z_range.map(|range| range.map(|mm| mm.0)),
            z_places_mm: found.standings.places.iter().map(|mm| mm.0).collect(),
            z_pitch_mm: found.standings.pitch.0,
            z_error_mm: found.standings.error.0,
            speed_factor,
            flow_factor,
            transform: found.transform.clone().into(),
        }
    }
}
