//! From the paths of the axes to the path of each motor, and from where the motors are to where the head is.

mod delta;
mod linear;
#[cfg(test)]
mod tests;

pub use delta::{Delta, STRETCH_RATIO_MAX, Tower};
pub use linear::Linear;

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

    /// Where a motor is when the machine is at `position` (x, y, z, e in mm). Not a number where it cannot be there.
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

/// The kinematics of a machine that is known only at run time: four motors, of which the last is the filament's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Geometry {
    /// A motor an axis.
    #[default]
    Cartesian,
    /// Each motor a sum of axes.
    Linear(Linear),
    /// Three towers.
    Delta(Delta),
}

impl Geometry {
    /// Where the machine is when its motors are there, in mm; none where they cannot be.
    pub fn position(&self, motors: &[f64; AXES]) -> Option<[f64; AXES]> {
        match self {
            Self::Cartesian => Some(*motors),
            Self::Linear(linear) => Some(linear.position(motors)),
            Self::Delta(delta) => delta.position(motors),
        }
    }

    /// Where all motors are when the machine is at `position`.
    pub fn motor_positions(&self, position: &[f64; AXES]) -> [f64; AXES] {
        core::array::from_fn(|motor| self.motor_position(motor, position))
    }

    /// The motors that move where only this axis does.
    pub fn motors_of(&self, axis: usize) -> [bool; AXES] {
        core::array::from_fn(|motor| self.axes(motor)[axis])
    }

    /// Where these axes are can be said only together with all of these: their motors hang together.
    pub fn coupled(&self, axes: [bool; AXES]) -> [bool; AXES] {
        let mut all = axes;
        // Each round adds an axis, or is the last.
        for _ in 0..AXES {
            let motors: [bool; AXES] =
                core::array::from_fn(|motor| (0..AXES).any(|axis| all[axis] && self.axes(motor)[axis]));
            for (axis, is_in) in all.iter_mut().enumerate() {
                *is_in |= (0..AXES).any(|motor| motors[motor] && self.axes(motor)[axis]);
            }
        }
        all
    }
}

impl Kinematics for Geometry {
    fn motors(&self) -> usize {
        AXES
    }

    fn axes(&self, motor: usize) -> [bool; AXES] {
        match self {
            Self::Cartesian => Cartesian.axes(motor),
            Self::Linear(linear) => linear.axes(motor),
            Self::Delta(delta) => delta.axes(motor),
        }
    }

    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64 {
        match self {
            Self::Cartesian => position[motor],
            Self::Linear(linear) => linear.motor_position(motor, position),
            Self::Delta(delta) => delta.motor_position(motor, position),
        }
    }

    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>) {
        match self {
            Self::Cartesian => Cartesian.motor_segments(motor, stretch, out),
            Self::Linear(linear) => linear.motor_segments(motor, stretch, out),
            Self::Delta(delta) => delta.motor_segments(motor, stretch, out),
        }
    }
}
