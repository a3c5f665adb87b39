//! A run of motion as the stream of motion has it: going on, taken up from another host, or put aside.
//!
//! Clocks are the board's motion clock.

use std::collections::VecDeque;

use gcode::LineNumber;
use units::{Seconds, Ticks};

use super::{event::ScheduledMove, kept::Left};
use crate::{
    machine::MOTORS,
    pace::Pace,
    planner::{Position, TimedAction},
};

/// Something that happens when the board's clock gets there.
#[derive(Clone, Debug)]
pub(super) enum Due {
    /// The machine gets to the end of a move.
    MoveEnd(ScheduledMove, Pace),
    /// A line's action.
    Action(LineNumber, TimedAction),
}

/// Whether the nozzle is on once all this has happened.
pub(super) fn leaves_hot(timeline: &VecDeque<(Ticks, Due)>, is_hot: bool) -> bool {
    timeline.iter().fold(is_hot, |is_hot, (_, due)| match due {
        Due::Action(_, TimedAction::SetTemperature { heater: gcode::Heater::Tool(0), target }) => {
            target.0 > 0.0
        }
        Due::Action(_, TimedAction::TurnOffHeaters) => false,
        _ => is_hot,
    })
}

/// A run of motion on the board's clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) start: Ticks,
    /// Known once its last move has been planned.
    pub(super) end: Option<Ticks>,
    /// Whether it belongs to homing, which is no print time.
    pub(super) homing: bool,
}

/// A run that was begun by a host that is gone.
#[derive(Clone, Copy, Debug)]
pub(super) struct TakenUp {
    pub(super) start: Ticks,
    pub(super) end: Option<Ticks>,
    /// Where the board counts each motor to be.
    pub(super) counts: [i32; MOTORS],
    /// The same at the start of the run, and the machine's position there.
    pub(super) counts_at_start: [i32; MOTORS],
    pub(super) position_at_start: Position,
    /// Print time of the runs before.
    pub(super) elapsed: Seconds,
}

/// A run of motion that was put aside at rest on its path.
#[derive(Debug)]
pub(super) struct Cut {
    pub(super) run: Run,
    /// The motion clock of that rest.
    pub(super) at: Ticks,
    pub(super) left: Left,
    /// Each motor's direction after the rows that are left.
    pub(super) forward: [bool; MOTORS],
    /// Steps that the board has counted in the run.
    pub(super) made: [i32; MOTORS],
    pub(super) position_at_start: Position,
    /// Print time of the runs before.
    pub(super) elapsed: Seconds,
    pub(super) timeline: VecDeque<(Ticks, Due)>,
}
