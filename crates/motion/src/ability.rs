//! What one move can speed up and slow down by, and how far that takes it.
//!
//! An acceleration may depend on speed. With the potential E(v) = ∫ v dv / a(v), the length of path that leads from rest to
//! v, a move over the length d reaches E⁻¹(E(v₀) + d): for a constant acceleration that is v² = v₀² + 2·a·d. Here a(v) is a
//! staircase, so that E is a chain of straight lines over v² and everything below is exact.
//!
//! Squared speeds in mm²/s², lengths in mm, accelerations in mm/s², all along the path.

use crate::motor::{Demand, MotorAbility, TURNING_SHARE};
use nalgebra::Vector4;

/// Takes a stair's end, there and back through a motor's share, to the next stair.
const JUST_ABOVE: f64 = 1.0 + 4.0 * f64::EPSILON;

/// Stairs of what turning takes, from rest to the speed up to which it is counted.
const TURNING_STAIRS: f64 = 32.0;

/// What turning takes of each axis: v² times the change of its share per mm of path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning {
    /// The highest squared speed at which the path turns so.
    pub(crate) until_v2: f64,
    /// Change of each axis' share per mm, without sign.
    pub(crate) bends: Vector4<f64>,
}

impl Turning {
    /// A path that goes straight on.
    pub(crate) const NONE: Self = Self { until_v2: 0.0, bends: Vector4::new(0.0, 0.0, 0.0, 0.0) };
    /// What is not known yet may take all that turning may.
    pub(crate) const ANY: Self = {
        let any = f64::INFINITY;
        Self { until_v2: any, bends: Vector4::new(any, any, any, any) }
    };
}

/// A move that speeds up or slows down: the reading of its motors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ability<'a> {
    /// What the limits leave at any speed.
    accel: f64,
    /// Change of each motor's axis per mm of path.
    direction: &'a Vector4<f64>,
    /// Motors whose strength depends on speed; none where limits are all there is.
    motors: &'a [Option<MotorAbility>],
    /// Where and how the path turns meanwhile.
    turnings: &'a [Turning],
    demand: Demand,
}

/// An acceleration and the squared speed up to which it is there.
#[derive(Clone, Copy, Debug)]
struct Stair {
    accel: f64,
    until_v2: f64,
}

impl<'a> Ability<'a> {
    pub(crate) const fn new(
        accel: f64,
        direction: &'a Vector4<f64>,
        motors: &'a [Option<MotorAbility>],
        turnings: &'a [Turning],
        demand: Demand,
    ) -> Self {
        Self { accel, direction, motors, turnings, demand }
    }

    /// What there is just above a squared speed.
    fn stair(&self, v2: f64) -> Stair {
        let v2_above = v2 * JUST_ABOVE;
        let turns_until = self.turnings.iter().map(|turning| turning.until_v2).fold(0.0, f64::max);
        let cell = turns_until / TURNING_STAIRS;
        let turning_v2 =
            if v2_above < turns_until { cell * (libm::floor(v2_above / cell) + 1.0) } else { f64::INFINITY };
        let mut stair = Stair { accel: self.accel, until_v2: turning_v2 };
        for (axis, (motor, share)) in self.motors.iter().zip(self.direction.iter()).enumerate() {
            let (Some(motor), true) = (motor, *share != 0.0) else { continue };
            let share2 = share * share;
            let (accel, until_v2) = motor.at(v2_above * share2, self.demand);
            let asked = |turning: &Turning| turning.bends[axis] * turning_v2.min(turning.until_v2);
            let turning = self.turnings.iter().map(asked).fold(0.0, f64::max);
            let left = (accel - turning).max(accel * (1.0 - TURNING_SHARE));
            stair.accel = stair.accel.min(left / share.abs());
            stair.until_v2 = stair.until_v2.min(until_v2 / share2);
        }
        stair
    }

    /// The squared speed that `length` leads to from `v2`, or from which it leads down to `v2`.
    #[inline]
    pub(crate) fn reach(&self, v2: f64, length: f64) -> f64 {
        if self.motors.is_empty() { v2 + 2.0 * self.accel * length } else { self.climb(v2, length) }
    }

    fn climb(&self, mut v2: f64, mut length: f64) -> f64 {
        loop {
            let stair = self.stair(v2);
            let needed = (stair.until_v2 - v2) * (0.5 / stair.accel);
            // Also where the top needs more than any length.
            if needed >= length || stair.until_v2 <= v2 {
                return v2 + 2.0 * stair.accel * length;
            }
            length -= needed;
            v2 = stair.until_v2;
        }
    }

    /// The stairs between two squared speeds, from the lower one up: where each begins and ends, and its acceleration.
    pub(crate) fn stairs(&self, from_v2: f64, to_v2: f64, mut each: impl FnMut(f64, f64, f64)) {
        let mut v2 = from_v2;
        while v2 < to_v2 {
            let stair = self.stair(v2);
            let until = if stair.until_v2 > v2 { stair.until_v2.min(to_v2) } else { to_v2 };
            each(v2, until, stair.accel);
            v2 = until;
        }
    }

    /// The length of path between two squared speeds.
    pub(crate) fn length(&self, from_v2: f64, to_v2: f64) -> f64 {
        if self.motors.is_empty() {
            return (to_v2 - from_v2).max(0.0) * (0.5 / self.accel);
        }
        let mut length = 0.0;
        self.stairs(from_v2, to_v2, |low, high, accel| length += (high - low) * (0.5 / accel));
        length
    }
}

/// The top of a move that speeds up from one squared speed and goes straight over to slowing down to the other.
pub(crate) fn peak(up: &Ability<'_>, down: &Ability<'_>, start_v2: f64, end_v2: f64, length: f64) -> f64 {
    if up.motors.is_empty() {
        return 0.5 * (start_v2 + end_v2) + up.accel * length;
    }
    let mut v2 = start_v2.max(end_v2);
    let mut left = length - up.length(start_v2, v2) - down.length(end_v2, v2);
    loop {
        let (speeding, slowing) = (up.stair(v2), down.stair(v2));
        let slope = 0.5 / speeding.accel + 0.5 / slowing.accel;
        let until = speeding.until_v2.min(slowing.until_v2);
        let needed = (until - v2) * slope;
        if needed >= left || until <= v2 {
            return v2 + (left / slope).max(0.0);
        }
        left -= needed;
        v2 = until;
    }
}
