//! What the machine may do: speeds and accelerations, and what they leave to one move.

use thiserror::Error;
use units::{Mm, MmPerS, MmPerS2};

/// The limits of the machine, as a `printer.cfg` and the commands of a file set them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The fastest travel along the path.
    pub max_velocity: MmPerS,
    /// The strongest acceleration along the path.
    pub max_accel: MmPerS2,
    /// The speed at which a right-angled corner is taken; sharper corners are slower, wider ones faster.
    pub square_corner_velocity: MmPerS,
    /// 0 ..= 1 (exclusive): the smaller the share of a move that it must cruise, the faster short zig-zags go.
    pub minimum_cruise_ratio: f64,
    /// The fastest that z may move.
    pub max_z_velocity: MmPerS,
    /// The strongest acceleration of z.
    pub max_z_accel: MmPerS2,
    /// The fastest that x and y may move, each by itself; infinite where only the path is limited.
    pub max_xy_velocity: [MmPerS; 2],
    /// The strongest acceleration of x and y, each by itself; infinite where only the path is limited.
    pub max_xy_accel: [MmPerS2; 2],
    /// The distance by which a path rounded at a corner's speed may miss the corner, where that is given instead of
    /// `square_corner_velocity`.
    pub junction_deviation: Option<Mm>,
    /// What the extruder allows.
    pub extruder: ExtruderLimits,
}

/// The limits of the extruder, in mm of filament.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtruderLimits {
    /// The fastest move of the filament alone, or of a retraction.
    pub max_extrude_only_velocity: MmPerS,
    /// The strongest acceleration of the filament alone, or of a retraction.
    pub max_extrude_only_accel: MmPerS2,
    /// How much the filament's speed may jump where two moves meet.
    pub instantaneous_corner_velocity: MmPerS,
}

impl ExtruderLimits {
    /// The usual limits for a nozzle and a filament: what would leave the nozzle as a strand four nozzle diameters
    /// squared thick at the machine's own limits, and a jump of 1 mm/s.
    pub fn for_nozzle(
        nozzle_diameter: Mm,
        filament_diameter: Mm,
        max_velocity: MmPerS,
        max_accel: MmPerS2,
    ) -> Self {
        let radius = filament_diameter.0 * 0.5;
        let filament_area = core::f64::consts::PI * radius * radius;
        let ratio = 4.0 * nozzle_diameter.0 * nozzle_diameter.0 / filament_area;
        Self {
            max_extrude_only_velocity: max_velocity * ratio,
            max_extrude_only_accel: max_accel * ratio,
            instantaneous_corner_velocity: MmPerS(1.0),
        }
    }
}

/// A limit that no machine can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LimitsError {
    /// A speed or an acceleration that is not a positive, finite number.
    #[error("{0} must be a positive number")]
    NotPositive(&'static str),
    /// A value outside its range.
    #[error("{0} is out of its range")]
    OutOfRange(&'static str),
    /// Two ways to shape ramps that do not go together.
    #[error("the jerk cannot be limited where a motor's torque is given: leave out max_jerk or motor_torque")]
    JerkWithTorque,
}

/// Above this, a speed or an acceleration is a typing error; it keeps every square finite.
const LIMIT_MAX: f64 = 1e9;

impl Limits {
    /// No limit of x and y by themselves.
    pub const ANY_VELOCITY: [MmPerS; 2] = [MmPerS(f64::INFINITY); 2];
    /// The same of their acceleration.
    pub const ANY_ACCEL: [MmPerS2; 2] = [MmPerS2(f64::INFINITY); 2];

    /// Whether every limit is one that can be planned with.
    pub fn check(&self) -> Result<(), LimitsError> {
        let extruder = &self.extruder;
        for (value, name) in [
            (self.max_velocity.0, "max_velocity"),
            (self.max_accel.0, "max_accel"),
            (self.max_z_velocity.0, "max_z_velocity"),
            (self.max_z_accel.0, "max_z_accel"),
            (extruder.max_extrude_only_velocity.0, "max_extrude_only_velocity"),
            (extruder.max_extrude_only_accel.0, "max_extrude_only_accel"),
        ] {
            // Written so that NaN fails too.
            if !(value > 0.0 && value.is_finite()) {
                return Err(LimitsError::NotPositive(name));
            }
            if !(1.0 / LIMIT_MAX..=LIMIT_MAX).contains(&value) {
                return Err(LimitsError::OutOfRange(name));
            }
        }
        // These may be infinite.
        for axis in 0..2 {
            for (value, name) in [
                (self.max_xy_velocity[axis].0, ["max_x_velocity", "max_y_velocity"][axis]),
                (self.max_xy_accel[axis].0, ["max_x_accel", "max_y_accel"][axis]),
            ] {
                if value.is_nan() || value < 1.0 / LIMIT_MAX {
                    return Err(LimitsError::NotPositive(name));
                }
            }
        }
        if self.junction_deviation.is_some_and(|deviation| !(0.0..=LIMIT_MAX).contains(&deviation.0)) {
            return Err(LimitsError::OutOfRange("junction_deviation"));
        }
        for (value, name) in [
            (self.square_corner_velocity.0, "square_corner_velocity"),
            (extruder.instantaneous_corner_velocity.0, "instantaneous_corner_velocity"),
        ] {
            if !(0.0..=LIMIT_MAX).contains(&value) {
                return Err(LimitsError::OutOfRange(name));
            }
        }
        if (0.0..1.0).contains(&self.minimum_cruise_ratio) {
            Ok(())
        } else {
            Err(LimitsError::OutOfRange("minimum_cruise_ratio"))
        }
    }

    /// The distance by which a path rounded at the corner speed would miss a corner, in mm: the corner's speed as a
    /// length, so that it holds for every angle. With the radius R = δ·sin(θ/2)/(1 − sin(θ/2)) of such a rounding the
    /// corner's speed is v² = a·R.
    pub(crate) fn junction_deviation_mm(&self) -> f64 {
        if let Some(deviation) = self.junction_deviation {
            return deviation.0;
        }
        let corner = self.square_corner_velocity.0;
        corner * corner * (core::f64::consts::SQRT_2 - 1.0) / self.max_accel.0
    }

    /// The acceleration of the virtual look-ahead behind `minimum_cruise_ratio`, in mm/s².
    pub(crate) fn smoothed_accel_mm_s2(&self) -> f64 {
        self.max_accel.0 * (1.0 - self.minimum_cruise_ratio)
    }
}
