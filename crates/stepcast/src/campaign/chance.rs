//! Seeded chance: the same seed gives the same campaign.

use std::ops::Range;

use rand_pcg::{Pcg32, rand_core::Rng};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Chance(Pcg32);

impl Chance {
    /// The stream of this number for a seed.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        // SplitMix64's finaliser makes neighbouring seeds unrelated.
        let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self(Pcg32::new(z ^ (z >> 31), stream))
    }

    /// Evenly spread over 0..1.
    pub(crate) fn part(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / (f64::from(u32::MAX) + 1.0)
    }

    /// Evenly spread over a range.
    pub(crate) fn between(&mut self, range: Range<f64>) -> f64 {
        range.start + (range.end - range.start) * self.part()
    }

    /// Spread so that each order of magnitude of a range is as likely as the others.
    pub(crate) fn magnitude(&mut self, range: Range<f64>) -> f64 {
        libm::exp(self.between(libm::log(range.start)..libm::log(range.end)))
    }

    /// A number below `end`, which is not 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.part() * end as f64) as usize
    }

    /// One of these, of which there is at least one.
    pub(crate) fn pick<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}
