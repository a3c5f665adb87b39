//! A print: its G-code, how far it is, and what ends it.

use std::collections::BTreeSet;

use gcode::Settings;
use units::{MmPerS, Seconds};

use crate::{
    error::PrinterError,
    planner::{Position, Source},
};

/// Going back to where a print was paused is done at this speed.
pub(super) const RETURN_FEED: MmPerS = MmPerS(50.0);
/// Progress is told no more often than this.
pub(super) const PROGRESS_INTERVAL: Seconds = Seconds(0.25);

/// What a job is started with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JobOptions {
    /// Lines with something blocking in them that the user has confirmed: they are passed over.
    pub confirmed_lines: BTreeSet<u32>,
    /// Confirm all of them.
    pub confirm_all: bool,
}

/// What a job is doing.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JobState {
    Printing,
    /// Coming to rest; then it waits.
    Pausing,
    Paused,
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
}

/// A print.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) source: Source,
    pub(super) options: JobOptions,
    pub(super) state: JobState,
    /// Where it was paused.
    pub(super) paused_at: Option<Position>,
    pub(super) told: Seconds,
}

impl Job {
    pub(super) fn new(options: JobOptions, settings: Settings) -> Self {
        Self {
            source: Source::new(settings),
            options,
            state: JobState::Printing,
            paused_at: None,
            told: Seconds(f64::NEG_INFINITY),
        }
    }

    pub(super) const fn status(&self) -> JobStatus {
        match self.state {
            JobState::Printing => JobStatus::Printing,
            JobState::Pausing => JobStatus::Pausing,
            JobState::Paused => JobStatus::Paused,
            JobState::Cancelling | JobState::Failing(_) => JobStatus::Ending,
        }
    }

    /// Whether a blocking line has been confirmed.
    pub(super) fn is_confirmed(&self, line: u32) -> bool {
        self.options.confirm_all || self.options.confirmed_lines.contains(&line)
    }
}
