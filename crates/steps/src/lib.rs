//! From trajectories to `queue_step`: when each motor steps, in integer ticks, packed into few commands.
//!
//! Does: turns planned moves into the path of each motor, finds the time at which each step is due, and packs the steps
//! into (interval, count, add) within a stated error. Does not know: bytes, oids, pins, the wire, real clocks. Ticks count
//! from the start of a run of motion, so that the same moves give the same commands on every run and platform.
//!
//! Units: mm and seconds at the edges; inside, steps and ticks.
//!
//! A motor's step grid lies at `k · step_distance` of its absolute position. A step is due when the commanded position
//! crosses half-way between two grid positions; a position exactly half-way belongs to the upper one. There is no
//! hysteresis and nothing accumulates: after any move the count is that of the move's end, rounded.
//!
//! The packing is line stabbing: [`generator`](StepGenerator) → `crossing` (step times) → `compressor` (windows around
//! them) → `stabbing` (the longest quadratic with whole coefficients through the windows) → `ahead` (where it ends).

mod advance;
mod ahead;
mod bent;
mod compressor;
mod crossing;
mod delayed_sum;
mod filter;
mod generator;
mod kinematics;
mod merge;
mod polynomial;
mod segment;
mod shaper;
mod spec;
mod stabbing;
mod windows;

pub use advance::{Advance, Nonlinear};
pub use compressor::{RUN_SPAN_MAX, STEP_HOLD_MAX, STEPS_BUFFERED_MAX};
pub use delayed_sum::SEGMENTS_HELD_MAX;
pub use generator::{Filters, PIECES_HELD_MAX, PIECES_MAX, SMOOTH_TIME_MAX, StepGenerator};
pub use kinematics::{AXES, Cartesian, Delta, Geometry, Kinematics, Linear, STRETCH_RATIO_MAX, Tower};
pub use segment::{DEGREE_MAX, Segment};
pub use shaper::{DAMPING_RATIOS, SHAPER_FREQUENCIES, Shaper, ShaperKind};
pub use spec::{MotorStats, PushError, SpecError, StepSearch, StepperSpec};

use units::{Hertz, Ticks};

/// What one motor is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepCommand {
    /// Which motor: its place in the list of steppers.
    pub motor: usize,
    /// What it does.
    pub kind: StepCommandKind,
    /// Run clock of the motor's step before: the first interval counts from it.
    pub start: Ticks,
    /// Run clock of the command's last step; `start` where it has none.
    pub end: Ticks,
}

/// The two commands that a stepper knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepCommandKind {
    /// The direction of the steps that follow.
    SetDir {
        /// Towards larger positions.
        forward: bool,
    },
    /// `count` steps: the first comes `interval` ticks after the step before, and each later interval is `add` longer
    /// than the one before it.
    ///
    /// After a rest of more than [`IDLE_TICKS_MAX`] this is a single step, and `interval` is the distance modulo 2³²
    /// (never 0): the board's clock wraps, so the sender holds the command back until it is near enough.
    QueueStep {
        /// Ticks, at least 1.
        interval: u32,
        /// Steps, at least 1.
        count: u16,
        /// Ticks, 0 where `count` is 1.
        add: i16,
    },
}

/// The longest interval that a board may be sent ahead of time, in ticks.
pub const IDLE_TICKS_MAX: u64 = 3 << 28;

/// The most steps a second that a motor may be asked for, for a board with this clock.
pub fn step_rate_max(clock: Hertz) -> f64 {
    let ticks_per_s = f64::from(clock.0);
    ticks_per_s / compressor::gap_min_ticks(ticks_per_s)
}

#[cfg(test)]
mod bent_tests;
#[cfg(test)]
mod filter_tests;
#[cfg(test)]
mod tests;
