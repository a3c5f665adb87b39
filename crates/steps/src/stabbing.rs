//! What (interval, add) pass through windows of time: line stabbing with integer coefficients.
//!
//! Step `k` (from 1) of a command comes `k·interval + add·k(k−1)/2` ticks after the step before the command. Divided by
//! `k`, that is the line `interval + (add/2)·x` over `x = k − 1`, and the window around the step, divided by `k`, is an
//! upright slit that the line must pass. O'Rourke's on-line algorithm keeps the steepest and the flattest line through all
//! slits so far. Both coefficients are integers, so once few values of `add` are left, each is followed by itself with
//! the range of intervals that it allows.
//!
//! Slits may be left out: what passes those that were taken is then tried on all of them before it is given out.

use crate::windows::Steps;

/// The most windows that one command can pass.
pub(crate) const FIT_STEPS_MAX: u32 = 4096;
/// With this many values of `add` or fewer, each is followed by itself.
const CANDIDATES_MAX: usize = 4;
/// Around the middle of the possible values of `add`, this many to either side are tried.
const TRIES_MAX: i64 = 4;
/// Values of `add` that take one byte on the wire.
const ADD_SHORT: core::ops::RangeInclusive<i64> = -32..=95;
/// Values that take two at most.
const ADD_TWO_BYTES: core::ops::RangeInclusive<i64> = -4096..=12_287;
/// Values of `add` that the wire can express.
const ADD_MIN: i64 = i16::MIN as i64;
const ADD_MAX: i64 = i16::MAX as i64;

/// A command's coefficients and how many steps it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fit {
    pub(crate) interval: u32,
    pub(crate) add: i16,
    pub(crate) count: u32,
}

impl Fit {
    /// Of the candidate's intervals the one with which the last step comes nearest to `aim`, in ticks after the step before
    /// the command: what follows starts there.
    fn new(candidate: Candidate, count: u32, aim: f64) -> Self {
        let n = f64::from(count);
        let best = floor((aim - 0.5 * candidate.add * n * (n - 1.0)) / n + 0.5);
        let interval = best.min(floor(candidate.high)).max(ceil(candidate.low)).max(1) as u32;
        Self { interval, add: if count == 1 { 0 } else { candidate.add as i16 }, count }
    }

    /// Whether all of `steps` come within their windows; if so, the farthest of them may set the `record`.
    fn passes(&self, steps: &Steps<'_>, record: &mut f64) -> bool {
        let (is_within, is_farther) = steps.check(f64::from(self.interval), f64::from(self.add), *record);
        if is_within && is_farther {
            *record = self.worst(steps);
        }
        is_within
    }

    /// How far the farthest of `steps` is from its time.
    fn worst(&self, steps: &Steps<'_>) -> f64 {
        steps.worst(f64::from(self.interval), f64::from(self.add))
    }

    /// How far the last step is from `aim`.
    fn off(&self, aim: f64) -> f64 {
        let n = f64::from(self.count);
        (n * f64::from(self.interval) + 0.5 * f64::from(self.add) * n * (n - 1.0) - aim).abs()
    }
}

/// `y = offset + slope·x`
#[derive(Clone, Copy, Debug)]
struct Line {
    offset: f64,
    slope: f64,
}

impl Line {
    fn at(self, x: f64) -> f64 {
        self.offset + self.slope * x
    }
}

/// One value of `add` with the intervals that pass every window with it.
#[derive(Clone, Copy, Debug, Default)]
struct Candidate {
    /// An integer.
    add: f64,
    low: f64,
    high: f64,
}

/// Windows taken so far and what passes them.
#[derive(Clone, Debug)]
pub(crate) struct Stabbing {
    /// Number of the last step whose window was taken.
    count: u32,
    steepest: Line,
    flattest: Line,
    /// Lower ends of slits that can still touch the steepest line: convex from above.
    lows: Hull,
    /// Upper ends that can still touch the flattest line: convex from below.
    highs: Hull,
    candidates: [Candidate; CANDIDATES_MAX],
    /// Number of candidates; 0 while lines are followed.
    followed: usize,
}

impl Stabbing {
    pub(crate) fn new() -> Self {
        let flat = Line { offset: 0.0, slope: 0.0 };
        Self {
            count: 0,
            steepest: flat,
            flattest: flat,
            lows: Hull::default(),
            highs: Hull::default(),
            candidates: [Candidate::default(); CANDIDATES_MAX],
            followed: 0,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.followed = 0;
    }

    /// The last step whose window was taken since the last [`Self::clear`]; they count from 1.
    #[inline]
    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    /// Takes the window of step number `count`, in ticks after the step before the command; `false`, and nothing changes,
    /// where no line passes it too. Numbers rise, from 1. The first window is always taken: it must be at least one tick
    /// wide and reach above 1.
    pub(crate) fn take(&mut self, count: u32, earliest: f64, latest: f64) -> bool {
        let number = f64::from(count);
        let inverse = 1.0 / number;
        let (x, low, high) = (number - 1.0, earliest * inverse, latest * inverse);
        let taken = if self.followed > 0 { self.follow(x, low, high) } else { self.narrow(x, low, high) };
        if taken {
            self.count = count;
        }
        taken
    }

    fn start(&mut self, low: f64, high: f64) {
        self.steepest = Line { offset: low, slope: f64::INFINITY };
        self.flattest = Line { offset: high, slope: f64::NEG_INFINITY };
        self.lows.restart(low);
        self.highs.restart(high);
    }

    /// The next slit, while lines are followed.
    fn narrow(&mut self, x: f64, low: f64, high: f64) -> bool {
        if self.count == 0 {
            self.start(low, high);
            return true;
        }
        let (top, bottom) = (self.steepest.at(x), self.flattest.at(x));
        // Too low for the steepest line's end, or too high for the flattest one's: nothing passes.
        if low > top || high < bottom || !self.has_add() {
            return false;
        }
        // A slit's end that no remaining line can touch needs no place in the hulls.
        if high < top {
            self.steepest = self.lows.tangent(x, high, |slope, best| slope <= best);
        }
        if low > bottom {
            self.flattest = self.highs.tangent(x, low, |slope, best| slope >= best);
            self.lows.add(x, low, |turn| turn >= 0.0);
        }
        if high < top {
            self.highs.add(x, high, |turn| turn <= 0.0);
        }
        if self.steepest.slope - self.flattest.slope < 0.5 * CANDIDATES_MAX as f64 {
            self.start_following();
        }
        true
    }

    /// Whether the wire can express the slope of any line that is left.
    fn has_add(&self) -> bool {
        2.0 * self.flattest.slope <= f64::from(i16::MAX) && 2.0 * self.steepest.slope >= f64::from(i16::MIN)
    }

    /// Turns the lines into one candidate for each `add`, if there are few enough and any has an interval.
    fn start_following(&mut self) {
        let first = ceil(2.0 * self.flattest.slope);
        let last = floor(2.0 * self.steepest.slope);
        for add in first.max(ADD_MIN)..=last.min(ADD_MAX) {
            let candidate = self.candidate(add);
            if self.followed < CANDIDATES_MAX && has_integer(candidate.low, candidate.high) {
                self.candidates[self.followed] = candidate;
                self.followed += 1;
            }
        }
    }

    /// The intervals that pass all windows with this `add`, which must lie between the two extreme lines.
    fn candidate(&self, add: i64) -> Candidate {
        let add = add as f64;
        let slope = 0.5 * add;
        let low = self.lows.points().fold(f64::NEG_INFINITY, |low, (x, y)| larger(low, y - slope * x));
        let high = self.highs.points().fold(f64::INFINITY, |high, (x, y)| smaller(high, y - slope * x));
        Candidate { add, low, high }
    }

    /// The next slit, while candidates are followed.
    fn follow(&mut self, x: f64, low: f64, high: f64) -> bool {
        let half_x = 0.5 * x;
        let before = self.followed;
        let mut index = 0;
        while index < self.followed {
            let candidate = &mut self.candidates[index];
            let rise = candidate.add * half_x;
            let next_low = larger(candidate.low, low - rise);
            let next_high = smaller(candidate.high, high - rise);
            if has_integer(next_low, next_high) {
                candidate.low = next_low;
                candidate.high = next_high;
                index += 1;
            } else {
                // It keeps its range, for the case that none of them passes this slit.
                self.followed -= 1;
                self.candidates.swap(index, self.followed);
            }
        }
        if self.followed == 0 {
            self.followed = before;
            return false;
        }
        true
    }

    /// A command for all steps up to the last window taken, if a likely one passes those that were left out too. The last step
    /// should come near `aim`, in ticks after the step before the command. Puts the farthest that a step has been off into
    /// `record`.
    ///
    /// At least one window must have been taken.
    pub(crate) fn fit(&self, steps: &Steps<'_>, aim: f64, record: &mut f64) -> Option<Fit> {
        let steps = steps.first(self.count as usize);
        let likely = self.likely(aim);
        let fit = Fit::new(likely, self.count, aim);
        if fit.passes(&steps, record) {
            return Some(fit);
        }
        let (low, high) = steps.intervals(likely.add);
        if !has_integer(low, high) {
            return None;
        }
        let fit = Fit::new(Candidate { low, high, ..likely }, self.count, aim);
        fit.passes(&steps, record).then_some(fit)
    }

    /// The command that passes the most of the windows up to the last one taken, at least one.
    pub(crate) fn fit_some(&self, steps: &Steps<'_>, record: &mut f64) -> Fit {
        let steps = steps.first(self.count as usize);
        // A window without a whole tick in it is served as near as can be.
        let mut best = (Candidate { add: 0.0, low: 1.0, high: f64::INFINITY }, 1);
        let mut attempt = |add: f64| {
            if best.1 < self.count as usize {
                let (count, (low, high)) = steps.prefix(add);
                if count > best.1 {
                    best = (Candidate { add, low, high }, count);
                }
            }
        };
        if self.followed > 0 {
            self.candidates[..self.followed].iter().for_each(|candidate| attempt(candidate.add));
        } else {
            let middle = self.middle_add();
            for i in 0..=2 * TRIES_MAX {
                let add = middle + if i % 2 == 0 { -(i / 2) } else { i / 2 + 1 };
                attempt(add.clamp(ADD_MIN, ADD_MAX) as f64);
            }
        }
        let (candidate, count) = best;
        let fit = Fit::new(candidate, count as u32, steps.times[count - 1] - steps.base);
        *record = larger(*record, fit.worst(&steps.first(count)));
        fit
    }

    /// What is most likely to pass the windows that were left out.
    fn likely(&self, aim: f64) -> Candidate {
        let candidates = &self.candidates[..self.followed];
        // A short `add` first, then the end; a tie is not left to the order of the candidates, which trials change.
        let best = candidates.iter().copied().reduce(|a, b| {
            let (fit_a, fit_b) = (Fit::new(a, self.count, aim), Fit::new(b, self.count, aim));
            let long = |fit: &Fit| !ADD_SHORT.contains(&i64::from(fit.add));
            let order = long(&fit_a).cmp(&long(&fit_b));
            let order = order.then_with(|| fit_a.off(aim).total_cmp(&fit_b.off(aim)));
            if order.then(fit_a.add.cmp(&fit_b.add)).is_le() { a } else { b }
        });
        best.unwrap_or_else(|| self.candidate(if self.count == 1 { 0 } else { self.middle_add() }))
    }

    /// Half-way between the extreme lines, or the nearest to it that is shorter on the wire, if one is between them too.
    fn middle_add(&self) -> i64 {
        let (flattest, steepest) = (self.flattest.slope, self.steepest.slope);
        let middle = ceil(flattest + steepest - 0.5).clamp(ADD_MIN, ADD_MAX);
        if ADD_SHORT.contains(&middle) {
            return middle;
        }
        let (first, last) = (ceil(2.0 * flattest), floor(2.0 * steepest));
        let shorter = [ADD_SHORT, ADD_TWO_BYTES].into_iter().find_map(|values| {
            let (first, last) = (first.max(*values.start()), last.min(*values.end()));
            (first <= last).then(|| middle.clamp(first, last))
        });
        shorter.unwrap_or(middle)
    }
}

/// The points of a convex chain that can still carry a tangent; the front ones drop away as the tangent turns.
#[derive(Clone, Debug, Default)]
struct Hull {
    points: Vec<(f64, f64)>,
    /// The point that the extreme line goes through.
    pivot: usize,
}

impl Hull {
    fn restart(&mut self, y: f64) {
        self.points.clear();
        self.points.push((0.0, y));
        self.pivot = 0;
    }

    fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points[self.pivot..].iter().copied()
    }

    /// The line from (x, y) that touches the chain; `better` says whether a slope replaces the best so far.
    #[inline]
    fn tangent(&mut self, x: f64, y: f64, better: impl Fn(f64, f64) -> bool) -> Line {
        let slope_of = |(px, py): (f64, f64)| (y - py) / (x - px);
        let mut slope = slope_of(self.points[self.pivot]);
        while let Some(&next) = self.points.get(self.pivot + 1) {
            let next_slope = slope_of(next);
            if !better(next_slope, slope) {
                break;
            }
            slope = next_slope;
            self.pivot += 1;
        }
        Line { offset: y - slope * x, slope }
    }

    /// Adds a point on the right; points that `is_inside` (by the turn of the chain at them) drop out.
    #[inline]
    fn add(&mut self, x: f64, y: f64, is_inside: impl Fn(f64) -> bool) {
        while self.points.len() >= self.pivot + 2 {
            let (ax, ay) = self.points[self.points.len() - 2];
            let (bx, by) = self.points[self.points.len() - 1];
            let turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
            if !is_inside(turn) {
                break;
            }
            self.points.pop();
        }
        self.points.push((x, y));
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
fn ceil(value: f64) -> i64 {
    let whole = value as i64;
    whole + i64::from((whole as f64) < value)
}

/// Rounds down.
fn floor(value: f64) -> i64 {
    let whole = value as i64;
    whole - i64::from((whole as f64) > value)
}
