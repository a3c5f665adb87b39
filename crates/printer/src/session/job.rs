//! A print: its G-code, how far it is, and what ends it.

use std::collections::BTreeSet;

use gcode::Settings;
use units::{Celsius, MmPerS, Seconds, Ticks};

use super::stream::Cut;
use crate::{
    error::PrinterError,
    planner::{Planner, Position, Skip, Source},
    transform::TransformRecord,
};

/// Going back to where a print was paused is done at this speed.
pub(super) const RETURN_FEED: MmPerS = MmPerS(50.0);
/// Progress is told no more often than this.
pub(super) const PROGRESS_INTERVAL: Seconds = Seconds(0.25);

/// What a job is started with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JobOptions {
    /// Lines with something blocking in them that the user has confirmed: they are passed over.
    pub confirmed_lines: BTreeSet<u32>,
    /// Confirm all of them.
    pub confirm_all: bool,
    /// The print's own number, with which a journal is kept ([`crate::journal`]). Any that no other print has; the next
    /// million belong to it too.
    pub journal: Option<u32>,
    /// The job begins with this line, as if those before it had been made: it is paused, until the machine is homed and
    /// the user resumes it.
    pub start_line: Option<u32>,
    /// What makes up for skew and bed when the file begins; without it, what is in force. Where a print goes on that was
    /// interrupted, that is [`crate::interruption::Interruption::transform`].
    pub transform: Option<TransformRecord>,
}

/// A job that begins in the middle of its file, and waits for the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PendingStart {
    /// The line with which it begins.
    pub line: u32,
    /// Where its lines have the head before it: X, Y, Z in mm.
    pub position: [f64; 3],
    /// The height over which the way there leads, in mm.
    pub clear_z: f64,
    /// What nozzle and bed are heated to for that, 0 where they stay off.
    pub targets: [Celsius; 2],
}

/// What a job is doing.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JobState {
    Printing,
    /// Coming to rest; then it waits.
    Pausing,
    /// Coming to rest on the path, where the board can hold it; then it is put aside …
    Halting,
    /// … and the head is parked.
    Parking,
    /// Reading up to the line with which it begins; then it is paused.
    Skipping,
    Paused,
    /// Going back to where it was paused.
    Returning,
    /// Coming to rest; then it is over because the user said so …
    Cancelling,
    /// … or because of this.
    Failing(PrinterError),
}

/// How far a job is, for those who show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobStatus {
    /// There is none.
    None,
    /// It is being printed (or waits for a temperature).
    Printing,
    /// It comes to rest to be paused.
    Pausing,
    /// It is paused, at rest.
    Paused,
    /// It comes to rest to be ended.
    Ending,
    /// The board holds its motion at rest on the path, whatever it belongs to: it goes on, or is ended, at the user's
    /// word.
    Held,
}

/// A job that was paused, and how the machine stood then.
#[derive(Debug)]
pub(super) struct Paused {
    /// Plans the job and nothing else, so that its plan does not depend on what is done meanwhile.
    pub(super) planner: Box<Planner>,
    pub(super) position: Position,
    pub(super) homed: [bool; 3],
    /// The nozzle was hot enough.
    pub(super) could_extrude: bool,
    /// What the heaters were set to.
    pub(super) targets: Vec<(gcode::Heater, Celsius)>,
    /// Where it begins in the middle of its file.
    pub(super) start: Option<Start>,
    /// The motion clock of the rest, where motion was held for the pause.
    pub(super) rest: Option<Ticks>,
    /// What is left of the run of motion that it was in, where it was paused on its path …
    pub(super) cut: Option<Box<Cut>>,
    /// … and what was pulled back of the filament.
    pub(super) retracted: Option<Retracted>,
}

/// Where the filament was pulled back from and to, in mm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Retracted {
    pub(super) from: f64,
    pub(super) to: f64,
}

/// How a job begins that does not begin with its file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    /// The line with which it begins.
    pub(super) line: u32,
    /// Ways lead over what has been printed at this height, in mm.
    pub(super) clear_z: f64,
    pub(super) fan: f64,
    /// The lowest and highest X and Y of what has been printed, in mm.
    pub(super) printed: Option<[[f64; 2]; 2]>,
    /// Filament that the lines before have pulled back …
    pub(super) retracted: f64,
    /// … and that has been pulled back on the way there, in mm.
    pub(super) pulled: f64,
    pub(super) way: Way,
}

/// How far the way to the first line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// The nozzle comes free of what it may stick to.
    Free,
    /// Up, above all that has been printed.
    Up,
    /// X and Y find out where they are.
    Home,
    /// Everything gets as warm as it was.
    Heat,
    /// Beside the part, the nozzle is filled.
    Prime,
    /// Across, and down.
    Down,
}

/// A print.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) source: Source,
    pub(super) options: JobOptions,
    pub(super) state: JobState,
    pub(super) paused: Option<Paused>,
    /// Reads up to the line with which it begins.
    pub(super) skip: Option<Skip>,
    /// The speed and flow factors that the user sets meanwhile: they come into force at that line.
    pub(super) factors: [Option<f64>; 2],
    pub(super) told: Seconds,
    /// It has made a move.
    pub(super) has_moved: bool,
    /// It switched the nozzle on and not off again.
    pub(super) leaves_hot: bool,
}

impl Job {
    pub(super) fn new(options: JobOptions, settings: Settings) -> Self {
        Self {
            source: Source::new(settings),
            options,
            state: JobState::Printing,
            paused: None,
            skip: None,
            factors: [None; 2],
            told: Seconds(f64::NEG_INFINITY),
            has_moved: false,
            leaves_hot: false,
        }
    }

    pub(super) const fn status(&self) -> JobStatus {
        match self.state {
            JobState::Printing | JobState::Skipping | JobState::Returning => JobStatus::Printing,
            JobState::Pausing | JobState::Halting | JobState::Parking => JobStatus::Pausing,
            JobState::Paused => JobStatus::Paused,
            JobState::Cancelling | JobState::Failing(_) => JobStatus::Ending,
        }
    }

    /// Whether its G-code is what is carried out.
    pub(super) fn is_active(&self) -> bool {
        self.state != JobState::Paused
    }

    /// Whether it is over as soon as the machine is at rest.
    pub(super) const fn is_ending(&self) -> bool {
        matches!(self.state, JobState::Cancelling | JobState::Failing(_))
    }

    /// Whether a blocking line has been confirmed.
    pub(super) fn is_confirmed(&self, line: u32) -> bool {
        self.options.confirm_all || self.options.confirmed_lines.contains(&line)
    }
}
