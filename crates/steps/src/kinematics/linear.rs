//! Machines of which each motor's position is a sum of the axes': CoreXY and its relatives. Exact, since a sum of
//! polynomials of time is one.

use nalgebra::{Matrix4, Vector4};

use super::{AXES, Kinematics};
use crate::Segment;

/// Powers of two axes that cancel each other leave rounding, of this share, which is no motion.
const ROUNDING: f64 = 1e-13;

/// Motors that are sums of axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// A row a motor, a column an axis.
    motors_from_axes: Matrix4<f64>,
    axes_from_motors: Matrix4<f64>,
}

impl Linear {
    /// Each motor's share of each axis, a row a motor; none where the motors do not determine the axes.
    pub fn new(shares: [[f64; AXES]; AXES]) -> Option<Self> {
        let motors_from_axes = Matrix4::from_fn(|motor, axis| shares[motor][axis]);
        let axes_from_motors = motors_from_axes.try_inverse()?;
        let is_finite = motors_from_axes.iter().chain(axes_from_motors.iter()).all(|share| share.is_finite());
        is_finite.then_some(Self { motors_from_axes, axes_from_motors })
    }

    /// A motor's share of an axis: how far it goes where the axis goes a millimetre.
    pub fn share(&self, motor: usize, axis: usize) -> f64 {
        self.motors_from_axes[(motor, axis)]
    }

    /// Where the axes are when the motors are there.
    pub fn position(&self, motors: &[f64; AXES]) -> [f64; AXES] {
        (self.axes_from_motors * Vector4::from(*motors)).into()
    }

    /// The sum of what `of` gives for the axes that a motor follows, and of its magnitudes.
    fn sum(&self, motor: usize, of: impl Fn(usize) -> f64) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for axis in 0..AXES {
            let share = self.motors_from_axes[(motor, axis)];
            if share != 0.0 {
                let part = share * of(axis);
                sums = (sums.0 + part, sums.1 + part.abs());
            }
        }
        sums
    }
}

impl Kinematics for Linear {
    fn motors(&self) -> usize {
        AXES
    }

    fn axes(&self, motor: usize) -> [bool; AXES] {
        core::array::from_fn(|axis| self.share(motor, axis) != 0.0)
    }

    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64 {
        self.sum(motor, |axis| position[axis]).0
    }

    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>) {
        let followed = self.axes(motor).iter().position(|&follows| follows).unwrap_or(0);
        let powers = core::array::from_fn(|power| {
            let (sum, size) = self.sum(motor, |axis| stretch[axis].powers[power]);
            if sum.abs() > ROUNDING * size { sum } else { 0.0 }
        });
        let segment = Segment {
            start: self.sum(motor, |axis| stretch[axis].start).0,
            end: self.sum(motor, |axis| stretch[axis].end).0,
            powers,
            ..stretch[followed]
        };
        if !segment.is_rest() {
            out.push(segment);
        }
    }
}
