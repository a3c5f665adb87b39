//! Input shapers: a few impulses whose vibrations cancel each other, as weights and delays of copies of a path.
//!
//! Sources: N. Singer and W. Seering, "Preshaping Command Inputs to Reduce System Vibration", 1990 (ZV, ZVD, and the
//! residual vibration of any sequence of impulses); W. Singhose, W. Seering and N. Singer, "Residual Vibration Reduction
//! Using Vector Diagrams to Generate Shaped Inputs", 1994 (EI); W. Singhose, L. Porter, T. Tuttle and N. Singer, "Vibration
//! Reduction Using Multi-Hump Input Shapers", 1997 (2HUMP_EI, 3HUMP_EI). MZV is ZV with three impulses over three
//! quarters of a period, as Klipper documents it ("Resonance Compensation"). The tolerance of the EI shapers is 5 %; each
//! half period of the damped oscillation lowers an impulse's weight by its decay.
//!
//! Units: Hz, seconds; damping ratios are shares of the critical damping.

use core::f64::consts::{PI, SQRT_2};
use core::ops::RangeInclusive;
use units::Seconds;

/// The most impulses of a shaper.
const IMPULSES_MAX: usize = 5;
/// Vibration that the EI shapers leave at their frequency.
const TOLERANCE: f64 = 0.05;

/// The frequencies that a shaper can be made for, Hz: the longest shaper takes two periods.
pub const SHAPER_FREQUENCIES: RangeInclusive<f64> = 5.0..=1000.0;
/// The damping ratios that a shaper can be made for.
pub const DAMPING_RATIOS: RangeInclusive<f64> = 0.0..=0.9;

/// The shapers there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaperKind {
    /// Zero vibration.
    Zv,
    /// Modified ZV.
    Mzv,
    /// Zero vibration and derivative.
    Zvd,
    /// Extra insensitive.
    Ei,
    /// Extra insensitive, two humps.
    TwoHumpEi,
    /// Extra insensitive, three humps.
    ThreeHumpEi,
}

impl ShaperKind {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Zv, Self::Mzv, Self::Zvd, Self::Ei, Self::TwoHumpEi, Self::ThreeHumpEi];

    /// What a machine file calls it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Zv => "zv",
            Self::Mzv => "mzv",
            Self::Zvd => "zvd",
            Self::Ei => "ei",
            Self::TwoHumpEi => "2hump_ei",
            Self::ThreeHumpEi => "3hump_ei",
        }
    }

    /// The one of that name, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(name))
    }
}

/// Impulses for one frequency: their weights add up to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaper {
    /// Weight, and time after the first one in seconds.
    impulses: [(f64, f64); IMPULSES_MAX],
    count: usize,
}

impl Shaper {
    /// Against a resonance at `frequency` (Hz; see [`SHAPER_FREQUENCIES`]); none for numbers that are not in range.
    pub fn new(kind: ShaperKind, frequency: f64, damping_ratio: f64) -> Option<Self> {
        if !SHAPER_FREQUENCIES.contains(&frequency) || !DAMPING_RATIOS.contains(&damping_ratio) {
            return None;
        }
        let damped = (1.0 - damping_ratio * damping_ratio).sqrt();
        // The decay over the distance of two impulses, which is this share of a period.
        let share = if kind == ShaperKind::Mzv { 0.375 } else { 0.5 };
        let k = libm::exp(-2.0 * PI * share * damping_ratio / damped);
        let v = TOLERANCE;
        let weights: &[f64] = match kind {
            ShaperKind::Zv => &[1.0, 1.0],
            ShaperKind::Mzv => &[1.0 - 1.0 / SQRT_2, SQRT_2 - 1.0, 1.0 - 1.0 / SQRT_2],
            ShaperKind::Zvd => &[1.0, 2.0, 1.0],
            ShaperKind::Ei => &[0.25 * (1.0 + v), 0.5 * (1.0 - v), 0.25 * (1.0 + v)],
            ShaperKind::TwoHumpEi => {
                let v2 = v * v;
                let x = libm::cbrt(v2 * ((1.0 - v2).sqrt() + 1.0));
                let first = (3.0 * x * x + 2.0 * x + 3.0 * v2) / (16.0 * x);
                &[first, 0.5 - first, 0.5 - first, first]
            }
            ShaperKind::ThreeHumpEi => {
                let first = (1.0 + 3.0 * v + 2.0 * (2.0 * (v * v + v)).sqrt()) / 16.0;
                let second = 0.25 * (1.0 - v);
                &[first, second, 0.5 * (1.0 + v) - 2.0 * first, second, first]
            }
        };
        let mut impulses = [(0.0, 0.0); IMPULSES_MAX];
        let mut decay = 1.0;
        for (index, &weight) in weights.iter().enumerate() {
            impulses[index] = (weight * decay, index as f64 * share / (frequency * damped));
            decay *= k;
        }
        let sum: f64 = impulses.iter().map(|(weight, _)| weight).sum();
        for (weight, _) in &mut impulses {
            *weight /= sum;
        }
        Some(Self { impulses, count: weights.len() })
    }

    /// Weight and time (s, from the first on) of each impulse.
    pub fn impulses(&self) -> &[(f64, f64)] {
        &self.impulses[..self.count]
    }

    /// From the first impulse to the last.
    pub fn duration(&self) -> Seconds {
        Seconds(self.impulses().last().map_or(0.0, |&(_, time)| time))
    }

    /// How far ahead each copy of the path looks, and its weight: centred, so that the shaped path is not late.
    pub(crate) fn taps(&self) -> Vec<(f64, f64)> {
        let mean: f64 = self.impulses().iter().map(|(weight, time)| weight * time).sum();
        self.impulses().iter().map(|&(weight, time)| (mean - time, weight)).collect()
    }

    /// What is left of the vibration of a resonator after a stop: its amplitude when the shaped stop is over, over what it
    /// is without the shaper when the stop is over.
    pub fn residual_vibration(&self, frequency: f64, damping_ratio: f64) -> f64 {
        let omega = 2.0 * PI * frequency;
        let damped = omega * (1.0 - damping_ratio * damping_ratio).sqrt();
        let (mut cosine, mut sine) = (0.0, 0.0);
        for &(weight, time) in self.impulses() {
            let grown = weight * libm::exp(damping_ratio * omega * time);
            cosine += grown * libm::cos(damped * time);
            sine += grown * libm::sin(damped * time);
        }
        let end = self.impulses().last().map_or(0.0, |&(_, time)| time);
        libm::exp(-damping_ratio * omega * end) * (cosine * cosine + sine * sine).sqrt()
    }
}
