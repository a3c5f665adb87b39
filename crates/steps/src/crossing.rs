//! When a motor crosses from one grid position to the next: closed form and one square root a step where position is
//! quadratic in time, Newton's method within a bracket where it is of higher degree.

use crate::Segment;
use crate::polynomial::sign_changes;
use crate::segment::DEGREE_MAX;
use crate::stabbing::{larger, smaller};
use crate::windows::append_each;

/// How near two approximations of a step's time are when the last one counts, in shares of its gap to the step before: the
/// error left is about the square of that.
const NEAR_SHARE: f64 = 1e-4;
/// Approximations of one step's time: halvings alone would need as many for the longest piece.
const APPROXIMATIONS_MAX: u32 = 64;

/// A stretch in which a motor moves one way, with the steps that fall into it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Run clock at its start, ticks.
    start: f64,
    /// Ticks.
    duration: f64,
    /// Steps left in this piece.
    pub(crate) steps: u64,
    /// Whether the motor moves towards larger positions.
    pub(crate) forward: bool,
    curve: Curve,
}

#[derive(Clone, Copy, Debug)]
enum Curve {
    Quadratic(Quadratic),
    Higher(Higher),
}

/// Position grows from the start of the piece.
#[derive(Clone, Copy, Debug)]
struct Quadratic {
    /// Way from the start of the piece to its first crossing, in steps.
    way: f64,
    /// Crossings passed.
    passed: f64,
    /// Speed at its start, steps a tick, not negative.
    velocity: f64,
    /// Speed squared.
    velocity2: f64,
    /// Twice the acceleration (four times its half), steps a tick².
    accel_twice: f64,
}

/// A monotone part of a segment, over the share `u` of its time.
#[derive(Clone, Copy, Debug)]
struct Higher {
    /// The coefficients of u, u², …, in steps from the start of the segment.
    powers: [f64; DEGREE_MAX],
    /// The next crossing, in steps from the start of the segment …
    edge: f64,
    /// … and how far the one after is from it: 1 or −1.
    step: f64,
    /// Where the last crossing was, or the part starts: share of time, and steps.
    low: (f64, f64),
    /// Where the part ends.
    high: (f64, f64),
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

/// A monotone stretch: where it starts and ends in time (ticks) and position (steps).
#[derive(Clone, Copy, Debug)]
struct Stretch {
    start: f64,
    duration: f64,
    from: f64,
    to: f64,
}

impl Stretch {
    /// The piece with this stretch's steps, if there are any; `count` is the grid position before and after. `curve` is
    /// given the direction (1 or −1) and the first crossing.
    fn piece(&self, count: &mut i64, out: &mut impl FnMut(Piece), curve: impl FnOnce(f64, f64) -> Curve) {
        let target = nearest_step(self.to);
        let forward = self.to >= self.from;
        // Rounding at the seam of two pieces may put the target a step behind: the next piece then finds it.
        let steps = if forward { target.saturating_sub(*count) } else { count.saturating_sub(target) };
        if steps <= 0 {
            return;
        }
        let sign = if forward { 1.0 } else { -1.0 };
        let curve = curve(sign, *count as f64 + 0.5 * sign);
        *count = target;
        out(Piece { start: self.start, duration: self.duration, steps: steps as u64, forward, curve });
    }
}

impl Grid {
    /// The fastest that the motor moves within `segment`, in steps a tick; a bound where that is not quadratic in time.
    pub(crate) fn peak_rate(&self, segment: &Segment) -> f64 {
        let t = segment.duration;
        let [c1, c2, c3, c4, c5] = segment.powers;
        let peak = if segment.is_quadratic() {
            c1.abs().max((c1 + 2.0 * c2 * t).abs())
        } else if c4 == 0.0 && c5 == 0.0 {
            let turn = -c2 / (3.0 * c3);
            let within = if turn > 0.0 && turn < t { (c1 + c2 * turn).abs() } else { 0.0 };
            c1.abs().max((c1 + (2.0 * c2 + 3.0 * c3 * t) * t).abs()).max(within)
        } else {
            let rest = [2.0 * c2, 3.0 * c3, 4.0 * c4, 5.0 * c5];
            c1.abs() + rest.iter().rev().fold(0.0, |sum, power| (sum + power.abs()) * t)
        };
        peak * self.steps_per_mm / self.ticks_per_s
    }

    /// Appends the pieces of `segment` that hold steps; `count` is the grid position before and after.
    pub(crate) fn split(&self, segment: &Segment, count: &mut i64, out: &mut impl FnMut(Piece)) {
        if !segment.is_quadratic() {
            return self.split_higher(segment, count, out);
        }
        let scale = self.steps_per_mm;
        let start = segment.start_time * self.ticks_per_s;
        let duration = segment.duration * self.ticks_per_s;
        let velocity = segment.powers[0] * scale / self.ticks_per_s;
        let half_accel = segment.powers[1] * scale / (self.ticks_per_s * self.ticks_per_s);
        let (from, to) = (segment.start * scale, segment.end * scale);
        // Where the motor turns back on the way.
        let turn = if half_accel == 0.0 { -1.0 } else { -velocity / (2.0 * half_accel) };
        if turn > 0.0 && turn < duration {
            let top = from + 0.5 * velocity * turn;
            let first = Stretch { start, duration: turn, from, to: top };
            quadratic(&first, velocity, half_accel, count, out);
            let second = Stretch { start: start + turn, duration: duration - turn, from: top, to };
            quadratic(&second, 0.0, half_accel, count, out);
        } else {
            quadratic(&Stretch { start, duration, from, to }, velocity, half_accel, count, out);
        }
    }

    fn split_higher(&self, segment: &Segment, count: &mut i64, out: &mut impl FnMut(Piece)) {
        let start = segment.start_time * self.ticks_per_s;
        let duration = segment.duration * self.ticks_per_s;
        let (from, to) = (segment.start * self.steps_per_mm, segment.end * self.steps_per_mm);
        let mut powers = segment.powers;
        let mut scale = self.steps_per_mm;
        for power in &mut powers {
            scale *= segment.duration;
            *power *= scale;
        }
        let [c1, c2, c3, c4, c5] = powers;
        let turns = sign_changes(&[c1, 2.0 * c2, 3.0 * c3, 4.0 * c4, 5.0 * c5]);
        let mut low = (0.0, 0.0);
        for &u in turns.as_slice().iter().chain(&[1.0]) {
            let high = (u, if u < 1.0 { way(&powers, u) } else { to - from });
            let stretch =
                Stretch { start, duration, from: from + low.1, to: if u < 1.0 { from + high.1 } else { to } };
            stretch.piece(count, out, |step, edge| {
                Curve::Higher(Higher { powers, edge: edge - from, step, low, high })
            });
            low = high;
        }
    }
}

fn quadratic(
    stretch: &Stretch,
    velocity: f64,
    half_accel: f64,
    count: &mut i64,
    out: &mut impl FnMut(Piece),
) {
    stretch.piece(count, out, |sign, edge| {
        let velocity = (sign * velocity).max(0.0);
        Curve::Quadratic(Quadratic {
            way: (sign * (edge - stretch.from)).max(0.0),
            passed: 0.0,
            velocity,
            velocity2: velocity * velocity,
            accel_twice: 4.0 * sign * half_accel,
        })
    });
}

/// `c₁·u + c₂·u² + …`
#[inline]
fn way(powers: &[f64; DEGREE_MAX], u: f64) -> f64 {
    let [c1, c2, c3, c4, c5] = *powers;
    (c1 + (c2 + (c3 + (c4 + c5 * u) * u) * u) * u) * u
}

/// `c₁ + 2·c₂·u + 3·c₃·u² + …`
#[inline]
fn slope(powers: &[f64; DEGREE_MAX], u: f64) -> f64 {
    let [c1, c2, c3, c4, c5] = *powers;
    c1 + (2.0 * c2 + (3.0 * c3 + (4.0 * c4 + 5.0 * c5 * u) * u) * u) * u
}

impl Piece {
    /// Whether the steps come faster than `rate` (steps a tick) on average.
    pub(crate) fn is_faster_than(&self, rate: f64) -> bool {
        let duration = match &self.curve {
            Curve::Quadratic(_) => self.duration,
            Curve::Higher(higher) => self.duration * (higher.high.0 - higher.low.0),
        };
        // A stretch of any length may begin and end on a crossing.
        self.steps as f64 > rate * duration + 2.0
    }

    /// Appends the run clocks (ticks) of the next `count` crossings; moves on to the one after.
    pub(crate) fn append_times(&mut self, count: u32, out: &mut Vec<f64>) {
        self.steps -= u64::from(count);
        let (start, duration) = (self.start, self.duration);
        match &mut self.curve {
            Curve::Quadratic(quadratic) => {
                let curve = *quadratic;
                append_each(count, move |index| start + curve.time(index, duration), out);
                quadratic.passed += f64::from(count);
            }
            Curve::Higher(higher) => out.extend((0..count).map(|_| start + higher.next() * duration)),
        }
    }
}

impl Quadratic {
    /// When the crossing `index` after the next is passed, in ticks from the start of the piece.
    #[inline]
    fn time(&self, index: f64, duration: f64) -> f64 {
        let way = self.way + (self.passed + index);
        // The root of velocity·τ + half_accel·τ² = way that stays exact where either vanishes.
        let root = larger(self.velocity2 + self.accel_twice * way, 0.0).sqrt();
        let time = 2.0 * way / larger(self.velocity + root, f64::MIN_POSITIVE);
        // Rounding must not carry a step beyond the piece that it was counted in.
        smaller(time, duration)
    }
}

impl Higher {
    /// Share of the segment's time.
    #[inline(never)]
    fn next(&mut self) -> f64 {
        let (mut low, mut high) = (self.low.0, self.high.0);
        let mut at = self.guess();
        for _ in 0..APPROXIMATIONS_MAX {
            let beyond = (way(&self.powers, at) - self.edge) * self.step;
            *(if beyond < 0.0 { &mut low } else { &mut high }) = at;
            let newton = at - beyond * self.step / slope(&self.powers, at);
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let moved = (next - at).abs();
            at = next;
            if moved <= NEAR_SHARE * (at - self.low.0) {
                break;
            }
        }
        self.low = (at, self.edge);
        self.edge += self.step;
        at
    }

    /// Where the next crossing is on the parabola through both ends of the part that is left, with its slope at the lower one.
    fn guess(&self) -> f64 {
        let (width, height) = (self.high.0 - self.low.0, self.high.1 - self.low.1);
        let rise = (self.edge - self.low.1) / height;
        let slope = slope(&self.powers, self.low.0) * width / height;
        let root = larger(slope * slope + 4.0 * (1.0 - slope) * rise, 0.0).sqrt();
        let share = 2.0 * rise / (slope + root);
        self.low.0 + width * if (0.0..=1.0).contains(&share) { share } else { 0.5 }
    }
}
