//! The longest (interval, add) through windows of time: line stabbing with integer coefficients.
//!
//! Step `k` (from 1) of a command comes `k·interval + add·k(k−1)/2` ticks after the step before the command. Divided by
//! `k`, that is the line `interval + (add/2)·x` over `x = k − 1`, and the window around the step, divided by `k`, is an
//! upright slit that the line must pass. O'Rourke's on-line algorithm keeps the steepest and the flattest line through all
//! slits so far. Both coefficients are integers, so once few values of `add` are left, each is followed by itself with
//! the range of intervals that it allows.

/// The most windows that one command can pass.
pub(crate) const FIT_STEPS_MAX: u32 = 4096;
/// With this many values of `add` or fewer, each is followed by itself.
const CANDIDATES_MAX: usize = 4;
/// Around the middle of the possible values of `add`, this many to either side are tried.
const TRIES_MAX: i64 = 4;
/// Values of `add` that take one byte on the wire.
const ADD_SHORT: core::ops::RangeInclusive<i64> = -32..=95;
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
    /// Windows taken.
    count: u32,
    steepest: Line,
    flattest: Line,
    /// Lower ends of slits that can still touch the steepest line: convex from above.
    lows: Hull,
    /// Upper ends that can still touch the flattest line: convex from below.
    highs: Hull,
    /// All slits, while lines are followed.
    slits: Vec<(f64, f64)>,
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
            slits: Vec::new(),
            candidates: [Candidate::default(); CANDIDATES_MAX],
            followed: 0,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.followed = 0;
        self.slits.clear();
    }

    /// Windows taken since the last [`Self::clear`].
    #[inline]
    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    /// Takes the window of the next step, in ticks after the step before the command; `false`, and nothing changes, where
    /// no line passes it too. The first window is always taken: it must be at least one tick wide and reach above 1.
    #[inline]
    pub(crate) fn take(&mut self, earliest: f64, latest: f64) -> bool {
        let x = f64::from(self.count);
        let inverse = 1.0 / (x + 1.0);
        let (low, high) = (earliest * inverse, latest * inverse);
        let taken = self.count < FIT_STEPS_MAX
            && if self.followed > 0 { self.follow(x, low, high) } else { self.narrow(x, low, high) };
        self.count += u32::from(taken);
        taken
    }

    fn start(&mut self, low: f64, high: f64) {
        self.steepest = Line { offset: low, slope: f64::INFINITY };
        self.flattest = Line { offset: high, slope: f64::NEG_INFINITY };
        self.lows.restart(low);
        self.highs.restart(high);
        self.slits.push((low, high));
    }

    /// The next slit, while lines are followed.
    #[inline(never)]
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
        self.slits.push((low, high));
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
    #[inline]
    fn follow(&mut self, x: f64, low: f64, high: f64) -> bool {
        let half_x = 0.5 * x;
        let before = self.followed;
        // The usual case in a long command.
        if before == 1 {
            let candidate = &mut self.candidates[0];
            let rise = candidate.add * half_x;
            let next_low = larger(candidate.low, low - rise);
            let next_high = smaller(candidate.high, high - rise);
            let passes = has_integer(next_low, next_high);
            if passes {
                (candidate.low, candidate.high) = (next_low, next_high);
            }
            return passes;
        }
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

    /// The best command for the windows taken: it covers all of them where integers allow, at least one otherwise.
    ///
    /// At least one window must have been taken.
    pub(crate) fn fit(&self, aim: f64) -> Fit {
        if self.followed > 0 {
            let fits = self.candidates[..self.followed]
                .iter()
                .map(|&candidate| Fit::new(candidate, self.count, aim));
            // A short `add` first, then the end; a tie is not left to the order of the candidates, which trials change.
            let best = fits.min_by(|a, b| {
                let long = |fit: &Fit| !ADD_SHORT.contains(&i64::from(fit.add));
                let ends = || a.off(aim).total_cmp(&b.off(aim));
                long(a).cmp(&long(b)).then_with(ends).then(a.add.cmp(&b.add))
            });
            return best.unwrap_or(Fit { interval: 1, add: 0, count: 1 });
        }
        if self.count == 1 {
            let (low, high) = self.slits[0];
            return Fit::new(Candidate { add: 0.0, low, high }, 1, aim);
        }
        let first = ceil(2.0 * self.flattest.slope);
        let last = floor(2.0 * self.steepest.slope);
        let middle = ceil(self.flattest.slope + self.steepest.slope - 0.5).clamp(ADD_MIN, ADD_MAX);
        let short = (first.max(*ADD_SHORT.start()), last.min(*ADD_SHORT.end()));
        let middle = if short.0 <= short.1 { middle.clamp(short.0, short.1) } else { middle };
        let tries = || {
            let around = (0..=2 * TRIES_MAX).map(|i| middle + if i % 2 == 0 { -(i / 2) } else { i / 2 + 1 });
            around.filter(|add| (ADD_MIN..=ADD_MAX).contains(add))
        };
        for add in tries().filter(|add| (first..=last).contains(add)) {
            let candidate = self.candidate(add);
            if has_integer(candidate.low, candidate.high) {
                return Fit::new(candidate, self.count, aim);
            }
        }
        self.longest(tries(), aim)
    }

    /// The candidate that passes the most windows from the first on.
    fn longest(&self, adds: impl Iterator<Item = i64>, aim: f64) -> Fit {
        let mut best = (Candidate { add: 0.0, low: self.slits[0].0, high: self.slits[0].1 }, 1);
        for add in adds {
            let add = add as f64;
            let mut reached = Candidate { add, low: self.slits[0].0, high: self.slits[0].1 };
            let mut count = 1;
            for (x, &(low, high)) in self.slits.iter().enumerate().skip(1) {
                let rise = 0.5 * add * x as f64;
                let next =
                    Candidate { add, low: reached.low.max(low - rise), high: reached.high.min(high - rise) };
                if !has_integer(next.low, next.high) {
                    break;
                }
                reached = next;
                count += 1;
            }
            if count > best.1 {
                best = (reached, count);
            }
        }
        Fit::new(best.0, best.1, aim)
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
fn has_integer(low: f64, high: f64) -> bool {
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
