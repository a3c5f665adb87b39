//! A session at a moment.

use printer::{
    link::LinkStats,
    session::{JobStatus, PendingStart},
};
use serde::Serialize;

use super::{ErrorMessage, HeaterName, PhaseLabel};

/// Everything that a panel shows, at a moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct Snapshot {
    /// How far the connection is.
    pub phase: PhaseLabel,
    /// What ended the connection or stopped the board.
    pub error: Option<ErrorMessage>,
    /// The board, once it has said who it is.
    pub board: Option<BoardView>,
    /// Each heater that has been read.
    pub temperatures: Vec<TemperatureView>,
    /// Where the last planned move ends, in the G-code's coordinates: X, Y, Z and filament. `null` while it is not known.
    pub position_mm: Option<[f64; 4]>,
    /// Where the head is now, on the way there, in the same coordinates. `null` while it is not known.
    pub live_mm: Option<[f64; 4]>,
    /// How much higher Z's motor stands than `position_mm` has it, once it is there: what makes up for a bed that is not
    /// flat.
    pub z_lift_mm: f64,
    /// Which of X, Y, Z are homed; the position of the others means nothing.
    pub homed: [bool; 3],
    /// The print.
    pub job: JobView,
    /// Motion that the board has and has not made; `null` outside of a run.
    pub queued_s: Option<f64>,
    /// Of what is planned from now on, whoever set it: the page, or an `M220`. 1 is as written.
    pub speed_factor: f64,
    /// The same of the extrusion (`M221`).
    pub flow_factor: f64,
    /// The part fan, 0 … 1.
    pub fan: f64,
    /// Counts of the link.
    pub link: Option<LinkView>,
}

/// A board.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct BoardView {
    /// Its firmware's version.
    pub version: String,
    /// Its chip.
    pub mcu: String,
    /// Its clock.
    pub clock_freq_hz: f64,
}

/// A heater's last reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct TemperatureView {
    /// Which one.
    pub heater: HeaterName,
    /// What its sensor says.
    pub temperature_c: f64,
    /// 0 is off.
    pub target_c: f64,
    /// The share of time that it is on.
    pub duty: f64,
    /// The board has lowered it, or switched it off, because it was out of touch with its host.
    pub standby: bool,
}

/// What a job is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum JobPhase {
    /// There is none.
    None,
    /// It is being printed, or waits for a temperature.
    Printing,
    /// It comes to rest to be paused.
    Pausing,
    /// It is paused, at rest.
    Paused,
    /// It comes to rest to be ended.
    Ending,
    /// The board holds its motion at rest on the path until the user decides.
    Held,
}

impl From<JobStatus> for JobPhase {
    fn from(status: JobStatus) -> Self {
        match status {
            JobStatus::None => Self::None,
            JobStatus::Printing => Self::Printing,
            JobStatus::Pausing => Self::Pausing,
            JobStatus::Paused => Self::Paused,
            JobStatus::Ending => Self::Ending,
            JobStatus::Held => Self::Held,
        }
    }
}

/// A job; the numbers of the last one stay after its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct JobView {
    /// What it is doing.
    pub status: JobPhase,
    /// The line of the last move that has been made.
    pub line: u32,
    /// Print time so far.
    pub elapsed_s: f64,
    /// How much of its file has been taken; a double counts bytes exactly up to 2⁵³.
    pub fed_bytes: f64,
    /// The least motion that the board had since the print's start, while more of it was to come. `null` before there was
    /// any.
    pub queued_least_s: Option<f64>,
    /// It was started with a line in the middle of its file, is paused before that, and waits for the user: Z has to be
    /// known (`set-position`, or homed) before `resume`, which does everything else. `null` otherwise.
    pub start: Option<StartView>,
}

/// How a job begins that does not begin with its file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct StartView {
    /// The line with which it begins.
    pub line: u32,
    /// Where its lines have the head before it.
    pub position_mm: [f64; 3],
    /// The height over which the way there leads: above all that has been printed.
    pub clear_z_mm: f64,
    /// What `resume` heats the nozzle to, 0 where it stays off.
    pub nozzle_c: f64,
    /// The same of the bed.
    pub bed_c: f64,
}

impl From<PendingStart> for StartView {
    fn from(start: PendingStart) -> Self {
        let PendingStart { line, position, clear_z, targets: [nozzle, bed] } = start;
        Self { line, position_mm: position, clear_z_mm: clear_z, nozzle_c: nozzle.0, bed_c: bed.0 }
    }
}

/// Counts of a link since the connection began.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct LinkView {
    /// Everything handed to the port.
    pub sent_bytes: u64,
    /// Everything that came from it.
    pub received_bytes: u64,
    /// Of what was sent, what was sent again.
    pub retransmitted_bytes: u64,
    /// Times that something was sent again because no answer came.
    pub timeouts: u64,
    /// Stretches of received bytes that made no sense.
    pub garbage: u64,
    /// The smoothed round-trip time.
    pub round_trip_s: Option<f64>,
    /// The host's time of the last sound answer.
    pub last_received_s: Option<f64>,
}

impl From<LinkStats> for LinkView {
    fn from(stats: LinkStats) -> Self {
        Self {
            sent_bytes: stats.bytes_sent,
            received_bytes: stats.bytes_received,
            retransmitted_bytes: stats.bytes_retransmitted,
            timeouts: stats.timeouts,
            garbage: stats.garbage,
            round_trip_s: stats.round_trip.map(|time| time.0),
            last_received_s: stats.last_received.map(|time| time.0),
        }
    }
}
