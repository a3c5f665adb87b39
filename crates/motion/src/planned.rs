//! A move with its place in time: it speeds up, cruises and slows down.

use crate::Bend;
use crate::junction::Entry;
use crate::motor::MotorAbility;

/// Steps in the search for the time at which a place is passed …
const ITERATIONS: u32 = 60;
/// … and how near they get, s.
const TIME_ERROR_S: f64 = 1e-13;

/// A stretch of a move whose acceleration changes evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// How long it lasts, s.
    pub duration: f64,
    /// Path of the move before it, mm.
    pub start_distance: f64,
    /// Path of the move up to its end, mm: the whole length, exactly, for the last one.
    pub end_distance: f64,
    /// Speed at its start, mm/s.
    pub velocity: f64,
    /// Acceleration at its start, mm/s².
    pub accel: f64,
    /// Change of the acceleration, mm/s³.
    pub jerk: f64,
}

impl Phase {
    /// Path of the move `time` seconds after the start of the phase, mm.
    pub fn distance_at(&self, time: f64) -> f64 {
        self.start_distance + (self.velocity + (0.5 * self.accel + self.jerk / 6.0 * time) * time) * time
    }

    /// Speed `time` seconds after the start of the phase, mm/s.
    pub fn velocity_at(&self, time: f64) -> f64 {
        self.velocity + (self.accel + 0.5 * self.jerk * time) * time
    }

    /// When it gets to a distance: it never goes back. Newton's steps where they stay inside, halving where not.
    pub(crate) fn time_at(&self, distance: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.duration);
        let mut time = 0.5 * self.duration;
        for _ in 0..ITERATIONS {
            let ahead = self.distance_at(time) - distance;
            if ahead < 0.0 {
                low = time;
            } else {
                high = time;
            }
            let step = time - ahead / self.velocity_at(time);
            let next = if step > low && step < high { step } else { 0.5 * (low + high) };
            if (next - time).abs() <= TIME_ERROR_S {
                return next;
            }
            time = next;
        }
        time
    }
}

/// One move, planned: it speeds up, cruises and slows down along a straight line or a piece of an arc. Any of the three may take no time.
///
/// Times in seconds of print time (from the start of the run of motion), lengths in mm, speeds in mm/s along the path,
/// accelerations in mm/s².
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedMove {
    /// What the caller gave with the move: the line of the file, say.
    pub tag: u32,
    /// Where it starts: x, y, z, e.
    pub from: [f64; 4],
    /// Where it ends, exactly.
    pub to: [f64; 4],
    /// Change of x, y, z and e per mm of path. The path of a move of the filament alone is the filament's. Where
    /// the path bends, x, y and z are a unit vector from its start to its end: see [`Self::directions`].
    pub direction: [f64; 4],
    /// Length of the path.
    pub length: f64,
    /// Print time at which it starts.
    pub start_time: f64,
    /// How long it speeds up.
    pub accel_time: f64,
    /// How long it cruises.
    pub cruise_time: f64,
    /// How long it slows down.
    pub decel_time: f64,
    /// Speed at its start.
    pub start_velocity: f64,
    /// Its highest speed.
    pub cruise_velocity: f64,
    /// Speed at its end.
    pub end_velocity: f64,
    /// The acceleration of both ramps, positive; where it depends on speed, the strongest that the limits leave.
    pub accel: f64,
    /// The phases of a move whose ramps are not even; `None` where the numbers above say all: see [`Self::phases`].
    pub shape: Option<Box<[Phase]>>,
    /// The path, where it is no straight line.
    pub bend: Option<Box<Bend>>,
}

impl PlannedMove {
    /// Changes of x, y, z and e per mm of path, among which are those at which a motor that follows one coordinate, or two
    /// alike, goes fastest.
    pub fn directions(&self) -> impl Iterator<Item = [f64; 4]> {
        let straight = self.bend.is_none().then_some(self.direction);
        let bent = self.bend.iter().flat_map(|bend| bend.directions());
        straight.into_iter().chain(bent.map(|[x, y, z]| [x, y, z, self.direction[3]]))
    }

    /// The direction of its path in space at its start or at its end.
    pub(crate) fn heading(&self, at_end: bool) -> [f64; 3] {
        let [x, y, z, _] = self.direction;
        self.bend.as_ref().map_or([x, y, z], |bend| bend.tangent(at_end))
    }

    /// How long it takes, in seconds.
    pub const fn duration(&self) -> f64 {
        self.accel_time + self.cruise_time + self.decel_time
    }

    /// Print time at which it ends.
    pub const fn end_time(&self) -> f64 {
        self.start_time + self.duration()
    }

    /// Path driven while a trapezoid speeds up, in mm.
    const fn accel_length(&self) -> f64 {
        0.5 * (self.start_velocity + self.cruise_velocity) * self.accel_time
    }

    /// Path driven while a trapezoid slows down, in mm.
    const fn decel_length(&self) -> f64 {
        0.5 * (self.cruise_velocity + self.end_velocity) * self.decel_time
    }

    /// Its phases, in the order of time; none lasts no time.
    #[inline]
    pub fn phases(&self) -> impl Iterator<Item = Phase> {
        let trapezoid = if self.shape.is_none() { self.trapezoid() } else { [None; 3] };
        trapezoid.into_iter().flatten().chain(self.shape.iter().flatten().copied())
    }

    fn trapezoid(&self) -> [Option<Phase>; 3] {
        let Self { accel_time, cruise_time, decel_time, length, .. } = *self;
        let (has_cruise, has_decel) = (cruise_time > 0.0, decel_time > 0.0);
        let accel_end = if has_cruise || has_decel { self.accel_length() } else { length };
        let cruise_end = if has_decel { length - self.decel_length() } else { length };
        let phase = |duration: f64, range: [f64; 2], velocity: f64, accel: f64| {
            let [start_distance, end_distance] = range;
            (duration > 0.0).then_some(Phase {
                duration,
                start_distance,
                end_distance,
                velocity,
                accel,
                jerk: 0.0,
            })
        };
        let accel_from = if accel_time > 0.0 { accel_end } else { 0.0 };
        let cruise_from = if has_cruise { cruise_end } else { accel_from };
        [
            phase(accel_time, [0.0, accel_end], self.start_velocity, self.accel),
            phase(cruise_time, [accel_from, cruise_end], self.cruise_velocity, 0.0),
            phase(decel_time, [cruise_from, length], self.cruise_velocity, -self.accel),
        ]
    }

    /// The largest gap between where a phase leads to and where it says that it ends, in mm: rounding. All of the way where
    /// there is no phase.
    pub(crate) fn gap_mm(&self) -> f64 {
        let gap = |phase: Phase| (phase.distance_at(phase.duration) - phase.end_distance).abs();
        self.phases().map(gap).reduce(f64::max).unwrap_or(self.length)
    }

    /// Path driven `time` seconds after the start of the move, in mm; its ends outside the move.
    pub fn distance_at(&self, time: f64) -> f64 {
        if time <= 0.0 {
            return 0.0;
        }
        let mut left = time;
        for phase in self.phases() {
            if left < phase.duration {
                return phase.distance_at(left).min(self.length);
            }
            left -= phase.duration;
        }
        self.length
    }

    /// The move between the squared speeds at its start, when it cruises and at its end, all of which the window has made
    /// reachable.
    pub(crate) fn new(
        entry: &Entry,
        motors: &[Option<MotorAbility>],
        [start_v2, cruise_v2, end_v2]: [f64; 3],
        start_time: f64,
    ) -> Self {
        let (start_velocity, cruise_velocity, end_velocity) =
            (start_v2.sqrt(), cruise_v2.sqrt(), end_v2.sqrt());
        let mut planned = Self {
            tag: entry.tag,
            from: entry.from,
            to: entry.to,
            direction: entry.direction.into(),
            length: entry.length,
            start_time,
            accel_time: 0.0,
            cruise_time: 0.0,
            decel_time: 0.0,
            start_velocity,
            cruise_velocity,
            end_velocity,
            accel: entry.accel,
            shape: None,
            bend: entry.bend.map(Box::new),
        };
        if motors.is_empty() {
            planned.shape_trapezoid(start_v2, cruise_v2, end_v2);
        } else {
            planned.shape_stairs(entry, motors, [start_v2, cruise_v2, end_v2]);
        }
        planned
    }

    /// The same move at another time and with other phases, which go from its start to its end.
    pub(crate) fn reshaped(&self, mut phases: Vec<Phase>, start_time: f64) -> Self {
        if let Some(first) = phases.first_mut() {
            first.start_distance = 0.0;
        }
        if let Some(last) = phases.last_mut() {
            last.end_distance = self.length;
        }
        let at_end = |phase: &Phase| phase.velocity_at(phase.duration);
        let time = |is_counted: fn(f64) -> bool| {
            let counted = phases.iter().filter(|phase| is_counted(at_end(phase) - phase.velocity));
            counted.map(|phase| phase.duration).sum::<f64>()
        };
        Self {
            start_time,
            accel_time: time(|change| change > 0.0),
            cruise_time: time(|change| change == 0.0),
            decel_time: time(|change| change < 0.0),
            start_velocity: phases.first().map_or(0.0, |first| first.velocity),
            cruise_velocity: phases.iter().map(|phase| phase.velocity.max(at_end(phase))).fold(0.0, f64::max),
            end_velocity: phases.last().map_or(0.0, at_end),
            shape: Some(phases.into()),
            ..self.clone()
        }
    }

    fn shape_trapezoid(&mut self, start_v2: f64, cruise_v2: f64, end_v2: f64) {
        let half_inverse = 0.5 / self.accel;
        let accel_length = (cruise_v2 - start_v2) * half_inverse;
        let decel_length = (cruise_v2 - end_v2) * half_inverse;
        // Where a move never cruises, rounding may leave a few 1e-16 mm on either side.
        let cruise_length = (self.length - accel_length - decel_length).max(0.0);
        let ramp_time = |length: f64, slow: f64| {
            if length > 0.0 { length / (0.5 * (slow + self.cruise_velocity)) } else { 0.0 }
        };
        let (accel_time, decel_time) =
            (ramp_time(accel_length, self.start_velocity), ramp_time(decel_length, self.end_velocity));
        self.accel_time = accel_time;
        self.cruise_time = if cruise_length > 0.0 { cruise_length / self.cruise_velocity } else { 0.0 };
        self.decel_time = decel_time;
    }

    /// A phase for each stair of the motors' strength.
    fn shape_stairs(&mut self, entry: &Entry, motors: &[Option<MotorAbility>], v2: [f64; 3]) {
        let [start_v2, cruise_v2, end_v2] = v2;
        let mut phases: Vec<Phase> = Vec::new();
        let mut distance = 0.0;
        entry.speeding(motors).stairs(start_v2, cruise_v2, |low_v2, high_v2, accel| {
            let phase = ramp(distance, low_v2.sqrt(), high_v2.sqrt(), accel);
            self.accel_time += phase.duration;
            distance = phase.end_distance;
            phases.push(phase);
        });
        let ups = phases.len();
        let mut down = 0.0;
        entry.slowing(motors).stairs(end_v2, cruise_v2, |low_v2, high_v2, accel| {
            let phase = ramp(0.0, high_v2.sqrt(), low_v2.sqrt(), accel);
            self.decel_time += phase.duration;
            down += phase.end_distance;
            phases.push(phase);
        });
        phases[ups..].reverse();
        let cruise_length = self.length - distance - down;
        // Rounding may leave a few 1e-16 mm on either side.
        if cruise_length > 0.0 && self.cruise_velocity > 0.0 {
            let duration = cruise_length / self.cruise_velocity;
            self.cruise_time = duration;
            let velocity = self.cruise_velocity;
            let cruise = Phase {
                duration,
                start_distance: 0.0,
                end_distance: cruise_length,
                velocity,
                accel: 0.0,
                jerk: 0.0,
            };
            phases.insert(ups, cruise);
        }
        phases.retain(|phase| phase.duration > 0.0);
        let mut distance = 0.0;
        for phase in &mut phases {
            let length = phase.end_distance - phase.start_distance;
            phase.start_distance = distance;
            distance = (distance + length).min(self.length);
            phase.end_distance = distance;
        }
        if let Some(last) = phases.last_mut() {
            last.end_distance = self.length;
        }
        self.shape = Some(phases.into());
    }
}

/// From one speed to another at a constant acceleration.
fn ramp(start_distance: f64, from: f64, to: f64, accel: f64) -> Phase {
    let duration = (to - from).abs() / accel;
    let accel = if to < from { -accel } else { accel };
    let end_distance = start_distance + 0.5 * (from + to) * duration;
    Phase { duration, start_distance, end_distance, velocity: from, accel, jerk: 0.0 }
}
