//! From the paths of the axes to the path of each motor.

use crate::Segment;

/// The axes of a machine: x, y, z and the filament, in this order.
pub const AXES: usize = 4;

/// How the motors of a machine follow its head: the seam for other machines.
///
/// The paths that come in are those of the axes, after shaping and pressure advance. Kinematics whose motors do not move
/// as a polynomial of time where the axes do split a stretch into as many segments as their accuracy needs; segments
/// follow each other without a gap in time or position.
pub trait Kinematics {
    /// The number of motors.
    fn motors(&self) -> usize;

    /// The axes that a motor follows. One that follows a single axis is given that axis' segments as they are.
    fn axes(&self, motor: usize) -> [bool; AXES];

    /// Where a motor is when the machine is at `position` (x, y, z, e in mm).
    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64;

    /// Appends the path of `motor` over a stretch of time in which each axis is one segment, all of them from the same
    /// start and equally long; nothing where it stands still. Axes that the motor does not follow are not meaningful.
    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>);
}

/// One motor for each of x, y, z and e, in this order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cartesian;

impl Kinematics for Cartesian {
    fn motors(&self) -> usize {
        AXES
    }

    fn axes(&self, motor: usize) -> [bool; AXES] {
        core::array::from_fn(|axis| axis == motor)
    }

    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64 {
        position[motor]
    }

    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>) {
        out.push(stretch[motor]);
    }
}
