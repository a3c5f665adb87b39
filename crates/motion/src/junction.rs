//! One move under its limits, and the speed at which two moves may meet.

use crate::ability::{Ability, Turning, peak};
use crate::motor::{Demand, MotorAbility};
use crate::{Bend, Limits, MoveRequest};
use nalgebra::{Vector3, Vector4};

/// Shorter moves (mm) are no moves: less than rounding in a file could mean.
pub(crate) const LENGTH_MIN_MM: f64 = 1e-9;

/// The place of the filament among the coordinates.
const EXTRUDER: usize = 3;
/// The cosine of the angle up to which pieces of one arc go on into each other.
const SAME_HEADING: f64 = 0.99;

/// A move that waits in the window: what limits it, in squared speeds (mm²/s²).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) tag: u32,
    pub(crate) from: [f64; 4],
    pub(crate) to: [f64; 4],
    /// Change of each coordinate per mm of path; of an arc's x, y and z: as a unit vector from its start to its end.
    pub(crate) direction: Vector4<f64>,
    /// The most that each coordinate changes per mm of path, wherever on it.
    shares: Vector4<f64>,
    /// The path where it is no straight line.
    pub(crate) bend: Option<Bend>,
    pub(crate) length: f64,
    pub(crate) accel: f64,
    /// Whether the head travels (otherwise the filament alone moves).
    travels: bool,
    junction_deviation: f64,
    corner_extruder: f64,
    /// How its path turns: at its start, on its way and at its end, of which nothing is known before the next move comes.
    turnings: [Turning; 3],
    /// The highest cruising speed, squared.
    pub(crate) cruise_limit: f64,
    /// How long it would take at its highest cruising speed, s: it never takes less.
    pub(crate) nominal_time: f64,
    /// The gentler acceleration of the virtual look-ahead.
    pub(crate) smoothed_accel: f64,
    /// The squared speed that the motors may jump by: to start and to end with.
    pub(crate) jump_v2: f64,
    /// The highest squared speed at the start, as far as the moves before it decide.
    pub(crate) start_limit: f64,
    /// The same in the virtual look-ahead.
    pub(crate) smoothed_start_limit: f64,
}

impl Entry {
    /// The move under `limits`, along `bend` if there is one, starting from rest; `None` where nothing moves.
    pub(crate) fn new(
        request: &MoveRequest,
        bend: Option<&Bend>,
        limits: &Limits,
        motors: &[Option<MotorAbility>],
    ) -> Option<Self> {
        let delta = Vector4::from(request.to) - Vector4::from(request.from);
        let straight_mm = norm(&delta.xyz());
        let bend = bend.filter(|_| straight_mm >= LENGTH_MIN_MM);
        let travel_mm = bend.map_or(straight_mm, Bend::length);
        let travels = travel_mm >= LENGTH_MIN_MM;
        let length = if travels { travel_mm } else { delta.w.abs() };
        if length < LENGTH_MIN_MM {
            return None;
        }
        let mut direction = delta / length;
        let mut shares = direction;
        let mut velocity = request.feed.0;
        let mut accel = f64::INFINITY;
        if let Some(bend) = bend {
            direction = (delta.xyz() / straight_mm).push(direction.w);
            shares = bend.shares().push(direction.w);
        }
        if travels {
            velocity = velocity.min(limits.max_velocity.0);
            accel = limits.max_accel.0;
        } else {
            direction = Vector4::new(0.0, 0.0, 0.0, direction.w);
            shares = direction;
        }
        if travels && shares.z != 0.0 {
            let path_per_z = 1.0 / shares.z.abs();
            velocity = velocity.min(limits.max_z_velocity.0 * path_per_z);
            accel = accel.min(limits.max_z_accel.0 * path_per_z);
        }
        if travels {
            for axis in 0..2 {
                let share = shares[axis].abs();
                if share > 0.0 {
                    velocity = velocity.min(limits.max_xy_velocity[axis].0 / share);
                    accel = accel.min(limits.max_xy_accel[axis].0 / share);
                }
            }
        }
        if let Some(bend) = bend {
            velocity = velocity.min(turning_velocity(bend, limits, motors, &shares, velocity));
        }
        // The filament sets the limits where it moves without x and y, and where it is pulled back.
        let filament_leads = direction.w < 0.0 || (shares.x == 0.0 && shares.y == 0.0);
        if direction.w != 0.0 && filament_leads {
            let path_per_e = 1.0 / direction.w.abs();
            velocity = velocity.min(limits.extruder.max_extrude_only_velocity.0 * path_per_e);
            accel = accel.min(limits.extruder.max_extrude_only_accel.0 * path_per_e);
        }
        let corner_extruder = limits.extruder.instantaneous_corner_velocity.0;
        let mut jump = if motors.is_empty() { 0.0 } else { velocity };
        for (axis, motor) in motors.iter().enumerate() {
            let share = shares[axis].abs();
            if share == 0.0 {
                continue;
            }
            let start = match motor {
                Some(motor) => {
                    velocity = velocity.min(motor.top().0 / share);
                    motor.start().0
                }
                // A motor of which nothing is known starts from rest.
                None if axis < EXTRUDER => 0.0,
                None => corner_extruder,
            };
            jump = jump.min(start / share);
        }
        let velocity = calm(velocity, &shares, motors);
        let jump = jump.min(velocity);
        Some(Self {
            tag: request.tag,
            from: request.from,
            to: request.to,
            direction,
            shares,
            bend: bend.copied(),
            length,
            accel,
            travels,
            junction_deviation: limits.junction_deviation_mm(),
            corner_extruder,
            turnings: [
                Turning::NONE,
                bend.map_or(Turning::NONE, |bend| Turning {
                    until_v2: velocity * velocity,
                    bends: bend.curvatures().push(0.0),
                }),
                Turning::ANY,
            ],
            cruise_limit: velocity * velocity,
            nominal_time: length / velocity,
            smoothed_accel: accel.min(limits.smoothed_accel_mm_s2()),
            jump_v2: jump * jump,
            start_limit: jump * jump,
            smoothed_start_limit: jump * jump,
        })
    }

    const fn ability<'a>(
        &'a self,
        accel: f64,
        motors: &'a [Option<MotorAbility>],
        demand: Demand,
    ) -> Ability<'a> {
        // Along an arc an axis may do either, at any speed up to that of its share.
        let demand = if self.bend.is_some() { Demand::Turn } else { demand };
        Ability::new(accel, &self.shares, motors, &self.turnings, demand)
    }

    /// What the move can speed up by.
    pub(crate) const fn speeding<'a>(&'a self, motors: &'a [Option<MotorAbility>]) -> Ability<'a> {
        self.ability(self.accel, motors, Demand::Speed)
    }

    /// What it can slow down by.
    pub(crate) const fn slowing<'a>(&'a self, motors: &'a [Option<MotorAbility>]) -> Ability<'a> {
        self.ability(self.accel, motors, Demand::Slow)
    }

    /// The gentler speeding up of the virtual look-ahead.
    pub(crate) const fn smoothed_speeding<'a>(&'a self, motors: &'a [Option<MotorAbility>]) -> Ability<'a> {
        self.ability(self.smoothed_accel, motors, Demand::Speed)
    }

    /// The same for slowing down.
    pub(crate) const fn smoothed_slowing<'a>(&'a self, motors: &'a [Option<MotorAbility>]) -> Ability<'a> {
        self.ability(self.smoothed_accel, motors, Demand::Slow)
    }

    /// The top of the move between two squared speeds, should it not cruise.
    pub(crate) fn peak(&self, start_v2: f64, end_v2: f64, motors: &[Option<MotorAbility>]) -> f64 {
        peak(&self.speeding(motors), &self.slowing(motors), start_v2, end_v2, self.length)
    }

    /// The highest squared speed up to `v2` at which none of its motors resonates.
    pub(crate) fn calm(&self, v2: f64, motors: &[Option<MotorAbility>]) -> f64 {
        let velocity = v2.sqrt();
        let calm = calm(velocity, &self.shares, motors);
        if calm < velocity { calm * calm } else { v2 }
    }

    /// Nothing follows this move without a stop.
    pub(crate) const fn end(&mut self) {
        self.turnings[2] = Turning::NONE;
    }

    /// Sets the start limits of this move, which follows `previous` without a stop, and what both can do beside the turn.
    pub(crate) fn follow(&mut self, previous: &mut Self, motors: &[Option<MotorAbility>]) {
        let mut bends = Vector4::zeros();
        self.start_limit = self.junction_limit(previous, motors, &mut bends);
        let turning = Turning { until_v2: self.start_limit, bends };
        let turning = if bends == Vector4::zeros() { Turning::NONE } else { turning };
        self.turnings[0] = turning;
        previous.turnings[2] = turning;
        self.smoothed_start_limit = self.start_limit;
        self.keep_in_reach(previous, motors);
    }

    /// Lowers the start limits to what `previous` can speed up to.
    pub(crate) fn keep_in_reach(&mut self, previous: &Self, motors: &[Option<MotorAbility>]) {
        let length = previous.length;
        self.start_limit =
            self.start_limit.min(previous.speeding(motors).reach(previous.start_limit, length));
        let smoothed = previous.smoothed_speeding(motors).reach(previous.smoothed_start_limit, length);
        self.smoothed_start_limit = self.start_limit.min(self.smoothed_start_limit).min(smoothed);
    }

    /// The highest squared speed at which this move may follow `previous`, whatever their lengths allow. `bends` becomes the
    /// change of each motor's share per mm about there.
    fn junction_limit(
        &self,
        previous: &Self,
        motors: &[Option<MotorAbility>],
        bends: &mut Vector4<f64>,
    ) -> f64 {
        if !(self.travels && previous.travels) {
            return 0.0;
        }
        let mut limit = self.cruise_limit.min(previous.cruise_limit);
        let (before, after) = (previous.heading(true), self.heading(false));
        let extrusion_jump = (self.direction.w - previous.direction.w).abs();
        if extrusion_jump > 0.0 {
            let speed = self.corner_extruder / extrusion_jump;
            limit = limit.min(speed * speed);
        }
        // Within an arc there is no corner.
        let continues = self.bend.is_some_and(|bend| bend.continues) && previous.bend.is_some();
        if continues && after.dot(&before) > SAME_HEADING {
            return limit;
        }
        // θ is the angle between the two moves, π where they go straight on.
        let cos_theta = -after.dot(&before);
        let sin_half = (0.5 * (1.0 - cos_theta)).max(0.0).sqrt();
        let cos_half = (0.5 * (1.0 + cos_theta)).max(0.0).sqrt();
        let beyond_sin = 1.0 - sin_half;
        if beyond_sin > 0.0 && cos_half > 0.0 {
            let radius = sin_half / beyond_sin;
            let tan_half = sin_half / cos_half;
            for entry in [self, previous] {
                limit = limit.min(radius * entry.junction_deviation * entry.accel);
                // The rounding circle may touch no move beyond its middle.
                limit = limit.min(0.5 * entry.whole_length() * entry.accel * tan_half);
            }
        }
        for (axis, motor) in motors.iter().enumerate() {
            let jump = match axis {
                EXTRUDER => extrusion_jump,
                _ => (after[axis] - before[axis]).abs(),
            };
            if let (Some(motor), true) = (motor, jump > 0.0) {
                let speed = motor.start().0 / jump;
                limit = limit.min(speed * speed);
                // On a curve the motor is asked for what turning takes, however small each corner is.
                let bend = jump / (0.5 * (self.whole_length() + previous.whole_length()));
                let share = self.shares[axis].abs().max(previous.shares[axis].abs());
                limit = motor.bend_limit(limit, bend, share, false);
                bends[axis] = bend;
            }
        }
        limit
    }

    /// The direction of its path at its start or at its end.
    fn heading(&self, at_end: bool) -> Vector3<f64> {
        self.bend.map_or_else(|| self.direction.xyz(), |bend| bend.tangent(at_end).into())
    }

    /// Its length, or that of the arc that it is a piece of.
    fn whole_length(&self) -> f64 {
        self.bend.map_or(self.length, |bend| bend.arc_length.max(self.length))
    }
}

/// The highest speed along the path, up to `velocity`, at which none of the motors resonates.
fn calm(mut velocity: f64, shares: &Vector4<f64>, motors: &[Option<MotorAbility>]) -> f64 {
    // What is calm for one motor may lie in a band of another. Each round leaves one band or more for good.
    let bands: usize = motors.iter().flatten().map(|motor| motor.bands().len()).sum();
    for _ in 0..bands {
        let before = velocity;
        for (motor, share) in motors.iter().zip(shares.iter()) {
            let (Some(motor), true) = (motor, *share != 0.0) else { continue };
            let speed = velocity * share.abs();
            let calm = motor.calm(speed);
            if calm < speed {
                velocity = calm / share.abs();
            }
        }
        if velocity >= before {
            break;
        }
    }
    velocity
}

/// The highest speed along an arc, up to `top`: turning asks for v² times the curvature, of the path and of each axis.
fn turning_velocity(
    bend: &Bend,
    limits: &Limits,
    motors: &[Option<MotorAbility>],
    shares: &Vector4<f64>,
    top: f64,
) -> f64 {
    let mut v2 = top * top;
    let mut hold = |accel: f64, curvature: f64| {
        if curvature > 0.0 {
            v2 = v2.min(accel / curvature);
        }
    };
    let curvatures = bend.curvatures();
    hold(limits.max_accel.0, bend.curvature());
    hold(limits.max_xy_accel[0].0, curvatures.x);
    hold(limits.max_xy_accel[1].0, curvatures.y);
    hold(limits.max_z_accel.0, curvatures.z);
    for (axis, motor) in motors.iter().take(EXTRUDER).enumerate() {
        if let (Some(motor), true) = (motor, curvatures[axis] > 0.0) {
            v2 = motor.bend_limit(v2, curvatures[axis], shares[axis].abs(), false);
        }
    }
    v2.sqrt()
}

/// Length of a vector. Not nalgebra's `norm`: this is exactly rounded the same way on every platform.
fn norm(v: &Vector3<f64>) -> f64 {
    (v.x * v.x + v.y * v.y + v.z * v.z).sqrt()
}
