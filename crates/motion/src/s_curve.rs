//! One rise and fall of speed with a limited jerk: from one speed to another over a length.
//!
//! Where the path goes straight on, the acceleration is zero at an end (*smooth*). At a corner the motors' speeds jump anyway,
//! and the acceleration may begin and end as it likes (*free*).
//!
//! A ramp that is smooth at both of its ends takes Δ/a + a/j for the change of speed Δ where that is large enough to get to
//! the acceleration a, and 2·√(Δ/j) otherwise; the way is the mean of the two speeds times that. Source: L. Biagiotti and C.
//! Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008, section 3.4 (double S).
//!
//! mm, mm/s, mm/s², mm/s³, seconds.

use crate::planned::Phase;

/// Halvings in the search for a top speed: beyond it nothing changes in the last bit.
const HALVINGS: u32 = 60;

/// What holds along a stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub(crate) accel: f64,
    pub(crate) jerk: f64,
}

/// A speed at an end of a stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct End {
    pub(crate) speed: f64,
    /// Whether the acceleration may jump there.
    pub(crate) is_free: bool,
}

/// A ramp between a low and a high speed, in time from the low one up.
#[derive(Clone, Copy, Debug, Default)]
struct Ramp {
    /// How long the acceleration rises from zero …
    low_bend: f64,
    /// … is constant …
    even: f64,
    /// … and falls.
    high_bend: f64,
    /// The constant acceleration.
    accel: f64,
    low: f64,
}

impl Ramp {
    /// Its pieces as (duration, speed, acceleration, jerk), from the low speed up.
    fn pieces(&self, jerk: f64) -> [(f64, f64, f64, f64); 3] {
        let bent = if self.low_bend > 0.0 { 0.5 * self.accel * self.low_bend } else { 0.0 };
        let (after_low, after_even) = (self.low + bent, self.low + bent + self.accel * self.even);
        [
            (self.low_bend, self.low, 0.0, jerk),
            (self.even, after_low, self.accel, 0.0),
            (self.high_bend, after_even, self.accel, -jerk),
        ]
    }

    fn way(&self, jerk: f64) -> f64 {
        let way = |(time, speed, accel, jerk): (f64, f64, f64, f64)| {
            (speed + (0.5 * accel + jerk / 6.0 * time) * time) * time
        };
        self.pieces(jerk).into_iter().map(way).sum()
    }
}

impl Limits {
    /// The ramp between two speeds; smooth at the higher one, or as the lower end is.
    fn ramp(&self, low: End, high: f64) -> Ramp {
        let Self { accel, jerk } = *self;
        let change = (high - low.speed).max(0.0);
        if low.is_free {
            let accel = accel.min((2.0 * change * jerk).sqrt());
            let high_bend = accel / jerk;
            let even = if accel > 0.0 { (change / accel - 0.5 * high_bend).max(0.0) } else { 0.0 };
            return Ramp { low_bend: 0.0, even, high_bend, accel, low: low.speed };
        }
        let accel = accel.min((change * jerk).sqrt());
        let bend = accel / jerk;
        let even = if accel > 0.0 { (change / accel - bend).max(0.0) } else { 0.0 };
        Ramp { low_bend: bend, even, high_bend: bend, accel, low: low.speed }
    }

    /// The ramp from a free low end to a free high one with this much of its high bend, 0 ..= 1 of the whole.
    fn cut_ramp(&self, low: f64, high: f64, share: f64) -> Ramp {
        let change = (high - low).max(0.0);
        let whole = self.accel.min((2.0 * change * self.jerk).sqrt()) / self.jerk;
        let high_bend = share * whole;
        let bent = (self.accel - 0.5 * self.jerk * high_bend) * high_bend;
        if bent <= change {
            let even = (change - bent) / self.accel;
            return Ramp { low_bend: 0.0, even, high_bend, accel: self.accel, low };
        }
        // No part of it is even.
        let accel = change / high_bend + 0.5 * self.jerk * high_bend;
        Ramp { low_bend: 0.0, even: 0.0, high_bend, accel, low }
    }

    /// The way that a change from a lower end to a speed takes whose acceleration is zero.
    pub(crate) fn way(&self, low: End, high: f64) -> f64 {
        self.ramp(low, high).way(self.jerk)
    }

    /// The shortest way between two ends.
    fn way_between(&self, one: End, other: End) -> f64 {
        let (low, high) = if one.speed <= other.speed { (one, other) } else { (other, one) };
        if low.is_free && high.is_free {
            return (high.speed * high.speed - low.speed * low.speed) / (2.0 * self.accel);
        }
        self.way(low, high.speed)
    }

    /// The longest way that slowing down from a speed to any that is not above `limit` takes, smooth at both ends; none
    /// where that is no slowing down. The way is longest for the speed at which its derivative vanishes: a²/2j for long
    /// changes, a third of the speed for short ones.
    pub(crate) fn way_down_max(&self, from: f64, limit: f64) -> f64 {
        if limit > from {
            return 0.0;
        }
        let turning = self.accel * self.accel / (2.0 * self.jerk);
        [0.0, limit, turning.min(limit), (from / 3.0).min(limit)]
            .into_iter()
            .fold(0.0, |longest, speed| longest.max(self.way(End { speed, is_free: false }, from)))
    }

    /// The speed of an end that slowing down at once from a speed leads to after `length`; where one could come to rest
    /// before, that from which the way is longest.
    pub(crate) fn brake(&self, start: End, end: End, length: f64) -> f64 {
        let way = |speed: f64| self.way_between(start, End { speed, ..end });
        let turning = (self.accel * self.accel / (2.0 * self.jerk)).min(start.speed);
        let third = start.speed / 3.0;
        let longest = if way(turning) > way(third) { turning } else { third };
        let at = |share: f64| start.speed - share * (start.speed - longest);
        at(highest(0.0, 1.0, |share| way(at(share)) <= length))
    }

    /// The highest speed of an end, not above what it has, that `length` leads to from a lower one.
    pub(crate) fn reach(&self, from: End, end: End, length: f64) -> f64 {
        highest(from.speed, end.speed, |speed| self.way_between(from, End { speed, ..end }) <= length)
    }

    /// The highest speed, up to `top`, of a stretch between two ends, each of which can be met from the other.
    pub(crate) fn peak(&self, start: End, end: End, length: f64, top: f64) -> f64 {
        let low = start.speed.max(end.speed);
        highest(low, top, |speed| self.way(start, speed) + self.way(end, speed) <= length)
    }

    /// Phases of a stretch that goes up to `peak`, along, and down, appended to `out`; distances from its start.
    pub(crate) fn phases(&self, start: End, peak: f64, end: End, length: f64, out: &mut Vec<Phase>) {
        let mut at = Cursor { distance: 0.0, out };
        let (up, down) = (self.ramp(start, peak), self.ramp(end, peak));
        let ramps = up.way(self.jerk) + down.way(self.jerk);
        if ramps > length && start.is_free && end.is_free {
            // Too short to get to an acceleration of zero at the higher end.
            return self.phases_between(start.speed, end.speed, length, &mut at);
        }
        at.rise(&up, self.jerk);
        if length > ramps && peak > 0.0 {
            at.put((length - ramps) / peak, peak, 0.0, 0.0);
        }
        at.fall(&down, self.jerk);
    }

    /// Straight from one speed to another, both at corners.
    fn phases_between(&self, start: f64, end: f64, length: f64, at: &mut Cursor<'_>) {
        let (low, high) = (start.min(end), start.max(end));
        let share = highest(0.0, 1.0, |share| self.cut_ramp(low, high, share).way(self.jerk) <= length);
        let ramp = self.cut_ramp(low, high, share);
        if end >= start { at.rise(&ramp, self.jerk) } else { at.fall(&ramp, self.jerk) }
    }
}

/// The highest number from `low` to `high` that fits; `low` does.
pub(crate) fn highest(low: f64, high: f64, fits: impl Fn(f64) -> bool) -> f64 {
    if high <= low || fits(high) {
        return high.max(low);
    }
    let (mut low, mut high) = (low, high);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

struct Cursor<'a> {
    distance: f64,
    out: &'a mut Vec<Phase>,
}

impl Cursor<'_> {
    fn rise(&mut self, ramp: &Ramp, jerk: f64) {
        for (duration, velocity, accel, jerk) in ramp.pieces(jerk) {
            self.put(duration, velocity, accel, jerk);
        }
    }

    /// The ramp backward in time.
    fn fall(&mut self, ramp: &Ramp, jerk: f64) {
        for (duration, velocity, accel, jerk) in ramp.pieces(jerk).into_iter().rev() {
            let (end_velocity, end_accel) =
                (velocity + (accel + 0.5 * jerk * duration) * duration, accel + jerk * duration);
            self.put(duration, end_velocity, -end_accel, jerk);
        }
    }

    fn put(&mut self, duration: f64, velocity: f64, accel: f64, jerk: f64) {
        if duration <= 0.0 {
            return;
        }
        let start_distance = self.distance;
        let mut phase = Phase { duration, start_distance, end_distance: 0.0, velocity, accel, jerk };
        phase.end_distance = phase.distance_at(duration);
        self.distance = phase.end_distance;
        self.out.push(phase);
    }
}
