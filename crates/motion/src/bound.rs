//! The least time in which moves could run under the same model, to hold the look-ahead against.
//!
//! Forward and backward over a fine grid of the whole path (J. E. Bobrow, S. Dubowsky and J. S. Gibson, "Time-Optimal
//! Control of Robotic Manipulators Along Specified Paths", 1985; K. Shin and N. McKay, same year): the highest speed at every
//! point that the points behind and before it can be reached from. Shares the model's numbers with the look-ahead and none of
//! its code: corners are worked out from their angle, torque from the table itself instead of its staircase.
//!
//! Knows no minimum cruise ratio: that costs time on purpose. Holds all moves between two stops; a measure, not for printing.
//! Lengths in mm, times in s, squared speeds in mm²/s².

mod curve;

use crate::motor::{Demand, MotorAbility, TURNING_SHARE};
use crate::{Bend, Limits, MoveRequest};
use curve::Curve;
use units::Seconds;

/// The most moves that are kept at once: beyond it the path is cut, which only the moves next to the cut notice.
const MOVES_MAX: usize = 4_000_000;
/// The longest cell of the grid.
const CELL_MM_MAX: f64 = 0.1;
/// A move has this many cells at least …
const CELLS_MIN: u32 = 64;
/// … and at most.
const CELLS_MAX: u32 = 2_000;
/// Shorter moves are none.
const LENGTH_MIN_MM: f64 = 1e-9;

/// What a curve asks of the axes: the change of their shares per mm, at squared speeds up to the last number.
type Turn = ([f64; 4], f64);

/// A move as the bound sees it.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// The directions at its start and at its end.
    headings: [[f64; 4]; 2],
    /// The most that each coordinate changes per mm.
    shares: [f64; 4],
    length: f64,
    /// Length of the arc that it is part of, or its own.
    whole: f64,
    /// It goes on with the arc of the move before.
    continues: bool,
    bends: bool,
    /// The turns at its start, all along it and at its end.
    turns: [Turn; 3],
    travels: bool,
    cruise_v2: f64,
    accel: f64,
    /// The highest squared speed at its start.
    corner_v2: f64,
    /// Corner rules of its own limits.
    deviation: f64,
    extruder_jump: f64,
    /// What its motors may jump by, squared.
    rest_v2: f64,
}

/// Adds up the least time of runs of motion.
#[derive(Clone, Debug, Default)]
pub struct Bound {
    motors: Vec<Option<MotorAbility>>,
    ways: Vec<Way>,
    at: Option<[f64; 4]>,
    total: f64,
}

impl Bound {
    /// For a machine with these motors, as in [`crate::LookAhead::with_motors`].
    pub fn new(motors: Vec<Option<MotorAbility>>) -> Self {
        // Where nothing is known of any motor, none starts with a jump.
        let motors = if motors.iter().any(Option::is_some) { motors } else { Vec::new() };
        Self { motors, ..Self::default() }
    }

    /// Takes a move under its limits.
    pub fn push(&mut self, request: &MoveRequest, limits: &Limits) {
        self.push_along(request, None, limits);
    }

    /// Takes a move along an arc under its limits.
    pub fn push_along(&mut self, request: &MoveRequest, bend: Option<&Bend>, limits: &Limits) {
        let from = self.at.unwrap_or(request.from);
        let Some(mut way) = self.way(from, request, bend, limits) else { return };
        self.at = Some(request.to);
        way.corner_v2 = way.rest_v2;
        if let Some(before) = self.ways.last() {
            let turn = self.corner(before, &way);
            way.corner_v2 = turn.1;
            way.turns[0] = turn;
            self.ways.last_mut().into_iter().for_each(|before| before.turns[2] = turn);
        }
        if way.corner_v2 == 0.0 || self.ways.len() >= MOVES_MAX {
            self.solve(0.0);
        }
        self.ways.push(way);
    }

    /// Everything pushed so far ends at rest.
    pub fn stop(&mut self) {
        self.solve(self.ways.last().map_or(0.0, |last| last.rest_v2));
        self.at = None;
    }

    /// The machine waits at rest.
    pub fn dwell(&mut self, pause: Seconds) {
        self.stop();
        self.total += pause.0.max(0.0);
    }

    /// The least time of all that has been stopped.
    pub const fn total(&self) -> Seconds {
        Seconds(self.total)
    }

    fn way(
        &self,
        from: [f64; 4],
        request: &MoveRequest,
        bend: Option<&Bend>,
        limits: &Limits,
    ) -> Option<Way> {
        let delta: [f64; 4] = core::array::from_fn(|axis| request.to[axis] - from[axis]);
        let straight = (delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2]).sqrt();
        let curve = bend.filter(|_| straight >= LENGTH_MIN_MM).map(Curve::new);
        let travel = curve.map_or(straight, |curve| curve.length);
        let travels = travel >= LENGTH_MIN_MM;
        let length = if travels { travel } else { delta[3].abs() };
        if length < LENGTH_MIN_MM {
            return None;
        }
        let mut direction: [f64; 4] =
            core::array::from_fn(|axis| if travels || axis == 3 { delta[axis] / length } else { 0.0 });
        let mut headings = [direction; 2];
        if let Some(curve) = &curve {
            direction[..3].copy_from_slice(&curve.shares);
            headings = curve.headings.map(|[x, y, z]| [x, y, z, direction[3]]);
        }
        let mut speed = request.feed.0;
        let mut accel = f64::INFINITY;
        let mut limit = |share: f64, (velocity, acceleration): (f64, f64)| {
            if share != 0.0 {
                speed = speed.min(velocity / share.abs());
                accel = accel.min(acceleration / share.abs());
            }
        };
        if travels {
            limit(1.0, (limits.max_velocity.0, limits.max_accel.0));
            let [x, y] = [0, 1].map(|axis| (limits.max_xy_velocity[axis].0, limits.max_xy_accel[axis].0));
            limit(direction[0], x);
            limit(direction[1], y);
            limit(direction[2], (limits.max_z_velocity.0, limits.max_z_accel.0));
        }
        if let Some(curve) = &curve {
            speed = speed.min(self.turning(curve, limits, speed));
        }
        let extruder = &limits.extruder;
        if direction[3] != 0.0 && (direction[3] < 0.0 || (direction[0] == 0.0 && direction[1] == 0.0)) {
            let share = direction[3].abs();
            speed = speed.min(extruder.max_extrude_only_velocity.0 / share);
            accel = accel.min(extruder.max_extrude_only_accel.0 / share);
        }
        for (motor, share) in self.driven(&direction) {
            speed = speed.min(motor.top().0 / share);
        }
        let speed = self.calm(speed, &direction);
        let rest = self.jump(&direction, extruder.instantaneous_corner_velocity.0).min(speed);
        Some(Way {
            headings,
            shares: direction,
            length,
            whole: bend.map_or(length, |bend| bend.arc_length.max(length)),
            continues: bend.is_some_and(|bend| bend.continues),
            bends: curve.is_some(),
            turns: [
                Turn::default(),
                curve.map_or_else(Turn::default, |Curve { bends: [x, y, z], .. }| {
                    ([x, y, z, 0.0], speed * speed)
                }),
                Turn::default(),
            ],
            travels,
            cruise_v2: speed * speed,
            accel,
            corner_v2: 0.0,
            deviation: limits.junction_deviation_mm(),
            extruder_jump: extruder.instantaneous_corner_velocity.0,
            rest_v2: rest * rest,
        })
    }

    /// The highest speed at which the path, each axis and each motor can turn as an arc does.
    fn turning(&self, curve: &Curve, limits: &Limits, top: f64) -> f64 {
        let [x, y] = limits.max_xy_accel;
        let of_axes = [x.0, y.0, limits.max_z_accel.0];
        let asked = of_axes.iter().zip(curve.bends).chain([(&limits.max_accel.0, curve.curvature)]);
        let mut v2 = asked.filter(|pair| pair.1 > 0.0).fold(top * top, |v2, (a, bend)| v2.min(a / bend));
        for (axis, motor) in self.motors.iter().take(3).enumerate() {
            if let (Some(motor), true) = (motor, curve.bends[axis] > 0.0) {
                v2 = motor.bend_limit(v2, curve.bends[axis], curve.shares[axis], true);
            }
        }
        v2.sqrt()
    }

    /// The speed that a change of direction from rest, or of that size, may begin with: what each motor can jump by. One of
    /// which nothing is known cannot.
    fn jump(&self, change: &[f64; 4], extruder_jump: f64) -> f64 {
        if self.motors.is_empty() {
            return 0.0;
        }
        let unknown = [0.0, 0.0, 0.0, extruder_jump];
        let starts = (0..4).filter(|&axis| change[axis] != 0.0).map(|axis| {
            let start = self.motors[axis].as_ref().map_or(unknown[axis], |motor| motor.start().0);
            start / change[axis].abs()
        });
        starts.fold(f64::INFINITY, f64::min)
    }

    /// Motors with a torque that turn along, and their share.
    fn driven<'a>(&'a self, direction: &'a [f64; 4]) -> impl Iterator<Item = (&'a MotorAbility, f64)> {
        let pairs = self.motors.iter().zip(direction);
        pairs.filter_map(|(motor, share)| Some((motor.as_ref().filter(|_| *share != 0.0)?, share.abs())))
    }

    /// The highest speed along the path at which no motor resonates: down through the bands, from that with the highest end.
    fn calm(&self, speed: f64, direction: &[f64; 4]) -> f64 {
        let along = |(motor, share): (&MotorAbility, f64)| {
            motor.bands().iter().map(|band| [band.0 / share, band.1 / share]).collect::<Vec<_>>()
        };
        let mut bands: Vec<[f64; 2]> = self.driven(direction).flat_map(along).collect();
        bands.sort_by(|a, b| b[1].total_cmp(&a[1]));
        let below = |speed: f64, [low, high]: [f64; 2]| if speed < high { speed.min(low) } else { speed };
        bands.into_iter().fold(speed, below)
    }

    /// The highest squared speed between two moves, by the angle between them, and how the motors' axes turn there.
    fn corner(&self, a: &Way, b: &Way) -> Turn {
        let mut bends = [0.0; 4];
        if !(a.travels && b.travels) {
            return (bends, 0.0);
        }
        let mut v2 = a.cruise_v2.min(b.cruise_v2);
        let (before, after) = (a.headings[1], b.headings[0]);
        let dot: f64 = (0..3).map(|axis| before[axis] * after[axis]).sum();
        let jump = |axis: usize| (before[axis] - after[axis]).abs();
        let speed = b.extruder_jump / jump(3);
        v2 = v2.min(speed * speed);
        if b.continues && a.bends && b.bends && dot > 0.99 {
            return (bends, v2);
        }
        // Half the angle between the two, a right angle where they go straight on.
        let half = 0.5 * (core::f64::consts::PI - libm::acos(dot.clamp(-1.0, 1.0)));
        let (sin, tan) = (libm::sin(half), libm::tan(half));
        for way in [a, b] {
            if sin < 1.0 {
                v2 = v2.min(way.deviation * way.accel * sin / (1.0 - sin));
            }
            v2 = v2.min(0.5 * way.whole * way.accel * tan);
        }
        for (axis, motor) in self.motors.iter().enumerate() {
            let (Some(motor), true) = (motor, jump(axis) > 0.0) else { continue };
            let speed = motor.start().0 / jump(axis);
            v2 = v2.min(speed * speed);
            let share = a.shares[axis].abs().max(b.shares[axis].abs());
            bends[axis] = 2.0 * jump(axis) / (a.whole + b.whole);
            v2 = motor.bend_limit(v2, bends[axis], share, true);
        }
        (bends, v2)
    }

    /// What a move can speed up or slow down by at a squared speed, beside what turning takes.
    fn accel(&self, way: &Way, v2: f64, demand: Demand) -> f64 {
        let speed = v2.sqrt();
        let demand = if way.bends { Demand::Turn } else { demand };
        let mut least = way.accel;
        for (axis, motor) in self.motors.iter().enumerate() {
            let (Some(motor), true) = (motor, way.shares[axis] != 0.0) else { continue };
            let share = way.shares[axis].abs();
            let all = motor.exact(speed * share, demand);
            let asked = way.turns.map(|(bends, until)| bends[axis] * v2.min(until));
            let left = all - asked.into_iter().fold(0.0, f64::max).min(TURNING_SHARE * all);
            least = least.min(left / share);
        }
        least
    }

    /// The same in the middle of a cell that begins with a squared speed: the midpoint rule.
    fn mean_accel(&self, way: &Way, v2: f64, cell: f64, demand: Demand) -> f64 {
        let start = self.accel(way, v2, demand);
        if self.motors.is_empty() { start } else { self.accel(way, v2 + cell * start, demand) }
    }

    /// Adds the least time from the first move, which starts with what its corner allows, to a squared speed at the end of
    /// the last.
    fn solve(&mut self, end_v2: f64) {
        let cells: Vec<u32> = self
            .ways
            .iter()
            .map(|way| ((way.length / CELL_MM_MAX) as u32).clamp(CELLS_MIN, CELLS_MAX))
            .collect();
        let points: usize = cells.iter().map(|&count| count as usize).sum();
        // Backward: from where the speed at each point can still be taken down to what comes.
        let mut speeds = vec![0.0; points + 1];
        let mut next: f64 = end_v2;
        speeds[points] = next;
        let mut point = points;
        for (way, &count) in self.ways.iter().zip(&cells).rev() {
            let cell = way.length / f64::from(count);
            for index in (0..count).rev() {
                point -= 1;
                let limit = if index == 0 { way.corner_v2 } else { way.cruise_v2 };
                next = limit.min(next + 2.0 * cell * self.mean_accel(way, next, cell, Demand::Slow));
                speeds[point] = next;
            }
        }
        // Forward: what can be reached, and the time of each cell.
        let mut here: f64 = speeds[0];
        let mut point = 0;
        let mut time = 0.0;
        for (way, &count) in self.ways.iter().zip(&cells) {
            let cell = way.length / f64::from(count);
            for _ in 0..count {
                point += 1;
                let up = self.accel(way, here, Demand::Speed);
                let there = f64::min(speeds[point], here + 2.0 * cell * up);
                time +=
                    cell_time(cell, [here, there], way.cruise_v2, [up, self.accel(way, there, Demand::Slow)]);
                here = there;
            }
        }
        self.total += time;
        self.ways.clear();
    }
}

/// The least time between two squared speeds: up, perhaps along at the limit, and down.
fn cell_time(length: f64, [start, end]: [f64; 2], cruise: f64, [up, down]: [f64; 2]) -> f64 {
    let peak = (length + start / (2.0 * up) + end / (2.0 * down)) / (0.5 / up + 0.5 / down);
    let top = peak.min(cruise).max(start).max(end);
    let (first, highest, last) = (start.sqrt(), top.sqrt(), end.sqrt());
    let ramps = (top - start) / (2.0 * up) + (top - end) / (2.0 * down);
    let level = (length - ramps).max(0.0);
    let along = if level > 0.0 && highest > 0.0 { level / highest } else { 0.0 };
    (highest - first) / up + (highest - last) / down + along
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExtruderLimits, LookAhead, PlannedMove, Torque};
    use proptest::prelude::*;
    use units::{Mm, MmPerS, MmPerS2};

    fn limits() -> Limits {
        Limits {
            max_velocity: MmPerS(500.0),
            max_accel: MmPerS2(5000.0),
            square_corner_velocity: MmPerS(5.0),
            minimum_cruise_ratio: 0.0,
            max_z_velocity: MmPerS(15.0),
            max_z_accel: MmPerS2(200.0),
            max_xy_velocity: Limits::ANY_VELOCITY,
            max_xy_accel: Limits::ANY_ACCEL,
            junction_deviation: None,
            extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(500.0), MmPerS2(5000.0)),
        }
    }

    /// Time of the plan over the least time. The plan's moves lead to where they say, one as fast as the next.
    fn ratio(points: &[([f64; 4], f64)], limits: Limits, motors: &[Option<MotorAbility>]) -> f64 {
        let mut look_ahead = LookAhead::with_motors(limits, motors.to_vec()).unwrap();
        let mut bound = Bound::new(motors.to_vec());
        let mut from = [0.0; 4];
        let mut velocity = None;
        let mut look_at = |planned: PlannedMove| {
            assert!(velocity.is_none_or(|before| before == planned.start_velocity));
            velocity = Some(planned.end_velocity);
            assert!(planned.gap_mm() < 1e-9 * planned.length.max(1.0), "{planned:?}");
        };
        for &(to, feed) in points {
            let request = MoveRequest { from, to, feed: MmPerS(feed), tag: 0 };
            look_ahead.push(&request).unwrap();
            core::iter::from_fn(|| look_ahead.pop()).for_each(&mut look_at);
            bound.push(&request, &limits);
            from = to;
        }
        look_ahead.flush();
        core::iter::from_fn(|| look_ahead.pop()).for_each(&mut look_at);
        bound.stop();
        look_ahead.print_time().0 / bound.total().0
    }

    fn any_points() -> impl Strategy<Value = Vec<([f64; 4], f64)>> {
        let step = (0.0..core::f64::consts::TAU, 0.05..30.0_f64, -0.5..0.5_f64, 0.0..0.1_f64, 5.0..400.0_f64);
        proptest::collection::vec(step, 1..60).prop_map(|steps| {
            let mut at = [0.0; 4];
            let mut heading = 0.0;
            let point = |(turn, length, rise, filament, feed): (f64, f64, f64, f64, f64)| {
                // Now and then the filament alone.
                if rise < -0.45 {
                    at[3] += 10.0 * (0.05 - filament);
                    return (at, feed);
                }
                // Mostly slight turns, as on a curve.
                heading += if turn < 5.0 { 0.1 * (turn - 2.5) } else { turn };
                let z = if rise > 0.45 { rise } else { 0.0 };
                at = [
                    at[0] + length * libm::cos(heading),
                    at[1] + length * libm::sin(heading),
                    at[2] + z,
                    at[3] + filament * length,
                ];
                (at, feed)
            };
            steps.into_iter().map(point).collect()
        })
    }

    proptest! {
        #[test]
        fn the_plan_is_the_fastest_that_its_limits_allow(
            points in any_points(),
            x_accel in 500.0..20_000.0_f64,
            y_velocity in 20.0..500.0_f64,
            deviation in proptest::option::of(0.0..0.1_f64),
            motors in proptest::sample::select(vec![0_usize, 4]),
        ) {
            let limits = Limits {
                max_xy_accel: [MmPerS2(x_accel), MmPerS2(f64::INFINITY)],
                max_xy_velocity: [MmPerS(f64::INFINITY), MmPerS(y_velocity)],
                junction_deviation: deviation.map(Mm),
                ..limits()
            };
            let ratio = ratio(&points, limits, &[None, None, None, None][..motors]);
            // The sine of nearly straight corners loses half its digits.
            prop_assert!((ratio - 1.0).abs() < 1e-6, "{}", ratio);
        }

        #[test]
        fn with_torque_it_is_nearly_the_fastest(points in any_points(), load in 0.0..0.1_f64, last in 0.05..0.5_f64) {
            let torque = Torque {
                pull_out: vec![(0.0, 0.5), (400.0, 0.48), (1200.0, last.min(0.4)), (3000.0, 0.5 * last.min(0.4))],
                pull_out_slowing: None,
                load,
                inertia: 3e-5,
                margin: 0.6,
                full_steps: 200,
                turn: Mm(40.0),
                resonances: Vec::new(),
            };
            let Ok(ability) = torque.ability() else { return Ok(()) };
            let limits = Limits { max_accel: MmPerS2(100_000.0), ..limits() };
            let ratio = ratio(&points, limits, &[Some(ability.clone()), Some(ability), None, None]);
            prop_assert!((1.0 - 1e-3..1.015).contains(&ratio), "{}", ratio);
        }
    }
}
