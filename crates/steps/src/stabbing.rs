//! What (interval, add) pass through windows of time: the longest row of steps, by trying values of `add`.
//!
//! Step `k` (from 1) of a command comes `k·interval + add·k(k−1)/2` ticks after the step before the command. Divided by
//! `k`, that is the line `interval + (add/2)·x` over `x = k − 1`, and the window around the step, divided by `k`, is an
//! upright slit that the line must pass. Both coefficients are integers.
//!
//! With one value of `add` a pass over the slits gives the range of intervals, down to the slit that leaves none. Where that slit
//! is too high, only a larger `add` passes it, and by the slit that it disagrees with, none below a certain one; where it is too low, a
//! smaller one. What is left between both bounds is tried, from the slope of the slits themselves on, until nothing is left: the
//! longest is the command. So most steps cost a few additions for each of the few values tried, in vector instructions.

use crate::windows::{LANES, Slits, Steps};

/// The most windows that one command can pass.
pub(crate) const FIT_STEPS_MAX: u32 = 4096;
/// The slit whose slope the first value of a command comes from lies three quarters down the command before, within these.
const SEED_MIN: usize = 7;
const SEED_MAX: usize = 64;
/// So many values are tried for a command.
const TRIES_MAX: u32 = 16;
/// Values of `add` that take one byte on the wire.
const ADD_SHORT: (f64, f64) = (-32.0, 95.0);
/// Values that take two at most.
const ADD_TWO_BYTES: (f64, f64) = (-4096.0, 12_287.0);
/// Values of `add` that the wire can express.
const ADD_MIN: f64 = i16::MIN as f64;
const ADD_MAX: f64 = i16::MAX as f64;

/// A command's coefficients and how many steps it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fit {
    pub(crate) interval: u32,
    pub(crate) add: i16,
    pub(crate) count: u32,
}

impl Fit {
    /// Bytes on the wire.
    pub(crate) fn bytes(&self) -> u32 {
        let value = |value: i32| match value {
            -32..=95 => 1,
            -4096..=12_287 => 2,
            -524_288..=1_572_863 => 3,
            -67_108_864..=201_326_591 => 4,
            _ => 5,
        };
        // The message, the motor, and three values.
        2 + value(self.interval as i32) + value(self.count as i32) + value(i32::from(self.add))
    }

    /// When the last step comes, in ticks after the step before the command. Exact.
    pub(crate) fn end(&self) -> f64 {
        let count = f64::from(self.count);
        count * (f64::from(self.interval) + 0.5 * f64::from(self.add) * (count - 1.0))
    }

    /// Of the candidate's intervals the one with which the last step comes nearest to `aim`, in ticks after the step before
    /// the command: what follows starts there.
    fn new(candidate: &Candidate, count: u32, aim: f64) -> Self {
        let n = f64::from(count);
        let best = floor((aim - 0.5 * candidate.add * n * (n - 1.0)) / n + 0.5);
        let interval = best.min(floor(candidate.high)).max(ceil(candidate.low)).max(1) as u32;
        Self { interval, add: if count == 1 { 0 } else { candidate.add as i16 }, count }
    }
}

/// One value of `add` with the intervals that pass the slits with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// An integer.
    pub(crate) add: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Slits that it has passed.
    pub(crate) passed: u32,
    /// Among the few from here on is the one that the low end comes from …
    pub(crate) low_at: u32,
    /// … and the high end.
    pub(crate) high_at: u32,
}

impl Candidate {
    /// Any interval at all.
    pub(crate) const fn new(add: f64) -> Self {
        Self { add, low: 1.0, high: f64::INFINITY, passed: 0, low_at: 0, high_at: 0 }
    }

    /// What is left after the slits from number `at` on.
    #[inline]
    pub(crate) fn reach(&mut self, low: f64, high: f64, at: usize) {
        self.low_at = if low > self.low { at as u32 } else { self.low_at };
        self.high_at = if high < self.high { at as u32 } else { self.high_at };
        (self.low, self.high) = (low, high);
    }
}

/// Why a slit cannot be passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Block {
    /// It is higher than an earlier one allows.
    Above,
    /// It is lower.
    Below,
}

/// The search for one command.
#[derive(Clone, Debug)]
pub(crate) struct Stabbing {
    slits: Slits,
    /// The value in hand, and how many there have been.
    tried: Candidate,
    tries: u32,
    /// The slit whose slope the first value comes from.
    seed: usize,
    /// The next value is to be chosen.
    is_blocked: bool,
    /// What passes more slits than `best` lies between these.
    least: f64,
    most: f64,
    /// What has passed the most slits.
    best: Candidate,
    /// Why that could not go on, where it could not.
    best_block: Option<Block>,
    /// Nothing can be longer than the best.
    is_closed: bool,
}

impl Stabbing {
    pub(crate) fn new() -> Self {
        Self {
            slits: Slits::default(),
            tried: Candidate::new(0.0),
            tries: 0,
            seed: SEED_MIN,
            is_blocked: true,
            least: ADD_MIN,
            most: ADD_MAX,
            best: Candidate::new(0.0),
            best_block: None,
            is_closed: false,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.slits.clear();
        self.tries = 0;
        self.is_blocked = true;
        (self.least, self.most, self.best) = (ADD_MIN, ADD_MAX, Candidate::new(0.0));
        (self.best_block, self.is_closed) = (None, false);
    }

    /// Whether the windows of `steps` are enough to know the longest command. They are those known so far, from the first step
    /// of the command on.
    pub(crate) fn extend(&mut self, steps: &Steps<'_>) -> bool {
        self.is_closed = self.is_closed || self.search(steps, false);
        self.is_closed
    }

    /// The longest command for `steps` and none beyond them; at least one.
    pub(crate) fn finish(&mut self, steps: &Steps<'_>) {
        if !self.is_closed && !self.search(steps, true) {
            self.keep(None);
        }
        self.is_closed = true;
    }

    /// The command found. Its last step comes as near as may be to when it is due.
    pub(crate) fn fit(&self, steps: &Steps<'_>) -> Fit {
        // A window without a whole tick in it is served as near as can be.
        let count = self.best.passed.max(1);
        Fit::new(&self.best, count, steps.times[count as usize - 1] - steps.base)
    }

    /// The farthest that a step of `fit` is off goes into `record`: no window is wider than `most`, and what has come within a
    /// tick of that is `most`, whatever follows.
    pub(crate) fn note(&mut self, fit: &Fit, steps: &Steps<'_>, most: f64, record: &mut f64) {
        self.expect(fit.count);
        if *record < most || self.best.passed == 0 {
            let steps = steps.first(fit.count as usize);
            *record = larger(*record, steps.worst(f64::from(fit.interval), f64::from(fit.add)));
            if *record > most - 1.0 {
                *record = larger(*record, most);
            }
        }
    }

    /// The next command may be about as long as one of `count` steps.
    pub(crate) fn expect(&mut self, count: u32) {
        self.seed = (count as usize * 3 / 4).clamp(SEED_MIN, SEED_MAX);
    }

    /// Whether nothing has been searched yet.
    pub(crate) const fn is_fresh(&self) -> bool {
        self.tries == 0
    }

    /// Whether nothing can be longer than the command found.
    pub(crate) const fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Steps of the command found; none where the first window holds no whole tick.
    pub(crate) const fn passed(&self) -> u32 {
        self.best.passed
    }

    /// The `add` of the command found.
    pub(crate) fn add(&self) -> i16 {
        self.best.add as i16
    }

    /// Why the command found could not go on.
    pub(crate) const fn block(&self) -> Option<Block> {
        self.best_block
    }

    /// How much later the last step of the command found could be than its earliest, in ticks, with the same `add`.
    pub(crate) fn play(&self) -> f64 {
        (self.best.high - self.best.low) * f64::from(self.best.passed)
    }

    /// A command for the first `count` steps, which are no more than found, whose last step comes as late, or else as early, as
    /// few values of `add` allow, from `add` on, which passes them; none of them takes more bytes than the one found.
    pub(crate) fn bent(&self, count: u32, add: i16, is_late: bool, tries: u32) -> Fit {
        let sign = if is_late { 1.0 } else { -1.0 };
        let fit = |at: &Candidate| Fit {
            interval: if is_late { floor(at.high) } else { ceil(at.low) } as u32,
            add: if count == 1 { 0 } else { at.add as i16 },
            count,
        };
        let from = if count == 1 { self.best.add } else { f64::from(add) };
        let mut at = self.best;
        if count < at.passed || from != at.add {
            at = Candidate::new(from);
            self.slits.pass_to(&mut at, count as usize);
        }
        let mut best = fit(&at);
        let class = [ADD_SHORT, ADD_TWO_BYTES].into_iter().find(|class| from >= class.0 && from <= class.1);
        let class = class.unwrap_or((ADD_MIN, ADD_MAX));
        // How far `add` may and may not go.
        let mut good = 0.0;
        let mut bad = 1.0 + if is_late { class.1 - from } else { from - class.0 };
        let mut next = 1.0;
        for _ in 0..if count == 1 { 0 } else { tries } {
            if next >= bad {
                next = floor(0.5 * (good + bad)) as f64;
            }
            if next <= good {
                break;
            }
            at = Candidate::new(from + sign * next);
            if let Some(block) = self.slits.pass_to(&mut at, count as usize) {
                bad = next;
                if at.passed > 0 && (block == Block::Below) == is_late {
                    let most = floor(sign * (self.slits.bound(&at, block) - from)) as f64;
                    bad = smaller(bad, most + 1.0);
                }
                next = bad - 1.0;
                continue;
            }
            let other = fit(&at);
            if (other.end() - best.end()) * sign > 0.0 {
                best = other;
            }
            good = next;
            next *= 4.0;
        }
        best
    }

    /// Tries values as far as the windows are known; whether nothing can be longer than the best. Where `ends`, nothing comes
    /// after those that are known.
    fn search(&mut self, steps: &Steps<'_>, ends: bool) -> bool {
        let known = steps.times.len().min(FIT_STEPS_MAX as usize);
        loop {
            if self.is_blocked {
                let passed = self.tried.passed as usize;
                let to = if self.tries == 0 { self.seed } else { passed };
                if to >= known && !(ends || known == FIT_STEPS_MAX as usize) {
                    return false;
                }
                let to = to.min(known - 1);
                self.fill(steps, to + 1, known);
                self.is_blocked = false;
                self.tried = Candidate::new(self.choose(to));
                self.tries += 1;
            }
            let block = self.slits.pass(&mut self.tried);
            let passed = self.tried.passed as usize;
            if let Some(block) = block {
                self.keep(Some(block));
                if !self.narrow(block) {
                    return true;
                }
            } else if passed == FIT_STEPS_MAX as usize {
                self.keep(None);
                return true;
            } else if passed == known {
                return false;
            } else {
                self.fill(steps, passed + 1, known);
            }
        }
    }

    /// The value to try next: of those that are left the middle one, or where there is no end to them on one side, the slope of
    /// the slits up to the one at `to`; shorter on the wire where that is possible.
    fn choose(&self, to: usize) -> f64 {
        let (least, most) = (self.least, self.most);
        let value = if least > ADD_MIN && most < ADD_MAX {
            floor(0.5 * (least + most)) as f64
        } else if to == 0 {
            0.0
        } else {
            larger(smaller(self.slits.add(to / 2, to), most), least)
        };
        for (start, end) in [ADD_SHORT, ADD_TWO_BYTES] {
            if value >= start && value <= end {
                break;
            }
            let (start, end) = (larger(start, least), smaller(end, most));
            if start <= end {
                return larger(smaller(value, end), start);
            }
        }
        value
    }

    /// Prepares slits up to `least` and some more.
    fn fill(&mut self, steps: &Steps<'_>, least: usize, known: usize) {
        let there = self.slits.count();
        if there < least {
            let usual = if there == 0 { self.seed + self.seed / 2 } else { least + least / 4 };
            let count = (usual.max(least) + 4).next_multiple_of(LANES);
            self.slits.fill(steps, known.min(count));
        }
    }

    /// The value in hand, if it is better than the best so far.
    fn keep(&mut self, block: Option<Block>) {
        let is_short = |candidate: &Candidate| candidate.add >= ADD_SHORT.0 && candidate.add <= ADD_SHORT.1;
        let is_shorter =
            self.tried.passed == self.best.passed && is_short(&self.tried) && !is_short(&self.best);
        if self.tried.passed > self.best.passed || is_shorter {
            (self.best, self.best_block) = (self.tried, block);
        }
    }

    /// What can be better than the value in hand; `false` where nothing can.
    fn narrow(&mut self, block: Block) -> bool {
        if self.tried.passed == 0 || self.tries >= TRIES_MAX {
            return false;
        }
        self.is_blocked = true;
        let add = self.tried.add;
        let bound = self.slits.bound(&self.tried, block);
        match block {
            Block::Above => self.least = larger(self.least, larger(ceil(bound) as f64, add + 1.0)),
            Block::Below => self.most = smaller(self.most, smaller(floor(bound) as f64, add - 1.0)),
        }
        self.least <= self.most
    }
}

/// The smaller of two numbers. Unlike `f64::min` it is one instruction, as it need not care for NaN.
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two numbers; see [`smaller`].
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Whether an integer lies in `low ..= high`.
pub(crate) fn has_integer(low: f64, high: f64) -> bool {
    high - low >= 1.0 || (low <= high && ceil(low) as f64 <= high)
}

/// Rounds up. The conversion saturates and is a single instruction, unlike the library's functions.
pub(crate) fn ceil(value: f64) -> i64 {
    let whole = value as i64;
    whole + i64::from((whole as f64) < value)
}

/// Rounds down.
pub(crate) fn floor(value: f64) -> i64 {
    let whole = value as i64;
    whole - i64::from((whole as f64) > value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_other_add_goes_further(
            (interval, add, bend) in (300.0..3000.0_f64, -9.0..9.0_f64, -0.5..0.5_f64),
            noise in proptest::collection::vec(-40.0..40.0_f64, 30),
            error in 64.0..200.0_f64,
            ends in any::<bool>(),
        ) {
            let time = |k: f64| k * interval + add * k * (k - 1.0) / 2.0 + bend * k * (k - 1.0) * (k - 2.0) / 6.0;
            let times: Vec<f64> = noise.iter().enumerate().map(|(i, noise)| time(i as f64 + 1.0) + noise).collect();
            let errors = vec![error; times.len()];
            let steps = Steps { base: 0.0, times: &times, errors: &errors };
            let mut stabbing = Stabbing::new();
            let is_closed = !ends && stabbing.extend(&steps);
            if !is_closed {
                stabbing.finish(&steps);
            }
            let mut slits = Slits::default();
            slits.fill(&steps, times.len());
            let reach = |add: i32| {
                let mut candidate = Candidate::new(f64::from(add));
                slits.pass(&mut candidate);
                candidate.passed
            };
            let mut record = 0.0;
            let fit = stabbing.fit(&steps);
            stabbing.note(&fit, &steps, 1e3, &mut record);
            prop_assert_eq!(fit.count, (-1000..1000).map(reach).max().unwrap_or(0));
            prop_assert!(record <= error && is_closed <= (fit.count < 30));
        }
    }
}
