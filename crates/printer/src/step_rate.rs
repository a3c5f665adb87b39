//! Whether a motor can step as fast as a move wants it to.
//!
//! Knows speeds and the motors' step distances, not positions. What a motor's driver can follow is bounded by the length
//! of its pulses and by the board's clock ([`machine::motor_speeds_max`]).

use gcode::LineNumber;
use motion::{Limits, PlannedMove};
use steps::{Geometry, Kinematics as _, STRETCH_RATIO_MAX};
use units::{Hertz, MmPerS, Seconds};

use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine::{self, EXTRUDER, MOTORS},
    planner::Position,
};

/// The usual smoothing of pressure advance weighs half of its time, 0.04 s.
const SMOOTHED: Seconds = Seconds(0.02);
/// A speed that is beyond the bound by no more than this share of it is on it: rounding.
const SLACK: f64 = 1e-9;

/// What each motor can follow, as the speed of what it moves.
#[derive(Clone, Copy, Debug)]
pub struct StepRates {
    speed_max: [MmPerS; MOTORS],
    /// Pressure advance adds so much to the filament's speed, mm/s a mm/s² of its acceleration.
    advance: Seconds,
    /// Where each motor's torque ends, where that is known.
    torque_tops: [Option<MmPerS>; MOTORS],
    geometry: Geometry,
    names: [&'static str; MOTORS],
}

impl StepRates {
    /// Of a machine on a board with this clock.
    pub fn new(config: &PrinterConfig, clock: Hertz) -> Self {
        let advance = config.extruder.as_ref().map_or(Seconds::ZERO, |extruder| extruder.advance.slope_max());
        Self {
            speed_max: machine::motor_speeds_max(config, clock),
            advance,
            torque_tops: config.abilities.each_ref().map(|it| it.as_ref().map(motion::MotorAbility::top)),
            geometry: machine::geometry(config),
            names: machine::motor_names(config),
        }
    }

    /// The motor whose torque does not last for a move at this speed, with the speeds that it would have to make and can.
    /// Speeds that the limits do not leave anyway count for nothing.
    pub fn out_of_torque(
        &self,
        from: Position,
        to: Position,
        feed: MmPerS,
        limits: &Limits,
    ) -> Option<(usize, MmPerS, MmPerS)> {
        let delta: [f64; MOTORS] = core::array::from_fn(|motor| (to[motor] - from[motor]).abs());
        let travel = delta[..EXTRUDER].iter().map(|d| d * d).sum::<f64>().sqrt();
        let (length, feed) = if travel > 0.0 {
            (travel, feed.min(limits.max_velocity))
        } else {
            (delta[EXTRUDER], feed.min(limits.extruder.max_extrude_only_velocity))
        };
        let bounds = [
            limits.max_xy_velocity[0],
            limits.max_xy_velocity[1],
            limits.max_z_velocity,
            MmPerS(f64::INFINITY),
        ];
        (0..MOTORS).find_map(|motor| {
            let top = self.torque_tops[motor]?;
            let speed = (feed * (delta[motor] / length)).min(bounds[motor]);
            (speed > top * (1.0 + SLACK)).then_some((motor, speed, top))
        })
    }

    /// Another pressure advance holds, which adds so much.
    pub const fn set_advance(&mut self, advance: Seconds) {
        self.advance = advance;
    }

    /// Refuses what no driver can step, by the highest speed that the limits leave. An extruder that moves along with
    /// the axes is judged when its move is planned: its junctions slow it down.
    pub fn judge_request(
        &self,
        from: Position,
        to: Position,
        feed: MmPerS,
        limits: &Limits,
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        let delta: [f64; MOTORS] = core::array::from_fn(|motor| to[motor] - from[motor]);
        let ways = self.ways(delta, from, to, false);
        let travel = delta[..EXTRUDER].iter().map(|d| d * d).sum::<f64>().sqrt();
        let (length, speed, motors) = if travel > 0.0 {
            (travel, feed.min(limits.max_velocity), 0..EXTRUDER)
        } else {
            let speed = feed.min(limits.extruder.max_extrude_only_velocity);
            (delta[EXTRUDER].abs(), speed, EXTRUDER..MOTORS)
        };
        for motor in motors {
            let share = ways[motor] / length;
            let bound = self.bound(motor, limits);
            let bound = self.torque_tops[motor].map_or(bound, |top| bound.min(top));
            if share > 0.0 && bound.min(speed * share) > self.speed_max[motor] * (1.0 + SLACK) {
                return Err(self.too_fast(motor, speed * share, line.0));
            }
        }
        Ok(())
    }

    /// The highest feed, not above `feed`, that every motor can follow however straight the path is. For moves that are
    /// faster than the file says because the user wants it so: they are slowed down, not refused.
    pub fn slowed(&self, from: Position, to: Position, feed: MmPerS) -> MmPerS {
        let delta: [f64; MOTORS] = core::array::from_fn(|motor| to[motor] - from[motor]);
        let travel = delta[..EXTRUDER].iter().map(|d| d * d).sum::<f64>().sqrt();
        let length = if travel > 0.0 { travel } else { delta[EXTRUDER].abs() };
        let ways = self.ways(delta, from, to, false);
        (0..MOTORS)
            .filter(|&motor| ways[motor] > 0.0)
            .fold(feed, |feed, motor| feed.min(self.speed_max[motor] * (length / ways[motor])))
    }

    /// How far each motor goes where the axes go this way, from one place to another: of a delta's towers no less than
    /// the farthest that they would go in any part of it, scaled up.
    fn ways(&self, way: [f64; MOTORS], from: Position, to: Position, is_bent: bool) -> [f64; MOTORS] {
        match &self.geometry {
            Geometry::Cartesian => way.map(f64::abs),
            Geometry::Linear(linear) => {
                core::array::from_fn(|motor| linear.motor_position(motor, &way).abs())
            }
            Geometry::Delta(delta) => core::array::from_fn(|motor| {
                if motor == EXTRUDER {
                    return way[EXTRUDER].abs();
                }
                let [at_start, at_end] = [from, to].map(|at| delta.stretch_ratio(motor, at[0], at[1]));
                // Between its ends an arc may be farther from a tower than there.
                let ratio = if is_bent { STRETCH_RATIO_MAX } else { at_start.max(at_end) };
                way[2].abs() + libm::hypot(way[0], way[1]) * ratio
            }),
        }
    }

    /// The fastest that the axes' own limits leave a motor; the filament's has none of that kind.
    fn bound(&self, motor: usize, limits: &Limits) -> MmPerS {
        let [x, y] = limits.max_xy_velocity;
        let axes = [x, y, limits.max_z_velocity];
        match &self.geometry {
            _ if motor == EXTRUDER => MmPerS(f64::INFINITY),
            Geometry::Cartesian => axes[motor],
            Geometry::Linear(linear) => {
                let share = |axis: usize| linear.share(motor, axis).abs();
                let follows = (0..EXTRUDER).filter(|&axis| share(axis) > 0.0);
                follows.fold(MmPerS(0.0), |sum, axis| sum + axes[axis] * share(axis))
            }
            Geometry::Delta(_) => MmPerS(f64::INFINITY),
        }
    }

    fn too_fast(&self, motor: usize, speed: MmPerS, line: u32) -> PrinterError {
        let detail = format!("{} at {:.0} mm/s", self.names[motor], speed.0);
        PrinterError::new(ErrorCode::StepRateTooHigh, detail).at_line(line)
    }

    /// What pressure advance adds to a move's speed at most, mm/s along its path: a ramp counts with its acceleration, one
    /// that is shorter than the smoothing with what is left of it.
    fn added(&self, planned: &PlannedMove) -> f64 {
        let change = planned.cruise_velocity - planned.start_velocity.min(planned.end_velocity);
        let accel = planned.phases().map(|phase| phase.accel.abs()).fold(0.0, f64::max);
        self.advance.0 * accel.min(change / SMOOTHED.0)
    }

    /// Refuses a planned move in which a motor would have to step faster than it can.
    /// Where it draws, pressure advance adds to the filament's speed.
    pub fn judge_planned(&self, planned: &PlannedMove) -> Result<(), PrinterError> {
        let draws = planned.direction[EXTRUDER] > 0.0
            && (planned.bend.is_some() || planned.direction[0] != 0.0 || planned.direction[1] != 0.0);
        let shares = |direction| self.ways(direction, planned.from, planned.to, planned.bend.is_some());
        for (motor, share) in
            planned.directions().flat_map(|direction| shares(direction).into_iter().enumerate())
        {
            let added = if draws && motor == EXTRUDER { self.added(planned) } else { 0.0 };
            let speed = MmPerS((planned.cruise_velocity + added) * share);
            if speed > self.speed_max[motor] * (1.0 + SLACK) {
                return Err(self.too_fast(motor, speed, planned.tag));
            }
        }
        Ok(())
    }
}
