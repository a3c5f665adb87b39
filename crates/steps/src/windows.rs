//! Arithmetic over runs of steps at once: their windows, and which intervals pass them.
//!
//! Written over fixed lanes, so that the compiler uses vector instructions where there are any; the results are the same
//! without. Times in ticks. Divisions and roots are those of IEEE 754, so they are the same on every machine.

use crate::stabbing::{Block, Candidate, floor, has_integer, larger, smaller};

/// Numbers worked on at a time: two registers of SSE2.
pub(crate) const LANES: usize = 4;
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

/// The numbers of lanes.
const NUMBERS: Lanes = [0.0, 1.0, 2.0, 3.0];

#[inline]
fn map(a: Lanes, f: impl Fn(f64) -> f64) -> Lanes {
    core::array::from_fn(|lane| f(a[lane]))
}

#[inline]
fn map2(a: Lanes, b: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
    core::array::from_fn(|lane| f(a[lane], b[lane]))
}

/// All of them in one, by halves.
#[inline]
fn reduce(a: Lanes, f: impl Fn(f64, f64) -> f64) -> f64 {
    f(f(a[0], a[2]), f(a[1], a[3]))
}

impl Steps<'_> {
    /// The first `count` of them.
    pub(crate) fn first(&self, count: usize) -> Self {
        Self { times: &self.times[..count], errors: &self.errors[..count], ..*self }
    }

    /// Those from number `count` on, where the last before them comes `end` ticks after the one before the first.
    pub(crate) fn after(&self, count: usize, end: f64) -> Self {
        Self { base: self.base + end, times: &self.times[count..], errors: &self.errors[count..] }
    }

    /// How far the farthest of them is from its time with this `interval` and `add`. Whole numbers and halves: exact in any
    /// order.
    pub(crate) fn worst(&self, interval: f64, add: f64) -> f64 {
        let (base, half) = (self.base, 0.5 * add);
        let off =
            |before: f64, time: f64| ((before + 1.0) * (interval + half * before) - (time - base)).abs();
        let (chunks, late) = self.times.as_chunks::<LANES>();
        let (mut worst, mut numbers) = ([0.0; LANES], NUMBERS);
        for &times in chunks {
            worst = map2(map2(numbers, times, off), worst, larger);
            numbers = map(numbers, |number| number + LANES as f64);
        }
        let offs = numbers.iter().zip(late).map(|(&number, &time)| off(number, time));
        offs.fold(reduce(worst, larger), larger)
    }
}

/// The windows of steps, each divided by the number of its step: upright slits, for lines over that number less one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slits {
    /// Lower ends, and whatever was there before beyond `count`.
    lows: Vec<f64>,
    /// Upper ends.
    highs: Vec<f64>,
    count: usize,
}

impl Slits {
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Slits there are.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Adds the windows up to the one of step `count`.
    pub(crate) fn fill(&mut self, steps: &Steps<'_>, count: usize) {
        let known = self.count;
        self.count = count;
        if self.lows.len() < count {
            self.lows.resize(2 * count, 0.0);
            self.highs.resize(2 * count, 0.0);
        }
        let base = steps.base;
        let (times, late_times) = steps.times[known..count].as_chunks::<LANES>();
        let (errors, late_errors) = steps.errors[known..count].as_chunks::<LANES>();
        let (lows, late_lows) = self.lows[known..count].as_chunks_mut::<LANES>();
        let (highs, late_highs) = self.highs[known..count].as_chunks_mut::<LANES>();
        let mut numbers = map(NUMBERS, |number| number + (known + 1) as f64);
        for (((low, high), &times), &errors) in lows.iter_mut().zip(highs).zip(times).zip(errors) {
            let inverses = map(numbers, |number| 1.0 / number);
            let middles = map(times, |time| time - base);
            *low = map2(map2(middles, errors, |a, b| a - b), inverses, |a, b| a * b);
            *high = map2(map2(middles, errors, |a, b| a + b), inverses, |a, b| a * b);
            numbers = map(numbers, |number| number + LANES as f64);
        }
        for ((((low, high), &time), &error), number) in
            late_lows.iter_mut().zip(late_highs).zip(late_times).zip(late_errors).zip(numbers)
        {
            let (inverse, middle) = (1.0 / number, time - base);
            *low = (middle - error) * inverse;
            *high = (middle + error) * inverse;
        }
    }

    /// Goes on from the last slit that the candidate has passed until it has no whole interval left, or no slits are left.
    #[allow(clippy::inline_always)] // The search lives in these loops.
    #[inline(always)]
    pub(crate) fn pass(&self, candidate: &mut Candidate) -> Option<Block> {
        self.go_on(candidate, self.count)
    }

    /// The same with the first `count` slits alone.
    #[inline(never)]
    pub(crate) fn pass_to(&self, candidate: &mut Candidate, count: usize) -> Option<Block> {
        self.go_on(candidate, count)
    }

    #[allow(clippy::inline_always)] // The search lives in these loops.
    #[inline(always)]
    fn go_on(&self, candidate: &mut Candidate, count: usize) -> Option<Block> {
        let half = 0.5 * candidate.add;
        let first = candidate.passed as usize;
        let (lows, highs) = (&self.lows[first..count], &self.highs[first..count]);
        let from = f64::from(candidate.passed);
        let mut rises = NUMBERS.map(|number| half * (number + from));
        let mut at = *candidate;
        let mut done = 0;
        for (lows, highs) in lows.as_chunks::<LANES>().0.iter().zip(highs.as_chunks::<LANES>().0) {
            let (low, high) = ends(&at, lows, highs, &rises);
            if !has_integer(low, high) {
                break;
            }
            at.reach(low, high, first + done);
            rises = rises.map(|rise| rise + LANES as f64 * half);
            done += LANES;
        }
        let mut rise = rises[0];
        let mut block = None;
        for (&low, &high) in lows[done..].iter().zip(&highs[done..]) {
            let (low, high) = (larger(low - rise, at.low), smaller(high - rise, at.high));
            if !has_integer(low, high) {
                block = Some(if low - at.low > at.high - high { Block::Above } else { Block::Below });
                break;
            }
            at.reach(low, high, first + done);
            rise += half;
            done += 1;
        }
        at.passed = (first + done) as u32;
        *candidate = at;
        block
    }

    /// Which `add` a candidate that is blocked would have to have, at least or at most.
    #[allow(clippy::inline_always)] // The search lives in these loops.
    #[inline(always)]
    pub(crate) fn bound(&self, candidate: &Candidate, block: Block) -> f64 {
        let half = 0.5 * candidate.add;
        let at = candidate.passed as usize;
        let (ends, end, own, from) = match block {
            Block::Above => (&self.highs, candidate.high, self.lows[at], candidate.high_at),
            Block::Below => (&self.lows, candidate.low, self.highs[at], candidate.low_at),
        };
        // The slit that it disagrees with is one of a chunk.
        let mut rise = half * f64::from(from);
        let mut index = from as usize;
        for &value in &ends[from as usize..at - 1] {
            if value - rise == end {
                break;
            }
            rise += half;
            index += 1;
        }
        2.0 * (own - ends[index]) / f64::from((at - index) as i32)
    }

    /// The nearest `add` to the slope between the middles of two slits.
    #[inline]
    pub(crate) fn add(&self, from: usize, to: usize) -> f64 {
        let middle = |index: usize| self.lows[index] + self.highs[index];
        floor((middle(to) - middle(from)) / f64::from((to - from) as i32) + 0.5) as f64
    }
}

/// The interval's range after some more slits.
#[inline]
fn ends(at: &Candidate, lows: &Lanes, highs: &Lanes, rises: &Lanes) -> (f64, f64) {
    let lows = map2(*lows, *rises, |low, rise| low - rise);
    let highs = map2(*highs, *rises, |high, rise| high - rise);
    (larger(reduce(lows, larger), at.low), smaller(reduce(highs, smaller), at.high))
}

/// Appends what each step but the first and the last of `times` may be off: at most `max_error`, and `share` of the gap to
/// either neighbour. There are at least two times.
pub(crate) fn append_errors(times: &[f64], max_error: f64, share: f64, errors: &mut Vec<f64>) {
    errors.extend(times.array_windows().map(|[before, now, after]| {
        let nearer = smaller(now - before, after - now);
        smaller(share * nearer, max_error)
    }));
}

/// The shortest gap between successive times.
pub(crate) fn shortest_gap(times: &[f64]) -> f64 {
    let (before, after) = (times.as_chunks::<LANES>().0, times.get(1..).unwrap_or_default());
    let (after, late) = after.as_chunks::<LANES>();
    let mut shortest = [f64::INFINITY; LANES];
    for (before, after) in before.iter().zip(after) {
        shortest = map2(map2(*after, *before, |after, before| after - before), shortest, smaller);
    }
    let late = times[times.len() - late.len() - 1..].array_windows().map(|[before, after]| after - before);
    late.fold(reduce(shortest, smaller), smaller)
}

/// The longest gap between successive times.
pub(crate) fn longest_gap(times: &[f64]) -> f64 {
    times.array_windows().map(|[before, after]| after - before).fold(0.0, larger)
}

/// Appends `f(0)`, `f(1)`, … `f(count − 1)`.
pub(crate) fn append_each(count: u32, f: impl Fn(f64) -> f64, out: &mut Vec<f64>) {
    out.extend((0..count as i32).map(|index| f(f64::from(index))));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a candidate has left after the slits of these steps, one by one.
    fn passed_one_by_one(steps: &Steps<'_>, add: f64) -> (Candidate, Option<Block>) {
        let mut at = Candidate::new(add);
        for (index, (time, error)) in steps.times.iter().zip(steps.errors).enumerate() {
            let (inverse, rise) = (1.0 / (index + 1) as f64, 0.5 * add * index as f64);
            let own_low = (time - steps.base - error) * inverse - rise;
            let own_high = (time - steps.base + error) * inverse - rise;
            let (low, high) = (own_low.max(at.low), own_high.min(at.high));
            if high - low < 1.0 && low.ceil() > high {
                let is_above = low - at.low > at.high - high;
                return (at, Some(if is_above { Block::Above } else { Block::Below }));
            }
            at = Candidate { low, high, passed: at.passed + 1, ..at };
        }
        (at, None)
    }

    proptest! {
        #[test]
        fn in_lanes_it_is_what_it_is_one_by_one(
            steps in proptest::collection::vec((1.0..500.0_f64, 0.0..100.0_f64), 2..60),
            (share, whole) in (0.0..1.0_f64, any::<bool>()),
            (add, interval) in (-20..20_i32, 1..500_i32),
        ) {
            let mut clock = 1e9;
            let even = if whole { 0.01 } else { 1.0 };
            let times: Vec<f64> = steps.iter().map(|step| { clock += 200.0 + even * step.0; clock }).collect();
            let errors: Vec<f64> = steps.iter().map(|step| step.1).collect();
            let steps = Steps { base: 1e9, times: &times, errors: &errors };
            let (add, interval) = (f64::from(add), f64::from(interval));
            let (by_hand, block) = passed_one_by_one(&steps, if whole { 0.0 } else { add });
            let mut slits = Slits::default();
            let mut found = Candidate::new(if whole { 0.0 } else { add });
            // It does not matter how many are known at a time.
            slits.fill(&steps, (share * times.len() as f64) as usize);
            let mut found_block = slits.pass(&mut found);
            if found_block.is_none() {
                slits.fill(&steps, times.len());
                found_block = slits.pass(&mut found);
            }
            prop_assert_eq!(found_block, block);
            prop_assert_eq!((found.low, found.high, found.passed), (by_hand.low, by_hand.high, by_hand.passed));
            let (mut worst, mut clock) = (0.0_f64, 1e9);
            for (index, time) in times.iter().enumerate() {
                clock += interval + add * index as f64;
                worst = worst.max((clock - time).abs());
            }
            prop_assert!((steps.worst(interval, add) - worst).abs() < 1e-6);
            let mut made = vec![7.0];
            append_errors(&times, 80.0, 0.25, &mut made);
            let by_hand: Vec<f64> = [7.0].into_iter()
                .chain(times.windows(3).map(|t| 80.0_f64.min(0.25 * (t[1] - t[0]).min(t[2] - t[1]))))
                .collect();
            prop_assert_eq!(made, by_hand);
            let gaps: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
            prop_assert_eq!(shortest_gap(&times), gaps.iter().copied().fold(f64::INFINITY, f64::min));
            prop_assert_eq!(longest_gap(&times), gaps.iter().copied().fold(0.0, f64::max));
            let mut squares = vec![7.0];
            append_each(times.len() as u32, |index| index * index, &mut squares);
            let by_hand: Vec<f64> = [7.0].into_iter().chain((0..times.len()).map(|i| (i * i) as f64)).collect();
            prop_assert_eq!(squares, by_hand);
        }
    }
}
