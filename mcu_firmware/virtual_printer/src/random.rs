//! Seeded chance, one independent stream per source, so that turning one source on or off changes no other.
//!
//! Knows nothing of what the numbers are used for.
//! Source: PCG-XSH-RR 64/32 (O'Neill, 2014); seeds are spread with the SplitMix64 finaliser (Steele, 2014).

use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

/// What a stream of chance is for. Each has its own numbers for the same seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Latency of the bytes that come from the host.
    LatencyDown,
    /// Latency of the bytes that go to the host.
    LatencyUp,
    /// Faults on the bytes that come from the host.
    LinkDown,
    /// Faults on the bytes that go to the host.
    LinkUp,
    /// Noise of the converter.
    Noise,
    /// Where rotors go that could go either way.
    Balance,
    /// Contact bounce of one switch.
    Bounce(u8),
}

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(Pcg32);

/// SplitMix64's finaliser: neighbouring seeds become unrelated ones.
fn spread(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The stream of `source` for a seed.
    pub(crate) fn new(seed: u64, source: Source) -> Self {
        let stream = match source {
            Source::LatencyDown => 1,
            Source::LatencyUp => 2,
            Source::LinkDown => 3,
            Source::LinkUp => 4,
            Source::Noise => 5,
            Source::Balance => 6,
            Source::Bounce(index) => 0x100 + u64::from(index),
        };
        Self(Pcg32::new(spread(seed ^ spread(stream)), stream))
    }

    /// A number from 0 up to, but without, 1.
    pub(crate) fn unit(&mut self) -> f64 {
        f64::from(self.0.next_u32()) * (1.0 / 4_294_967_296.0)
    }

    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        probability > 0.0 && self.unit() < probability
    }

    /// A number below `end` (0 where `end` is 0).
    pub(crate) fn below(&mut self, end: u32) -> u32 {
        ((u64::from(self.0.next_u32()) * u64::from(end)) >> 32) as u32
    }

    /// Nearly normally distributed with standard deviation 1: the sum of four uniform numbers, without tails beyond
    /// 3.5, which is what a converter's noise looks like as well.
    pub(crate) fn normal(&mut self) -> f64 {
        const SQRT_3: f64 = 1.732_050_807_568_877_2;
        (self.unit() + self.unit() + self.unit() + self.unit() - 2.0) * SQRT_3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_of_one_seed_differ_and_repeat() {
        let draw = |source| {
            let mut random = Random::new(7, source);
            (0..8).map(|_| random.below(1000)).collect::<Vec<_>>()
        };
        assert_eq!(draw(Source::Noise), draw(Source::Noise));
        assert_ne!(draw(Source::Noise), draw(Source::LinkUp));
        assert_ne!(draw(Source::Bounce(0)), draw(Source::Bounce(1)));
    }

    #[test]
    fn the_noise_has_the_deviation_it_claims() {
        let mut random = Random::new(1, Source::Noise);
        let values: Vec<f64> = (0..100_000).map(|_| random.normal()).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.02, "mean {mean}");
        assert!((variance - 1.0).abs() < 0.02, "variance {variance}");
    }
}
