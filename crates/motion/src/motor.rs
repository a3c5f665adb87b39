//! What a motor can do at each speed: from its torque to the acceleration of its axis.
//!
//! A stepper holds its torque up to some rate and loses it above. What is left over the load's torque accelerates the
//! inertia: T(f) − T_L(f) = J·dω/dt. The table of T(f) is linear between its points. For the planner it becomes a staircase
//! that lies below the line everywhere, so that no speed is ever asked for more than the motor has.
//!
//! Source of the formulas: the standard equation of motion of a stepping motor, e.g. T. Kenjo and A. Sugawara, "Stepping
//! Motors and Their Microprocessor Controls", 2nd ed. 1994, ch. 5 (pull-out torque, starting frequency); P. Acarnley,
//! "Stepping Motors: a Guide to Theory and Practice", 4th ed. 2002, ch. 5 and 6.
//!
//! Units: torque N·m, inertia kg·m², rates in full steps a second, speeds in mm/s of the axis.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, TAU};
use thiserror::Error;
use units::{Mm, MmPerS, MmPerS2};

/// The most points of a torque table.
pub const TORQUE_POINTS_MAX: usize = 64;
/// Neighbouring stairs differ by this share of the acceleration, at most …
const STAIR_RATIO: f64 = 0.985;
/// … and there are no more of them than this.
const STAIRS_MAX: usize = 2048;
/// The share of the rate at which a motor starts without a ramp that it is asked for: the rotor swings about the jump, and the
/// ramp that follows needs torque of its own.
const START_SHARE: f64 = 0.25;
/// The most of a motor's acceleration that turning takes: the rest, or more, is left for speeding up and slowing down meanwhile.
pub(crate) const TURNING_SHARE: f64 = 0.5;
/// A motor that has less than this share of its best acceleration left counts as being at its top speed.
const ACCEL_LEFT_MIN: f64 = 0.01;
/// Rounding: the low end of a band, as another move of the same direction has it.
const BAND_EDGE: f64 = 1.0 + 1e-9;

/// Whether a move speeds up or slows down: friction helps the one and hinders the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// Speeding up.
    Speed,
    /// Slowing down.
    Slow,
    /// Either, at any speed up to the one asked for: on a curve an axis slows down while another speeds up.
    Turn,
}

/// A motor with what it drives.
#[derive(Clone, Debug, PartialEq)]
pub struct Torque {
    /// Pull-out torque (N·m) over the rate (full steps a second), rising in rate; from rate 0 on.
    pub pull_out: Vec<(f64, f64)>,
    /// The same for slowing down, where it differs.
    pub pull_out_slowing: Option<Vec<(f64, f64)>>,
    /// Torque of the load, N·m: friction, which helps to slow down.
    pub load: f64,
    /// Inertia of rotor and load, kg·m², as the motor's shaft feels it.
    pub inertia: f64,
    /// The share of the pull-out torque that is asked for, 0 ..= 1. A rotor without damping overshoots: it loses step at a
    /// sudden demand of about 0.72 of its peak.
    pub margin: f64,
    /// Full steps a turn.
    pub full_steps: u32,
    /// How far the axis goes in a turn.
    pub turn: Mm,
    /// Bands of rates (full steps a second) in which the rotor resonates.
    pub resonances: Vec<(f64, f64)>,
}

/// A torque that no motor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TorqueError {
    /// The table is empty, too long, or does not start at rate 0 or rise.
    #[error(
        "the torque table must start at 0 steps/s and rise in rate, with {TORQUE_POINTS_MAX} points at most"
    )]
    Table,
    /// A number that is not finite, or is negative.
    #[error("{0} must be a positive number")]
    NotPositive(&'static str),
    /// The load takes all that the motor has.
    #[error("the load torque leaves nothing to speed up with: lower the load or the margin's reserve")]
    Overloaded,
    /// A band of resonance that is empty or starts at 0.
    #[error("a resonance band must rise and start above 0 steps/s")]
    Resonance,
}

/// An acceleration of the axis (mm/s²) and the squared speed (mm²/s²) up to which the motor has it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stair {
    until_v2: f64,
    accel: f64,
}

/// What a motor can do, as its axis sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct MotorAbility {
    torque: Torque,
    speeding: Vec<Stair>,
    slowing: Vec<Stair>,
    turning: Vec<Stair>,
    top: f64,
    start: f64,
    resonances: Vec<(f64, f64)>,
}

impl Torque {
    /// What the axis can do with this motor.
    pub fn ability(&self) -> Result<MotorAbility, TorqueError> {
        self.check()?;
        let load = |sign: f64| move |torque: f64| self.margin * torque + sign * self.load;
        let top_rate = self.top_rate().ok_or(TorqueError::Overloaded)?;
        let speeding = self.staircase(&self.pull_out, load(-1.0), top_rate);
        let slowing_table = self.pull_out_slowing.as_deref().unwrap_or(&self.pull_out);
        let slowing = self.staircase(slowing_table, load(1.0), top_rate);
        if speeding.is_empty() || slowing.is_empty() {
            return Err(TorqueError::Overloaded);
        }
        Ok(MotorAbility {
            torque: self.clone(),
            turning: least(&speeding, &slowing),
            speeding,
            slowing,
            top: self.mm_per_step() * top_rate,
            start: self.mm_per_step() * self.start_rate().min(top_rate),
            resonances: self
                .resonances
                .iter()
                .map(|&(low, high)| (low * self.mm_per_step(), high * self.mm_per_step()))
                .collect(),
        })
    }

    fn check(&self) -> Result<(), TorqueError> {
        for (value, name) in [
            (self.inertia, "the inertia"),
            (self.margin, "the torque margin"),
            (self.turn.0, "the rotation distance"),
            (f64::from(self.full_steps), "the number of full steps"),
        ] {
            // Written so that NaN fails too.
            if !(value > 0.0 && value.is_finite()) {
                return Err(TorqueError::NotPositive(name));
            }
        }
        if !(self.load >= 0.0 && self.load.is_finite()) {
            return Err(TorqueError::NotPositive("the load torque"));
        }
        if self.margin > 1.0 {
            return Err(TorqueError::NotPositive("the torque margin, at most 1,"));
        }
        for table in [Some(&self.pull_out), self.pull_out_slowing.as_ref()].into_iter().flatten() {
            let is_usable =
                |&(rate, torque): &(f64, f64)| rate.is_finite() && torque >= 0.0 && torque.is_finite();
            let rises = table.windows(2).all(|pair| pair[0].0 < pair[1].0);
            let starts = table.first().is_some_and(|first| first.0 == 0.0);
            if table.len() < 2
                || table.len() > TORQUE_POINTS_MAX
                || !starts
                || !rises
                || !table.iter().all(is_usable)
            {
                return Err(TorqueError::Table);
            }
        }
        let is_band = |&(low, high): &(f64, f64)| low > 0.0 && high > low && high.is_finite();
        if self.resonances.len() > TORQUE_POINTS_MAX || !self.resonances.iter().all(is_band) {
            return Err(TorqueError::Resonance);
        }
        Ok(())
    }

    /// How far the axis goes in a full step, mm.
    fn mm_per_step(&self) -> f64 {
        self.turn.0 / f64::from(self.full_steps)
    }

    /// Acceleration of the axis for a torque at the shaft, mm/s².
    fn accel(&self, torque: f64) -> f64 {
        torque / self.inertia * (self.turn.0 / TAU)
    }

    /// The rate up to which the motor can still speed up; `None` where it cannot at rest.
    fn top_rate(&self) -> Option<f64> {
        let left = |torque: f64| self.margin * torque - self.load;
        let best = self.pull_out.iter().map(|point| left(point.1)).fold(0.0, f64::max);
        let least = best * ACCEL_LEFT_MIN;
        if left(self.pull_out[0].1) <= least {
            return None;
        }
        for pair in self.pull_out.windows(2) {
            let [(f0, t0), (f1, t1)] = [pair[0], pair[1]];
            if left(t1) <= least {
                return Some(f0 + (f1 - f0) * (left(t0) - least) / (left(t0) - left(t1)));
            }
        }
        self.pull_out.last().map(|point| point.0)
    }

    /// The rate at which the loaded motor starts without a ramp: f = √((T − T_L)/(2·J·x)), the inverse of the time in which
    /// its mean torque T takes the rotor along the way x to where the torque curves of two phases cross. That is half a
    /// step, and the mean of a sine from its crest down to there is sin(π/4)/(π/4) of the crest.
    fn start_rate(&self) -> f64 {
        let way = 0.5 * TAU / f64::from(self.full_steps);
        let mean = self.margin * self.pull_out[0].1 * FRAC_1_SQRT_2 / FRAC_PI_4;
        START_SHARE * ((mean - self.load).max(0.0) / (2.0 * self.inertia * way)).sqrt()
    }

    /// Stairs below the line, from rest to the top rate.
    fn staircase(&self, table: &[(f64, f64)], usable: impl Fn(f64) -> f64, top_rate: f64) -> Vec<Stair> {
        let mut stairs: Vec<Stair> = Vec::new();
        let mm = self.mm_per_step();
        let torque_at = |rate: f64| interpolate(table, rate);
        let mut rate = 0.0;
        while rate < top_rate && stairs.len() < STAIRS_MAX {
            let here = usable(torque_at(rate));
            let segment_end = table.iter().map(|point| point.0).find(|&end| end > rate).unwrap_or(top_rate);
            let end = segment_end.min(top_rate);
            let there = usable(torque_at(end));
            // Falling: as far as the stair's ratio allows. Rising: the low end holds.
            let (until, torque) = if there < here * STAIR_RATIO && stairs.len() + 1 < STAIRS_MAX {
                let share = here * (1.0 - STAIR_RATIO) / (here - there);
                (rate + (end - rate) * share, here * STAIR_RATIO)
            } else if here < there * STAIR_RATIO && stairs.len() + 1 < STAIRS_MAX {
                let share = (here / STAIR_RATIO - here) / (there - here);
                (rate + (end - rate) * share, here)
            } else {
                (end, here.min(there))
            };
            if until <= rate {
                break;
            }
            let speed = until * mm;
            stairs.push(Stair { until_v2: speed * speed, accel: self.accel(torque) });
            rate = until;
        }
        stairs
    }
}

/// The least of two staircases up to each speed: falling stairs.
fn least(a: &[Stair], b: &[Stair]) -> Vec<Stair> {
    let mut ends: Vec<f64> = a.iter().chain(b).map(|stair| stair.until_v2).collect();
    ends.sort_by(f64::total_cmp);
    let mut least = f64::INFINITY;
    let mut start = 0.0;
    let mut stairs: Vec<Stair> = Vec::new();
    for until_v2 in ends {
        let accel = at(a, start).0.min(at(b, start).0);
        start = until_v2;
        match stairs.last_mut() {
            Some(last) if accel >= least => last.until_v2 = until_v2,
            _ => stairs.push(Stair { until_v2, accel }),
        }
        least = least.min(accel);
    }
    stairs
}

/// The acceleration just above a squared speed, and the squared speed up to which it is there.
#[inline]
fn at(stairs: &[Stair], v2: f64) -> (f64, f64) {
    let index = stairs.partition_point(|stair| stair.until_v2 <= v2);
    match stairs.get(index) {
        Some(stair) => (stair.accel, stair.until_v2),
        None => (stairs.last().map_or(0.0, |last| last.accel), f64::INFINITY),
    }
}

fn interpolate(table: &[(f64, f64)], rate: f64) -> f64 {
    for pair in table.windows(2) {
        let [(f0, t0), (f1, t1)] = [pair[0], pair[1]];
        if rate <= f1 {
            return t0 + (t1 - t0) * ((rate - f0) / (f1 - f0)).clamp(0.0, 1.0);
        }
    }
    table.last().map_or(0.0, |point| point.1)
}

impl MotorAbility {
    /// The fastest that the axis goes with this motor.
    pub const fn top(&self) -> MmPerS {
        MmPerS(self.top)
    }

    /// What the axis can slow down by at its top speed.
    pub fn slowing_at_top(&self) -> MmPerS2 {
        MmPerS2(self.slowing.last().map_or(0.0, |last| last.accel))
    }

    /// The speed that the axis may jump by.
    pub const fn start(&self) -> MmPerS {
        MmPerS(self.start)
    }

    /// The speeds of the axis (mm/s) between which it shakes.
    pub(crate) fn bands(&self) -> &[(f64, f64)] {
        &self.resonances
    }

    /// The highest speed up to `speed` at which the axis does not shake: outside of all bands.
    pub(crate) fn calm(&self, speed: f64) -> f64 {
        let mut calm = speed;
        // Each pass leaves one band or more for good.
        for _ in 0..=self.resonances.len() {
            let band = self.resonances.iter().find(|&&(low, high)| low * BAND_EDGE < calm && calm < high);
            let Some(&(low, _)) = band else { break };
            calm = low;
        }
        calm
    }

    /// The highest squared speed along the path, up to `limit_v2`, at which the motor can follow a path that bends by `bend`
    /// (change of its share per mm) with its share for that: it takes v²·bend of acceleration, at the speed v·`share`.
    pub(crate) fn bend_limit(&self, limit_v2: f64, bend: f64, share: f64, exact: bool) -> f64 {
        let ability = |v2: f64| {
            if exact {
                self.exact(v2.sqrt() * share, Demand::Turn)
            } else {
                self.at(v2 * share * share, Demand::Turn).0
            }
        };
        crate::s_curve::highest(0.0, limit_v2, |v2| v2 * bend <= TURNING_SHARE * ability(v2))
    }

    /// The acceleration (mm/s²) just above a squared speed, and the squared speed up to which it is there.
    #[inline]
    pub(crate) fn at(&self, v2: f64, demand: Demand) -> (f64, f64) {
        let stairs = match demand {
            Demand::Speed => &self.speeding,
            Demand::Slow => &self.slowing,
            Demand::Turn => &self.turning,
        };
        at(stairs, v2)
    }

    /// What the table itself leaves at a speed, without its staircase; nothing counts as the least that is not nothing.
    pub(crate) fn exact(&self, speed: f64, demand: Demand) -> f64 {
        let torque = &self.torque;
        let rate = speed / torque.mm_per_step();
        let slowing = torque.pull_out_slowing.as_ref().unwrap_or(&torque.pull_out);
        let left = |torque_here: f64, sign: f64| torque.margin * torque_here + sign * torque.load;
        let least = |table: &[(f64, f64)]| {
            let before = table.iter().filter(|point| point.0 < rate).map(|point| point.1);
            before.fold(interpolate(table, rate), f64::min)
        };
        let left = match demand {
            Demand::Speed => left(interpolate(&torque.pull_out, rate), -1.0),
            Demand::Slow => left(interpolate(slowing, rate), 1.0),
            Demand::Turn => left(least(&torque.pull_out), -1.0).min(left(least(slowing), 1.0)),
        };
        torque.accel(left).max(f64::MIN_POSITIVE)
    }

    /// The same in speeds: acceleration of the axis at a speed.
    pub fn accel_at(&self, speed: MmPerS, demand: Demand) -> MmPerS2 {
        MmPerS2(self.at(speed.0 * speed.0, demand).0)
    }
}
