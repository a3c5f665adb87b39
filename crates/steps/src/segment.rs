//! Stretches of a path along one axis: position as a polynomial of time.

use motion::PlannedMove;

/// The highest power of time in a [`Segment`].
pub const DEGREE_MAX: usize = 5;

/// A stretch of the path of an axis or a motor: position is `start + c₁·t + c₂·t² + …`, `t` seconds from its start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Segment {
    /// Print time at which it starts, s.
    pub start_time: f64,
    /// How long it lasts, s.
    pub duration: f64,
    /// Position at its start, mm.
    pub start: f64,
    /// Position at its end, mm: exact at the end of a move, so that no rounding is carried on.
    pub end: f64,
    /// The coefficients of t, t², … in mm/s, mm/s², …: the speed at the start, half the acceleration there, and so on.
    pub powers: [f64; DEGREE_MAX],
}

impl Segment {
    /// Nothing moves.
    pub(crate) const fn rest(start_time: f64, duration: f64, position: f64) -> Self {
        Self { start_time, duration, start: position, end: position, powers: [0.0; DEGREE_MAX] }
    }

    /// Print time at which it ends, s.
    pub const fn end_time(&self) -> f64 {
        self.start_time + self.duration
    }

    /// Whether position is at most quadratic in time.
    pub(crate) fn is_quadratic(&self) -> bool {
        self.powers[2] == 0.0 && self.powers[3] == 0.0 && self.powers[4] == 0.0
    }

    /// Whether nothing moves in it.
    pub(crate) fn is_rest(&self) -> bool {
        self.powers == [0.0; DEGREE_MAX]
    }

    /// How far it has gone from its start after `t` seconds, mm.
    pub fn way(&self, t: f64) -> f64 {
        self.powers.iter().rev().fold(0.0, |sum, power| (sum + power) * t)
    }

    /// The part of it from `from` to `to` seconds after its start.
    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        let mut part = *self;
        part.start_time += from;
        part.duration = to - from;
        if from > 0.0 {
            let (way, powers) = shifted(&self.powers, from);
            part.start += way;
            part.powers = powers;
        }
        if to < self.duration {
            part.end = self.start + self.way(to);
        }
        part
    }
}

/// The same polynomial counted from `t` on: how far it has gone by then, and its powers (synthetic division).
fn shifted(powers: &[f64; DEGREE_MAX], t: f64) -> (f64, [f64; DEGREE_MAX]) {
    let mut way = 0.0;
    let mut out = *powers;
    for low in 0..=DEGREE_MAX {
        for index in (low.max(1)..DEGREE_MAX).rev() {
            out[index - 1] += t * out[index];
        }
        if low == 0 {
            way = t * out[0];
        }
    }
    (way, out)
}

/// Appends the path of an axis over a move: it goes `ratio` mm for each mm of the path.
pub(crate) fn segments(planned: &PlannedMove, from: f64, to: f64, ratio: f64, out: &mut impl FnMut(Segment)) {
    let mut start_time = planned.start_time;
    let mut start = from;
    for phase in planned.phases() {
        let end = if phase.end_distance == planned.length { to } else { from + ratio * phase.end_distance };
        let powers = [phase.velocity * ratio, 0.5 * phase.accel * ratio, phase.jerk / 6.0 * ratio, 0.0, 0.0];
        out(Segment { start_time, duration: phase.duration, start, end, powers });
        start_time += phase.duration;
        start = end;
    }
}
