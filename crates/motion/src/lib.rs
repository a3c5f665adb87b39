//! From moves to trajectories: speeds and times along the path, planned ahead over a bounded window.
//!
//! Does: limits each move, limits the speed at each junction, looks ahead so that every stop is reached, and gives each
//! move a trapezoid of speed with its place in print time. Does not know: G-code, motors, ticks, bytes, clocks of any
//! kind; where the machine may go; whether it is homed or hot.
//!
//! Units: millimetres, seconds, print time from the start of a run of motion. Positions are `[x, y, z, e]` in machine
//! coordinates; `e` is the running total of filament.
//!
//! The model (square corner velocity, minimum cruise ratio, limits of z and of the extruder) is the one that Klipper
//! documents in "Kinematics" and "Config_Reference"; the planner here is the forward and backward pass over squared
//! speeds, so that with constant acceleration `v² = v₀² + 2·a·d`.

mod ability;
mod bend;
mod bound;
mod jerk;
mod junction;
mod knots;
mod limits;
mod look_ahead;
mod motor;
mod planned;
mod s_curve;
mod window;

pub use bend::{BEND_ANGLE_MAX, Bend};
pub use bound::Bound;
pub use limits::{ExtruderLimits, Limits, LimitsError};
pub use look_ahead::{
    LOOK_AHEAD_MOVES_MAX, LookAhead, MoveError, MoveRequest, Profile, READY_MOVES_MAX, RUN_TIME_MAX,
};
pub use motor::{Demand, MotorAbility, TORQUE_POINTS_MAX, Torque, TorqueError};
pub use planned::{Phase, PlannedMove};

#[cfg(test)]
mod bend_tests;
#[cfg(test)]
mod jerk_tests;
#[cfg(test)]
mod motor_tests;
#[cfg(test)]
mod tests;
