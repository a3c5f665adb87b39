//! When a motor crosses from one grid position to the next: closed form, one square root a step.

use crate::MotorSegment;
use crate::stabbing::{larger, smaller};

/// A stretch in which a motor moves one way, with the steps that fall into it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Run clock at its start, ticks.
    start: f64,
    /// Ticks.
    duration: f64,
    /// Way from the start of the piece to the next crossing, in steps.
    way: f64,
    /// Speed at its start, steps a tick, not negative.
    velocity: f64,
    /// Speed squared.
    velocity2: f64,
    /// Twice the acceleration (four times its half), steps a tick².
    accel_twice: f64,
    /// Steps left in this piece.
    pub(crate) steps: u64,
    /// Whether the motor moves towards larger positions.
    pub(crate) forward: bool,
}

/// How a motor's millimetres and seconds become steps and ticks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) steps_per_mm: f64,
    pub(crate) ticks_per_s: f64,
}

/// The grid position that a motor's position (in steps) belongs to; exactly half-way is the upper one.
pub(crate) fn nearest_step(position: f64) -> i64 {
    libm::floor(position + 0.5) as i64
}

impl Grid {
    /// The fastest that the motor moves within `segment`, in steps a tick.
    pub(crate) fn peak_rate(&self, segment: &MotorSegment) -> f64 {
        let end_velocity = segment.velocity + 2.0 * segment.half_accel * segment.duration;
        segment.velocity.abs().max(end_velocity.abs()) * self.steps_per_mm / self.ticks_per_s
    }

    /// Appends the pieces of `segment` that hold steps; `count` is the grid position before and after.
    pub(crate) fn split(&self, segment: &MotorSegment, count: &mut i64, out: &mut impl FnMut(Piece)) {
        let scale = self.steps_per_mm;
        let start = segment.start_time * self.ticks_per_s;
        let duration = segment.duration * self.ticks_per_s;
        let velocity = segment.velocity * scale / self.ticks_per_s;
        let half_accel = segment.half_accel * scale / (self.ticks_per_s * self.ticks_per_s);
        let (from, to) = (segment.start * scale, segment.end * scale);
        // Where the motor turns back on the way.
        let turn = if half_accel == 0.0 { -1.0 } else { -velocity / (2.0 * half_accel) };
        if turn > 0.0 && turn < duration {
            let top = from + 0.5 * velocity * turn;
            let first = Quadratic { start, duration: turn, from, to: top, velocity, half_accel };
            let rest = duration - turn;
            let second =
                Quadratic { start: start + turn, duration: rest, from: top, to, velocity: 0.0, half_accel };
            first.piece(count, out);
            second.piece(count, out);
        } else {
            Quadratic { start, duration, from, to, velocity, half_accel }.piece(count, out);
        }
    }
}

/// A monotone stretch in steps and ticks.
struct Quadratic {
    start: f64,
    duration: f64,
    from: f64,
    to: f64,
    velocity: f64,
    half_accel: f64,
}

impl Quadratic {
    fn piece(&self, count: &mut i64, out: &mut impl FnMut(Piece)) {
        let target = nearest_step(self.to);
        let forward = self.to >= self.from;
        let sign = if forward { 1.0 } else { -1.0 };
        // Rounding at the seam of two pieces may put the target a step behind: the next piece then finds it.
        let steps = if forward { target.saturating_sub(*count) } else { count.saturating_sub(target) };
        if steps <= 0 {
            return;
        }
        let way = sign * (*count as f64 - self.from) + 0.5;
        let velocity = (sign * self.velocity).max(0.0);
        *count = target;
        out(Piece {
            start: self.start,
            duration: self.duration,
            way: way.max(0.0),
            velocity,
            velocity2: velocity * velocity,
            accel_twice: 4.0 * sign * self.half_accel,
            steps: steps as u64,
            forward,
        });
    }
}

impl Piece {
    /// Whether the steps come faster than `rate` (steps a tick) on average.
    pub(crate) fn is_faster_than(&self, rate: f64) -> bool {
        // A stretch of any length may begin and end on a crossing.
        self.steps as f64 > rate * self.duration + 2.0
    }

    /// Run clock of the next crossing, in ticks; moves on to the one after.
    pub(crate) fn next_time(&mut self) -> f64 {
        // The root of velocity·τ + half_accel·τ² = way that stays exact where either vanishes.
        let root = larger(self.velocity2 + self.accel_twice * self.way, 0.0).sqrt();
        let time = 2.0 * self.way / larger(self.velocity + root, f64::MIN_POSITIVE);
        self.way += 1.0;
        self.steps -= 1;
        // Rounding must not carry a step beyond the piece that it was counted in.
        self.start + smaller(time, self.duration)
    }
}
