//! One rise and fall of speed with a limited jerk: from one speed to another over a length, without acceleration at either
//! end.
//!
//! A change of speed Δ takes Δ/a + a/j where it is large enough to get to the acceleration a, and 2·√(Δ/j) otherwise; the
//! way is the mean of the two speeds times that, for it is symmetric. Source: L. Biagiotti and C. Melchiorri, "Trajectory
//! Planning for Automatic Machines and Robots", 2008, section 3.4 (double S).
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

impl Limits {
    /// How long a change of speed takes.
    fn time(&self, change: f64) -> f64 {
        let Self { accel, jerk } = *self;
        if change * jerk >= accel * accel {
            change / accel + accel / jerk
        } else {
            2.0 * (change / jerk).sqrt()
        }
    }

    /// The way that a change between two speeds takes.
    pub(crate) fn way(&self, from: f64, to: f64) -> f64 {
        0.5 * (from + to) * self.time((to - from).abs())
    }

    /// The longest way that slowing down from a speed to any that is not above `limit` takes; none where that is no slowing
    /// down. The way is longest for the speed at which its derivative vanishes: a²/2j for long changes, a third of the speed
    /// for short ones.
    pub(crate) fn way_down_max(&self, from: f64, limit: f64) -> f64 {
        if limit > from {
            return 0.0;
        }
        let turning = self.accel * self.accel / (2.0 * self.jerk);
        [0.0, limit, turning.min(limit), (from / 3.0).min(limit)]
            .into_iter()
            .fold(0.0, |longest, to| longest.max(self.way(from, to)))
    }

    /// The highest speed, up to `top`, that `length` leads to from `from`.
    pub(crate) fn reach(&self, from: f64, length: f64, top: f64) -> f64 {
        highest(from, top, |speed| self.way(from, speed) <= length)
    }

    /// The highest speed, up to `top`, of a stretch between two others; both can be reached.
    pub(crate) fn peak(&self, start: f64, end: f64, length: f64, top: f64) -> f64 {
        let low = start.max(end);
        highest(low, top, |speed| self.way(start, speed) + self.way(speed, end) <= length)
    }

    /// Phases of a stretch that goes up to `peak`, along, and down, appended to `out`; distances from its start.
    pub(crate) fn phases(&self, start: f64, peak: f64, end: f64, length: f64, out: &mut Vec<Phase>) {
        let mut at = Cursor { distance: 0.0, out };
        self.change(start, peak, &mut at);
        let along = length - at.distance - self.way(peak, end);
        if along > 0.0 && peak > 0.0 {
            at.put(along / peak, peak, 0.0, 0.0);
        }
        self.change(peak, end, &mut at);
    }

    fn change(&self, from: f64, to: f64, at: &mut Cursor<'_>) {
        let change = (to - from).abs();
        if change == 0.0 {
            return;
        }
        let sign = if to > from { 1.0 } else { -1.0 };
        let jerk = sign * self.jerk;
        let accel = self.accel.min((change * self.jerk).sqrt());
        let bend = accel / self.jerk;
        let even = self.time(change) - 2.0 * bend;
        let bent = 0.5 * accel * bend * sign;
        at.put(bend, from, 0.0, jerk);
        if even > 0.0 {
            at.put(even, from + bent, sign * accel, 0.0);
        }
        at.put(bend, to - bent, sign * accel, -jerk);
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
