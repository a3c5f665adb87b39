//! Arithmetic over runs of steps at once: their windows, and which intervals pass all of them.
//!
//! Written over fixed lanes, so that the compiler uses vector instructions where there are any; the results are the same
//! without. Times in ticks. Divisions and roots are those of IEEE 754, so they are the same on every machine.

use crate::stabbing::{has_integer, larger, smaller};

/// Numbers worked on at a time: two registers of SSE2.
const LANES: usize = 4;
type Lanes = [f64; LANES];

/// Successive steps one way, with what each may be off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps<'a> {
    /// Clock of the step before the first, a whole number.
    pub(crate) base: f64,
    /// True times.
    pub(crate) times: &'a [f64],
    /// How early or late each may come; as many.
    pub(crate) errors: &'a [f64],
}

/// The numbers of the steps in a chunk of lanes, from 1.
const NUMBERS: Lanes = [1.0, 2.0, 3.0, 4.0];

#[inline]
fn map(a: Lanes, f: impl Fn(f64) -> f64) -> Lanes {
    core::array::from_fn(|lane| f(a[lane]))
}

#[inline]
fn map2(a: Lanes, b: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
    core::array::from_fn(|lane| f(a[lane], b[lane]))
}

impl Steps<'_> {
    /// The first `count` of them.
    pub(crate) fn first(&self, count: usize) -> Self {
        Self { times: &self.times[..count], errors: &self.errors[..count], ..*self }
    }

    /// The lowest and the highest interval (not whole) with which step number `k` comes within its window, for this `add`.
    fn bounds(&self, k: f64, time: f64, error: f64, add: f64) -> (f64, f64) {
        let (middle, inverse, rise) = (time - self.base, 1.0 / k, 0.5 * add * (k - 1.0));
        ((middle - error) * inverse - rise, (middle + error) * inverse - rise)
    }

    /// The intervals that pass all windows with this `add`: none where the first is above the second.
    pub(crate) fn intervals(&self, add: f64) -> (f64, f64) {
        let (mut lows, mut highs) = ([1.0; LANES], [f64::INFINITY; LANES]);
        let mut numbers = NUMBERS;
        let (times, late_times) = self.times.as_chunks::<LANES>();
        let (errors, late_errors) = self.errors.as_chunks::<LANES>();
        let (base, half) = (self.base, 0.5 * add);
        for (&times, &errors) in times.iter().zip(errors) {
            let middles = map(times, |time| time - base);
            let inverses = map(numbers, |k| 1.0 / k);
            let rises = map(numbers, |k| half * (k - 1.0));
            let low =
                map2(map2(map2(middles, errors, |a, b| a - b), inverses, |a, b| a * b), rises, |a, b| a - b);
            let high =
                map2(map2(map2(middles, errors, |a, b| a + b), inverses, |a, b| a * b), rises, |a, b| a - b);
            lows = map2(low, lows, larger);
            highs = map2(high, highs, smaller);
            numbers = map(numbers, |k| k + LANES as f64);
        }
        for ((&time, &error), &k) in late_times.iter().zip(late_errors).zip(&numbers) {
            let (low, high) = self.bounds(k, time, error, add);
            lows[0] = larger(low, lows[0]);
            highs[0] = smaller(high, highs[0]);
        }
        (lows.into_iter().fold(1.0, larger), highs.into_iter().fold(f64::INFINITY, smaller))
    }

    /// As many of the first steps as one whole interval passes with this `add`, and its range.
    pub(crate) fn prefix(&self, add: f64) -> (usize, (f64, f64)) {
        let mut reached = (1.0, f64::INFINITY);
        for (index, (&time, &error)) in self.times.iter().zip(self.errors).enumerate() {
            let (low, high) = self.bounds((index + 1) as f64, time, error, add);
            let next = (larger(reached.0, low), smaller(reached.1, high));
            if !has_integer(next.0, next.1) {
                return (index, reached);
            }
            reached = next;
        }
        (self.times.len(), reached)
    }

    /// Whether all of them come within their windows with this `interval` and `add`, and whether any is farther than `record`
    /// from its time.
    pub(crate) fn check(&self, interval: f64, add: f64, record: f64) -> (bool, bool) {
        let (base, half) = (self.base, 0.5 * add);
        let (mut beyond, mut farther) = (0, 0);
        for (index, (&time, &error)) in self.times.iter().zip(self.errors).enumerate() {
            let off = off(index, time, interval, half, base);
            beyond |= (error - off).to_bits();
            farther |= (record - off).to_bits();
        }
        (!has_sign(beyond), has_sign(farther))
    }

    /// How far the farthest of them is from its time with this `interval` and `add`.
    pub(crate) fn worst(&self, interval: f64, add: f64) -> f64 {
        let off = |(index, &time): (usize, &f64)| off(index, time, interval, 0.5 * add, self.base);
        self.times.iter().enumerate().map(off).fold(0.0, larger)
    }
}

/// How far step `index` (from 0) is from its time. Whole numbers and halves: exact in any order.
#[inline]
fn off(index: usize, time: f64, interval: f64, half_add: f64, base: f64) -> f64 {
    let before = f64::from(index as i32);
    ((before + 1.0) * (interval + half_add * before) + base - time).abs()
}

/// Whether any of the numbers whose bits these are together was negative.
fn has_sign(bits: u64) -> bool {
    bits >> 63 != 0
}

/// What the gaps between steps are held against.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaps {
    pub(crate) shortest: f64,
    pub(crate) longest: f64,
    /// The shortest there has been.
    pub(crate) record: f64,
}

/// Appends what each step but the first and the last of `times` may be off: at most `max_error`, and `share` of the gap to
/// either neighbour. Returns whether all gaps between them are within the limits, and whether there is one below the record.
pub(crate) fn append_errors(
    times: &[f64],
    max_error: f64,
    share: f64,
    limits: &Gaps,
    errors: &mut Vec<f64>,
) -> (bool, bool) {
    let &[first, second, ..] = times else { return (true, false) };
    let Gaps { shortest, longest, record } = *limits;
    let beyond = |gap: f64| (gap - shortest).to_bits() | (longest - gap).to_bits();
    let (mut outside, mut lower) = (beyond(second - first), (second - first - record).to_bits());
    let (before, now, after) = (&times[..times.len() - 2], &times[1..times.len() - 1], &times[2..]);
    let known = errors.len();
    errors.resize(known + after.len(), 0.0);
    let known = &mut errors[known..];
    for (((error, &before), &now), &after) in known.iter_mut().zip(before).zip(now).zip(after) {
        let gap = after - now;
        outside |= beyond(gap);
        lower |= (gap - record).to_bits();
        *error = smaller(share * smaller(now - before, gap), max_error);
    }
    (!has_sign(outside), has_sign(lower))
}

/// The shortest gap between successive times.
pub(crate) fn shortest_gap(times: &[f64]) -> f64 {
    times.array_windows().map(|[before, after]| after - before).fold(f64::INFINITY, smaller)
}

/// Appends `f(0)`, `f(1)`, … `f(count − 1)`.
pub(crate) fn append_each(count: u32, f: impl Fn(f64) -> f64, out: &mut Vec<f64>) {
    let known = out.len();
    out.resize(known + count as usize, 0.0);
    for (index, value) in out[known..].iter_mut().enumerate() {
        *value = f(f64::from(index as i32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn in_lanes_it_is_what_it_is_one_by_one(
            steps in proptest::collection::vec((1.0..500.0_f64, 0.0..100.0_f64), 0..40),
            (add, interval) in (-20..20_i32, 1..500_i32),
        ) {
            let mut clock = 1e9;
            let times: Vec<f64> = steps.iter().map(|step| { clock += step.0; clock }).collect();
            let errors: Vec<f64> = steps.iter().map(|step| step.1).collect();
            let steps = Steps { base: 1e9, times: &times, errors: &errors };
            let (add, interval) = (f64::from(add), f64::from(interval));
            let (mut low, mut high, mut worst) = (1.0_f64, f64::INFINITY, 0.0_f64);
            let mut is_within = true;
            for (index, (time, error)) in times.iter().zip(&errors).enumerate() {
                let k = (index + 1) as f64;
                let bounds = steps.bounds(k, *time, *error, add);
                (low, high) = (low.max(bounds.0), high.min(bounds.1));
                worst = worst.max((k * interval + add * k * (k - 1.0) / 2.0 - (time - 1e9)).abs());
                let off = (k * interval + add * k * (k - 1.0) / 2.0 - (time - 1e9)).abs();
                is_within &= off <= *error;
                let within = (interval - bounds.0).min(bounds.1 - interval) * k;
                prop_assert!((within - (error - off)).abs() < 1e-6);
            }
            prop_assert_eq!(steps.intervals(add), (low, high));
            let found = steps.worst(interval, add);
            prop_assert!((found - worst).abs() < 1e-6, "{} {}", found, worst);
            prop_assert_eq!(steps.check(interval, add, found), (is_within, false));
            prop_assert_eq!(steps.check(interval, add, 0.9 * found), (is_within, found > 0.0));
            let (count, range) = steps.prefix(add);
            prop_assert_eq!(steps.first(count).intervals(add), range);
            prop_assert!(count == times.len() || !has_integer_in(steps.first(count + 1).intervals(add)));
            let mut made = Vec::new();
            let limits = Gaps { shortest: 2.0, longest: 450.0, record: 20.0 };
            let found = append_errors(&times, 80.0, 0.25, &limits, &mut made);
            let by_hand: Vec<f64> =
                times.windows(3).map(|t| 80.0_f64.min(0.25 * (t[1] - t[0]).min(t[2] - t[1]))).collect();
            prop_assert_eq!(made, by_hand);
            let all: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
            let shortest = all.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert_eq!(found, (all.iter().all(|gap| (2.0..=450.0).contains(gap)), shortest < 20.0));
            prop_assert_eq!(shortest_gap(&times), shortest);
            let mut squares = vec![7.0];
            append_each(times.len() as u32, |index| index * index, &mut squares);
            let by_hand: Vec<f64> = [7.0].into_iter().chain((0..times.len()).map(|i| (i * i) as f64)).collect();
            prop_assert_eq!(squares, by_hand);
        }
    }

    fn has_integer_in((low, high): (f64, f64)) -> bool {
        has_integer(low, high)
    }
}
