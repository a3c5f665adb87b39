//! From the path of the machine to the path of each motor.

use motion::PlannedMove;

/// A stretch of one motor's path: position is a quadratic in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorSegment {
    /// Print time at which it starts, s.
    pub start_time: f64,
    /// How long it lasts, s.
    pub duration: f64,
    /// Motor position at its start, mm.
    pub start: f64,
    /// Motor position at its end, mm: exact at the end of a move, so that no rounding is carried on.
    pub end: f64,
    /// Motor speed at its start, mm/s.
    pub velocity: f64,
    /// Half the motor's acceleration, mm/s².
    pub half_accel: f64,
}

/// How the motors of a machine follow its head: the seam for other machines.
///
/// Kinematics whose motors do not move quadratically in time split a move into as many segments as their accuracy
/// needs; segments follow each other without a gap in time or position.
pub trait Kinematics {
    /// The number of motors.
    fn motors(&self) -> usize;

    /// Where a motor is when the machine is at `position` (x, y, z, e in mm).
    fn motor_position(&self, motor: usize, position: &[f64; 4]) -> f64;

    /// Appends the path of `motor` over one move; nothing where it stands still.
    fn motor_segments(&self, planned: &PlannedMove, motor: usize, out: &mut Vec<MotorSegment>);
}

/// One motor for each of x, y, z and e, in this order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cartesian;

impl Kinematics for Cartesian {
    fn motors(&self) -> usize {
        4
    }

    fn motor_position(&self, motor: usize, position: &[f64; 4]) -> f64 {
        position[motor]
    }

    fn motor_segments(&self, planned: &PlannedMove, motor: usize, out: &mut Vec<MotorSegment>) {
        linear_segments(planned, planned.from[motor], planned.to[motor], planned.direction[motor], out);
    }
}

/// The phases of a motor whose position is linear in the distance along the path: `ratio` mm of the motor a mm.
fn linear_segments(planned: &PlannedMove, from: f64, to: f64, ratio: f64, out: &mut Vec<MotorSegment>) {
    if from == to {
        return;
    }
    let mut start_time = planned.start_time;
    let mut start = from;
    for phase in planned.phases() {
        let end = if phase.end_distance == planned.length { to } else { from + ratio * phase.end_distance };
        out.push(MotorSegment {
            start_time,
            duration: phase.duration,
            start,
            end,
            velocity: phase.velocity * ratio,
            half_accel: 0.5 * phase.accel * ratio,
        });
        start_time += phase.duration;
        start = end;
    }
}
