//! One motor's step times into commands: the windows around the steps, and when a command must be closed.
//!
//! A step may come early or late by `max_error` and by a quarter of the gap to either neighbour, so two steps never come
//! nearer to each other than half their true gap. Every clock is integer arithmetic from the clock before, and every
//! window lies around the true time: errors never add up.
//!
//! Each command goes on until no interval and `add` pass the next window too, or a few steps less where that leaves the next one
//! a better start (`ahead`).
//!
//! Whether a command is closed depends on the step times alone, never on when they become known: a later step either
//! closes it by its distance or could have gone on with it. Only where another motor's pieces run out of room is one
//! closed early, after a number of moves that is always the same.

use crate::ahead::{AHEAD_STEPS_MAX, Ahead, usual_end};
use crate::crossing::Piece;
use crate::spec::StepSearch;
use crate::stabbing::{FIT_STEPS_MAX, Fit, Stabbing, larger, smaller};
use crate::windows::{Steps, append_errors, longest_gap, shortest_gap};
use crate::{IDLE_TICKS_MAX, StepCommand, StepCommandKind};
use std::collections::VecDeque;
use units::{Seconds, Ticks};

/// Steps of one motor that are taken at a time.
pub(crate) const TURN_STEPS: u32 = 128;
/// Where those cannot be taken together, so many are.
const PART_STEPS: usize = 16;
/// The most steps of one motor that wait for their command to be closed.
pub const STEPS_BUFFERED_MAX: usize = (AHEAD_STEPS_MAX + FIT_STEPS_MAX + TURN_STEPS) as usize + 2;
/// A step is given out once the plan is known this far beyond it.
pub const STEP_HOLD_MAX: Seconds = Seconds(0.1);
/// The longest time from the first to the last step of a command.
pub const RUN_SPAN_MAX: Seconds = Seconds(0.5);
/// Two steps of a motor are at least this far apart: less than any driver takes. A step that is taken back within that
/// time is no step.
const GAP_MIN: Seconds = Seconds(0.5e-6);
/// The same for slow clocks, in ticks: windows must hold an integer.
const GAP_MIN_TICKS: f64 = 4.0;
/// The share of the gap to a neighbour by which a step may be off.
const GAP_SHARE: f64 = 0.25 * WINDOW_SHARE;
/// The share of a window that is used: a slit's last digits are far below the rest.
const WINDOW_SHARE: f64 = 1.0 - 1e-9;
/// Times of steps that are given out stay in the buffer up to this many.
const GONE_MAX: usize = 1024;

/// Step times of one motor, and the commands made of them.
#[derive(Clone, Debug)]
pub(crate) struct Compressor {
    motor: usize,
    max_error: f64,
    gap_min: f64,
    hold_max: f64,
    span_max: f64,
    /// Exact clock of the last step given out.
    base: u64,
    /// The same number.
    base_ticks: f64,
    /// True time of that step.
    base_time: f64,
    /// True times of the steps since, one way; before `first`, of some that are given out.
    times: Vec<f64>,
    /// What each of them may be off; that of the last is not known yet.
    errors: Vec<f64>,
    /// The first of them that is not given out.
    first: usize,
    /// How far the last step is from the one before it.
    gap_before: f64,
    forward: bool,
    /// Direction that the motor has been told in this run.
    told: Option<bool>,
    stabbing: Stabbing,
    /// The command that it found, once it is known how that ends.
    chosen: Option<Fit>,
    /// Where the next command is looked at for that.
    ahead: Option<Box<Ahead>>,
    /// Closed commands, each with the true time of its first step (for SetDir: of the step after it).
    out: VecDeque<(f64, StepCommand)>,
    pub(crate) tally: Tally,
}

/// What a compressor has seen and made, in steps and ticks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tally {
    pub(crate) steps: u64,
    pub(crate) queue_steps: u64,
    pub(crate) direction_changes: u64,
    /// Shortest gap between two steps the same way.
    pub(crate) gap_min: f64,
    /// Worst distance of a step from its true time.
    pub(crate) error_max: f64,
}

/// The least gap between two steps of a motor, in ticks.
pub(crate) fn gap_min_ticks(ticks_per_s: f64) -> f64 {
    (GAP_MIN.0 * ticks_per_s).max(GAP_MIN_TICKS)
}

impl Compressor {
    pub(crate) fn new(motor: usize, ticks_per_s: f64, max_error: Seconds, search: StepSearch) -> Self {
        Self {
            motor,
            max_error: max_error.0 * ticks_per_s * WINDOW_SHARE,
            gap_min: gap_min_ticks(ticks_per_s),
            hold_max: STEP_HOLD_MAX.0 * ticks_per_s,
            span_max: RUN_SPAN_MAX.0 * ticks_per_s,
            base: 0,
            base_ticks: 0.0,
            base_time: f64::NEG_INFINITY,
            times: Vec::new(),
            errors: Vec::new(),
            first: 0,
            gap_before: 0.0,
            forward: true,
            told: None,
            stabbing: Stabbing::new(),
            chosen: None,
            ahead: (search == StepSearch::Ahead).then(|| Box::new(Ahead::new())),
            out: VecDeque::new(),
            tally: Tally {
                steps: 0,
                queue_steps: 0,
                direction_changes: 0,
                gap_min: f64::INFINITY,
                error_max: 0.0,
            },
        }
    }

    /// Forgets everything but the tally; clocks start at 0.
    pub(crate) fn begin_run(&mut self) {
        self.base = 0;
        self.base_ticks = 0.0;
        self.base_time = f64::NEG_INFINITY;
        self.forget();
        self.told = None;
        self.stabbing = Stabbing::new();
        self.ahead = self.ahead.take().map(|_| Box::new(Ahead::new()));
        self.out.clear();
    }

    /// Whether a command is ready to be taken.
    pub(crate) fn is_ready(&self) -> bool {
        !self.out.is_empty()
    }

    pub(crate) fn pop(&mut self) -> Option<StepCommand> {
        self.out.pop_front().map(|(_, command)| command)
    }

    /// True time of the first step that has not been taken, ticks.
    pub(crate) fn first_time(&self) -> Option<f64> {
        let ready = self.out.front().map(|&(time, _)| time);
        ready.or_else(|| self.times.get(self.first).copied())
    }

    /// Steps that wait.
    fn waiting(&self) -> usize {
        self.times.len() - self.first
    }

    /// No step waits.
    fn forget(&mut self) {
        self.times.clear();
        self.errors.clear();
        self.first = 0;
    }

    /// Takes some of the next steps of `piece`, whose times never fall; returns the last one's, ticks.
    pub(crate) fn take_from(&mut self, piece: &mut Piece) -> f64 {
        let forward = piece.forward;
        let mut fresh = self.times.len();
        piece.append_times(piece.steps.min(u64::from(TURN_STEPS)) as u32, &mut self.times);
        let Some(&last) = self.times.last() else { return 0.0 };
        if fresh == self.first || forward != self.forward {
            // What begins or turns is taken by itself.
            let rest = self.times.split_off(fresh);
            let mut rest = rest.iter();
            while let Some(&time) =
                rest.as_slice().first().filter(|_| self.waiting() == 0 || forward != self.forward)
            {
                self.step(time, forward);
                rest.next();
            }
            fresh = self.times.len();
            self.times.extend(rest);
        }
        if fresh < self.times.len() && !self.take_run(fresh) {
            // Too much at once, or something among them.
            for part in self.times.split_off(fresh).chunks(PART_STEPS) {
                let fresh = self.times.len();
                self.times.extend_from_slice(part);
                if !self.take_run(fresh) {
                    self.times.truncate(fresh);
                    for &time in part {
                        self.step(time, forward);
                    }
                }
            }
        }
        last
    }

    /// Takes all steps from index `fresh` on, which go on from the one before in every way; `false` where any of them asks
    /// for more than that.
    fn take_run(&mut self, fresh: usize) -> bool {
        let times = &self.times[fresh - 1..];
        let last = times[times.len() - 1];
        let shortest = shortest_gap(times);
        let is_usual = shortest >= self.gap_min
            && last - self.times[self.first] <= self.span_max
            && (last - times[0] <= self.hold_max || longest_gap(times) <= self.hold_max);
        if !is_usual {
            return false;
        }
        self.errors.push(self.error(self.gap_before, times[1] - times[0]));
        if GAP_SHARE * shortest >= self.max_error {
            self.errors.resize(self.errors.len() + times.len() - 2, self.max_error);
        } else {
            append_errors(times, self.max_error, GAP_SHARE, &mut self.errors);
        }
        self.tally.gap_min = smaller(self.tally.gap_min, shortest);
        self.gap_before = times[times.len() - 1] - times[times.len() - 2];
        self.fit_in();
        true
    }

    /// A step at `time` (ticks). Times never fall.
    fn step(&mut self, time: f64, forward: bool) {
        if self.waiting() == 0 {
            return self.first_step(time, forward);
        }
        let last = self.times[self.times.len() - 1];
        let gap = time - last;
        if forward != self.forward {
            return self.step_back(time, gap);
        }
        let gap = larger(gap, self.gap_min);
        self.tally.gap_min = smaller(self.tally.gap_min, gap);
        let time = last + gap;
        self.errors.push(self.error(self.gap_before, gap));
        self.gap_before = gap;
        self.fit_in();
        // None is left where the last one came after a long rest.
        let first = self.times.get(self.first).copied().unwrap_or(time);
        if gap > self.hold_max {
            self.emit_all();
        } else if time - first > self.span_max {
            self.relieve(time);
        }
        self.times.push(time);
    }

    /// Gives out what a step at `time` is too far from.
    fn relieve(&mut self, time: f64) {
        while self.stabbing.is_closed() {
            // It need not wait for a look ahead.
            self.emit();
            self.fit_in();
            if self.times.get(self.first).is_none_or(|first| time - first <= self.span_max) {
                return;
            }
        }
        self.emit_all();
    }

    /// A step after which nothing was known: after a rest, or at the very start of a run.
    fn first_step(&mut self, time: f64, forward: bool) {
        // The board needs an interval of some length.
        let time = larger(time, larger(self.base_ticks, self.base_time) + self.gap_min);
        self.forward = forward;
        self.gap_before = time - self.base_time;
        self.forget();
        self.times.push(time);
    }

    /// A step against the direction of the last one, `gap` later.
    fn step_back(&mut self, time: f64, gap: f64) {
        if gap < self.gap_min {
            return self.take_back();
        }
        self.errors.push(self.error(self.gap_before, gap));
        self.emit_all();
        self.forward = !self.forward;
        self.gap_before = gap;
        self.times.push(time);
    }

    /// The last step never was. The one before it waits for its neighbour again.
    fn take_back(&mut self) {
        self.times.pop();
        if self.waiting() == 0 {
            return self.forget();
        }
        self.errors.pop();
        self.stabbing.clear();
        self.chosen = None;
        if let Some(ahead) = &mut self.ahead {
            ahead.clear();
        }
        self.fit_in();
        let before = self.times[self.first..].iter().rev().nth(1).copied();
        if let Some(last) = self.times[self.first..].last() {
            self.gap_before = last - before.unwrap_or(self.base_time);
        }
    }

    /// Nothing comes before `time`: gives out what could not go on beyond it.
    pub(crate) fn idle_until(&mut self, time: f64) {
        if self.waiting() > 0 && time - self.times[self.times.len() - 1] > self.hold_max {
            self.end();
        }
    }

    /// Gives out what could still have gone on: others wait for it, and their room is used up. What follows the last
    /// step comes no earlier than `next`.
    pub(crate) fn close_early(&mut self, next: f64) {
        match self.waiting() {
            0 => {}
            1 => {
                self.close_last(next);
                self.emit_all();
            }
            _ => {
                self.fit_in();
                if self.out.is_empty() && self.fit_rest() {
                    self.emit();
                }
            }
        }
    }

    /// No more steps in this run, or none for a long time.
    pub(crate) fn end(&mut self) {
        if self.waiting() > 0 {
            self.close_last(f64::INFINITY);
            self.emit_all();
        }
    }

    /// The last step's window, where the next step comes no earlier than `next`.
    fn close_last(&mut self, next: f64) {
        let last = self.times[self.times.len() - 1];
        self.errors.push(self.error(self.gap_before, next - last));
    }

    /// How early or late a step may come between two gaps.
    #[inline]
    fn error(&self, gap_before: f64, gap_after: f64) -> f64 {
        smaller(self.max_error, GAP_SHARE * smaller(gap_before, gap_after))
    }

    /// The steps that wait and whose windows are known.
    fn known(&self) -> u32 {
        (self.errors.len() - self.first) as u32
    }

    /// Closes the commands that cannot go on, as far as windows are known.
    fn fit_in(&mut self) {
        while self.known() > 0 {
            if self.is_after_rest() {
                self.emit_after_rest();
            } else if self.extend() && self.choose(false) {
                self.emit();
            } else {
                return;
            }
        }
    }

    fn extend(&mut self) -> bool {
        let steps = steps_from(self.base_ticks, &self.times, &self.errors, self.first);
        self.stabbing.extend(&steps)
    }

    /// Ends the search with the windows that are known; whether there are any.
    fn fit_rest(&mut self) -> bool {
        if self.known() == 0 {
            return false;
        }
        let steps = steps_from(self.base_ticks, &self.times, &self.errors, self.first);
        self.stabbing.finish(&steps);
        true
    }

    /// Decides how the command that was found ends; `false` while too few steps are known. Where `ends`, no more follow.
    fn choose(&mut self, ends: bool) -> bool {
        let steps = steps_from(self.base_ticks, &self.times, &self.errors, self.first);
        self.chosen = match &mut self.ahead {
            Some(ahead) if (1..=AHEAD_STEPS_MAX).contains(&self.stabbing.passed()) => {
                ahead.choose(&self.stabbing, &steps, ends)
            }
            _ => usual_end(&self.stabbing, &steps, ends),
        };
        self.chosen.is_some()
    }

    /// Gives out all steps; the window of the last is known.
    fn emit_all(&mut self) {
        loop {
            self.fit_in();
            if !self.fit_rest() {
                return self.forget();
            }
            self.choose(true);
            self.emit();
        }
    }

    /// Closes the command that was found.
    fn emit(&mut self) {
        let mut record = self.tally.error_max;
        let steps = steps_from(self.base_ticks, &self.times, &self.errors, self.first);
        let chosen = self.chosen.take();
        let fit = chosen.unwrap_or_else(|| self.stabbing.fit(&steps));
        self.stabbing.note(&fit, &steps, self.max_error, &mut record);
        // Floats hold these integers exactly.
        let clock = self.base_ticks + fit.end();
        let kind =
            StepCommandKind::QueueStep { interval: fit.interval, count: fit.count as u16, add: fit.add };
        self.put(kind, clock as u64, fit.count as usize, record);
        if let Some(ahead) = &mut self.ahead {
            match chosen {
                Some(_) => ahead.go_on(&mut self.stabbing),
                None => ahead.clear(),
            }
        }
    }

    /// Whether the board's 32-bit clock cannot express how far the next step is.
    fn is_after_rest(&self) -> bool {
        self.times[self.first] + self.errors[self.first] - self.base_ticks > IDLE_TICKS_MAX as f64
    }

    /// A single step after a rest that the board's 32-bit clock cannot express: the distance wraps.
    fn emit_after_rest(&mut self) {
        let time = self.times[self.first];
        let mut clock = (time + 0.5) as u64;
        if (clock - self.base) as u32 == 0 {
            clock += 1;
        }
        let interval = (clock - self.base) as u32;
        let kind = StepCommandKind::QueueStep { interval, count: 1, add: 0 };
        self.put(kind, clock, 1, (clock as f64 - time).abs());
    }

    fn put(&mut self, kind: StepCommandKind, end: u64, steps: usize, error: f64) {
        let start = Ticks(self.base);
        let first_time = self.times[self.first];
        if self.told != Some(self.forward) {
            self.told = Some(self.forward);
            self.tally.direction_changes += 1;
            let kind = StepCommandKind::SetDir { forward: self.forward };
            self.out.push_back((first_time, StepCommand { motor: self.motor, kind, start, end: start }));
        }
        self.out.push_back((first_time, StepCommand { motor: self.motor, kind, start, end: Ticks(end) }));
        self.tally.steps += steps as u64;
        self.tally.queue_steps += 1;
        self.tally.error_max = self.tally.error_max.max(error);
        self.base = end;
        self.base_ticks = end as f64;
        self.first += steps;
        self.base_time = self.times[self.first - 1];
        if self.first > GONE_MAX {
            self.times.drain(..self.first);
            self.errors.drain(..self.first);
            self.first = 0;
        }
        self.stabbing.clear();
    }
}

/// The steps from index `first` on whose windows are known.
fn steps_from<'a>(base: f64, times: &'a [f64], errors: &'a [f64], first: usize) -> Steps<'a> {
    Steps { base, times: &times[first..errors.len()], errors: &errors[first..] }
}

#[cfg(test)]
#[path = "compressor_tests.rs"]
mod tests;
