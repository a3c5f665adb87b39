//! Pressure advance: how far the filament is ahead of what is drawn, by its speed.
//!
//! The linear model is `pressure_advance · v`. The two others rise fast at low speeds and slowly at high ones, as Kalico
//! documents them ("Pressure_Advance", nonlinear pressure advance): `linear_advance · v` plus `nonlinear_offset` times
//! `tanh(v / linearization_velocity)` or `1 − 1 / (1 + v / linearization_velocity)`. Between fixed knots they are taken
//! as straight, at most 0.2 % of the offset away: so a path stays a piecewise polynomial.
//!
//! Units: `v` is the filament's speed in mm/s, not negative; the advance is in mm of filament.

use crate::Segment;
use crate::polynomial::sign_changes;
use units::Seconds;

/// Knots lie at `linearization_velocity · (RATIOᵏ − 1)`; beyond the last one the advance goes on as between the last two.
const KNOTS: usize = 64;
const RATIO: f64 = 1.0 + 1.0 / 16.0;

/// How the advance grows with the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Advance {
    /// In proportion.
    Linear {
        /// mm of filament per mm/s, so seconds; 0 is none.
        pressure_advance: f64,
    },
    /// With a hyperbolic tangent.
    Tanh(Nonlinear),
    /// With a reciprocal.
    Reciprocal(Nonlinear),
}

/// The numbers of a nonlinear model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nonlinear {
    /// Seconds.
    pub linear_advance: f64,
    /// mm of filament.
    pub nonlinear_offset: f64,
    /// mm/s of filament, above 0.
    pub linearization_velocity: f64,
}

impl Advance {
    /// None.
    pub const NONE: Self = Self::Linear { pressure_advance: 0.0 };

    /// Whether it is ever anything but 0.
    pub fn is_none(&self) -> bool {
        match *self {
            Self::Linear { pressure_advance } => pressure_advance == 0.0,
            Self::Tanh(model) | Self::Reciprocal(model) => {
                model.linear_advance == 0.0 && model.nonlinear_offset == 0.0
            }
        }
    }

    /// The most that it grows with the speed: mm a mm/s.
    pub fn slope_max(&self) -> Seconds {
        Seconds(match *self {
            Self::Linear { pressure_advance } => pressure_advance,
            Self::Tanh(model) | Self::Reciprocal(model) => {
                model.linear_advance + model.nonlinear_offset / model.linearization_velocity
            }
        })
    }

    /// At speed `v`.
    fn at(&self, v: f64) -> f64 {
        match *self {
            Self::Linear { pressure_advance } => pressure_advance * v,
            Self::Tanh(model) => {
                let share = libm::tanh(v / model.linearization_velocity);
                model.linear_advance * v + model.nonlinear_offset * share
            }
            Self::Reciprocal(model) => {
                let share = 1.0 - 1.0 / (1.0 + v / model.linearization_velocity);
                model.linear_advance * v + model.nonlinear_offset * share
            }
        }
    }
}

/// An [`Advance`] as straight lines over stretches of speed.
#[derive(Clone, Debug)]
pub(crate) struct Lines {
    /// Where each line but the first begins, mm/s.
    knots: Vec<f64>,
    /// Each line: the advance at speed 0 if it went on to there, and its slope.
    lines: Vec<(f64, f64)>,
}

impl Lines {
    pub(crate) fn new(advance: &Advance) -> Self {
        let velocity = match advance {
            Advance::Linear { pressure_advance } => {
                return Self { knots: Vec::new(), lines: vec![(0.0, *pressure_advance)] };
            }
            Advance::Tanh(model) | Advance::Reciprocal(model) => model.linearization_velocity,
        };
        let (mut knots, mut lines) = (Vec::with_capacity(KNOTS), Vec::with_capacity(KNOTS));
        let (mut low, mut factor) = (0.0, 1.0);
        for _ in 0..KNOTS {
            factor *= RATIO;
            let high = velocity * (factor - 1.0);
            let slope = (advance.at(high) - advance.at(low)) / (high - low);
            lines.push((advance.at(low) - slope * low, slope));
            knots.push(high);
            low = high;
        }
        knots.pop();
        Self { knots, lines }
    }

    /// Gives the parts of a filament's `segment` (of degree 3 at most) with the advance added to them.
    pub(crate) fn apply(&self, segment: &Segment, out: &mut impl FnMut(Segment)) {
        let [c1, c2, c3, ..] = segment.powers;
        // Speed at the share u of the time: v₀ + v₁·u + v₂·u².
        let (v1, v2) = (2.0 * c2 * segment.duration, 3.0 * c3 * segment.duration * segment.duration);
        if self.knots.is_empty() {
            return out(self.lift(segment, c1 + v1 + v2));
        }
        let mut low = 0.0;
        while low < 1.0 {
            // Where the speed leaves the stretch that it goes on into from here.
            let next = |knot: f64| {
                let crossings = sign_changes(&[c1 - knot, v1, v2]);
                crossings.as_slice().iter().copied().find(|&at| at > low)
            };
            let high = self.knots.iter().filter_map(|&knot| next(knot)).fold(1.0, f64::min);
            let part = segment.part(low * segment.duration, high * segment.duration);
            let middle = 0.5 * (low + high);
            out(self.lift(&part, c1 + (v1 + v2 * middle) * middle));
            low = high;
        }
    }

    /// A segment with the advance that holds at the speed `v` within it.
    fn lift(&self, segment: &Segment, v: f64) -> Segment {
        let (offset, slope) = self.lines[self.knots.partition_point(|&knot| knot <= v)];
        let [c1, c2, c3, ..] = segment.powers;
        let t = segment.duration;
        let end_speed = c1 + (2.0 * c2 + 3.0 * c3 * t) * t;
        Segment {
            start: segment.start + offset + slope * c1,
            end: segment.end + offset + slope * end_speed,
            powers: [c1 + slope * 2.0 * c2, c2 + slope * 3.0 * c3, c3, 0.0, 0.0],
            ..*segment
        }
    }
}
