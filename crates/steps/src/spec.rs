//! What a step generator is told of its motors, why it may refuse, and what it counts.

use thiserror::Error;
use units::{Mm, Seconds};

/// Step times may be off by this much at most, whoever asks for more.
pub(crate) const ERROR_MAX: Seconds = Seconds(1e-3);

/// One motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepperSpec {
    /// How far the axis goes in one step.
    pub step_distance: Mm,
    /// How early or late a step may come; never more than a quarter of the gap to either neighbour.
    pub max_error: Seconds,
    /// What is done for fewer bytes.
    pub search: StepSearch,
}

/// How commands are searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepSearch {
    /// Each by itself, as long as any.
    #[default]
    Usual,
    /// With a look at the next one: fewer bytes, for several times the search.
    Ahead,
}

impl StepperSpec {
    /// The usual allowance for the time of a step.
    pub const MAX_ERROR: Seconds = Seconds(25e-6);

    /// A motor with the usual allowance.
    pub const fn new(step_distance: Mm) -> Self {
        Self { step_distance, max_error: Self::MAX_ERROR, search: StepSearch::Usual }
    }
}

/// Why steps cannot be generated for a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SpecError {
    /// The list of steppers is not as long as the kinematics has motors.
    #[error("the kinematics needs {needed} motors, {given} are given")]
    Motors {
        /// What the kinematics has.
        needed: usize,
        /// What was given.
        given: usize,
    },
    /// A step distance outside 1 nm ..= 1 m.
    #[error("the step distance of motor {motor} is not usable")]
    StepDistance {
        /// Place in the list.
        motor: usize,
    },
    /// An allowance outside 0 ..= 1 ms.
    #[error("the step time error of motor {motor} is not usable")]
    MaxError {
        /// Place in the list.
        motor: usize,
    },
    /// A clock below 100 kHz.
    #[error("the clock is too slow to time steps")]
    Clock,
}

/// Why a move was not taken. Nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PushError {
    /// The motor would have to make more than 2 million steps a second, or more than a step in 4 ticks.
    #[error("motor {motor} would have to step faster than any driver can")]
    StepRate {
        /// Place in the list.
        motor: usize,
    },
    /// A position or time is not a number or too large.
    #[error("motor {motor} would leave the range of positions or times")]
    Range {
        /// Place in the list.
        motor: usize,
    },
    /// The move does not start where the run or the move before it left the motor.
    #[error("the move does not start where motor {motor} is")]
    Gap {
        /// Place in the list.
        motor: usize,
    },
    /// Steps must be taken with [`StepGenerator::pop`] first.
    #[error("steps must be taken before more moves are pushed")]
    Full,
    /// The first move starts before [`StepGenerator::lead`].
    #[error("the first move starts before its filters can")]
    TooEarly,
    /// [`StepGenerator::end_run`] was called, or the run cannot go on: a new one must begin first.
    #[error("the run has ended")]
    Ended,
}

/// What one motor has been given since the generator was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorStats {
    /// Steps, both ways.
    pub steps: u64,
    /// Commands of the kind `QueueStep`.
    pub queue_steps: u64,
    /// Commands of the kind `SetDir`.
    pub direction_changes: u64,
    /// The fastest two steps of one direction followed each other, in steps a second; 0 where none did.
    pub peak_steps_per_s: f64,
    /// The worst distance of a step from the time at which it was due; where it comes within a tick of what a step may be off,
    /// that.
    pub max_error: Seconds,
}
