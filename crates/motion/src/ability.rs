//! What one move can speed up and slow down by, and how far that takes it.
//!
//! An acceleration may depend on speed. With the potential E(v) = ∫ v dv / a(v), the length of path that leads from rest to
//! v, a move over the length d reaches E⁻¹(E(v₀) + d): for a constant acceleration that is v² = v₀² + 2·a·d. Here a(v) is a
//! staircase, so that E is a chain of straight lines over v² and everything below is exact.
//!
//! Squared speeds in mm²/s², lengths in mm, accelerations in mm/s², all along the path.

use crate::motor::{Demand, MotorAbility};
use nalgebra::Vector4;

/// Takes a stair's end, there and back through a motor's share, to the next stair.
const JUST_ABOVE: f64 = 1.0 + 4.0 * f64::EPSILON;

/// A move that speeds up or slows down: the reading of its motors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ability<'a> {
    /// What the limits leave at any speed.
    accel: f64,
    /// Change of each motor's axis per mm of path.
    direction: &'a Vector4<f64>,
    /// Motors whose strength depends on speed; none where limits are all there is.
    motors: &'a [Option<MotorAbility>],
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
        demand: Demand,
    ) -> Self {
        Self { accel, direction, motors, demand }
    }

    /// What there is just above a squared speed.
    fn stair(&self, v2: f64) -> Stair {
        let mut stair = Stair { accel: self.accel, until_v2: f64::INFINITY };
        for (motor, share) in self.motors.iter().zip(self.direction.iter()) {
            let (Some(motor), true) = (motor, *share != 0.0) else { continue };
            let share2 = share * share;
            let (accel, until_v2) = motor.at(v2 * share2 * JUST_ABOVE, self.demand);
            stair.accel = stair.accel.min(accel / share.abs());
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
