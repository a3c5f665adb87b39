//! One motor's step times into commands: the windows around the steps, and when a command must be closed.
//!
//! A step may come early or late by `max_error` and by a quarter of the gap to either neighbour, so two steps never come
//! nearer to each other than half their true gap. Every clock is integer arithmetic from the clock before, and every
//! window lies around the true time: errors never add up.
//!
//! Whether a command is closed depends on the step times alone, never on when they become known: a later step either
//! closes it by its distance or could have gone on with it. Only where another motor's pieces run out of room is one
//! closed early, after a number of moves that is always the same.

use crate::stabbing::{FIT_STEPS_MAX, Stabbing, larger, smaller};
use crate::{IDLE_TICKS_MAX, StepCommand, StepCommandKind};
use std::collections::VecDeque;
use units::{Seconds, Ticks};

/// The most steps of one motor that wait for their command to be closed.
pub const STEPS_BUFFERED_MAX: usize = FIT_STEPS_MAX as usize + 2;
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
const GAP_SHARE: f64 = 0.25;

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
    /// True times of the steps since, one way; the last one's window is not known yet.
    times: Vec<f64>,
    /// How far the last step is from the one before it.
    gap_before: f64,
    forward: bool,
    /// Direction that the motor has been told in this run.
    told: Option<bool>,
    stabbing: Stabbing,
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
    pub(crate) fn new(motor: usize, ticks_per_s: f64, max_error: Seconds) -> Self {
        Self {
            motor,
            max_error: max_error.0 * ticks_per_s,
            gap_min: gap_min_ticks(ticks_per_s),
            hold_max: STEP_HOLD_MAX.0 * ticks_per_s,
            span_max: RUN_SPAN_MAX.0 * ticks_per_s,
            base: 0,
            base_ticks: 0.0,
            base_time: f64::NEG_INFINITY,
            times: Vec::new(),
            gap_before: 0.0,
            forward: true,
            told: None,
            stabbing: Stabbing::new(),
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
        self.times.clear();
        self.told = None;
        self.stabbing.clear();
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
        ready.or(self.times.first().copied())
    }

    /// A step at `time` (ticks). Times never fall.
    #[inline]
    pub(crate) fn step(&mut self, time: f64, forward: bool) {
        let Some(&last) = self.times.last() else { return self.first_step(time, forward) };
        let gap = time - last;
        if forward != self.forward {
            return self.step_back(time, gap);
        }
        let gap = larger(gap, self.gap_min);
        self.tally.gap_min = smaller(self.tally.gap_min, gap);
        let time = last + gap;
        // The usual case of `take_last`.
        let error = self.error(self.gap_before, gap);
        let ticks = last - self.base_ticks;
        if self.stabbing.count() == 0 || !self.stabbing.take(ticks - error, ticks + error) {
            self.take_last(time);
        }
        self.gap_before = gap;
        // None is left where the last one came after a long rest.
        let first = self.times.first().copied().unwrap_or(time);
        if gap > self.hold_max || time - first > self.span_max {
            self.emit_all(time);
        }
        self.times.push(time);
    }

    /// A step after which nothing was known: after a rest, or at the very start of a run.
    fn first_step(&mut self, time: f64, forward: bool) {
        // The board needs an interval of some length.
        let time = larger(time, larger(self.base_ticks, self.base_time) + self.gap_min);
        self.forward = forward;
        self.gap_before = time - self.base_time;
        self.times.push(time);
    }

    /// A step against the direction of the last one, `gap` later.
    fn step_back(&mut self, time: f64, gap: f64) {
        if gap < self.gap_min {
            return self.take_back();
        }
        self.emit_all(time);
        self.forward = !self.forward;
        self.gap_before = gap;
        self.times.push(time);
    }

    /// The last step never was. The one before it has been fitted in already, and must wait for its neighbour again.
    fn take_back(&mut self) {
        self.times.pop();
        let Some(last) = self.times.pop() else { return };
        self.stabbing.clear();
        self.take_last(last);
        self.gap_before = last - self.times.last().copied().unwrap_or(self.base_time);
        self.times.push(last);
    }

    /// Nothing comes before `time`: gives out what could not go on beyond it.
    pub(crate) fn idle_until(&mut self, time: f64) {
        if self.times.last().is_some_and(|last| time - last > self.hold_max) {
            self.end();
        }
    }

    /// Gives out what could still have gone on: others wait for it, and their room is used up. What follows the last
    /// step comes no earlier than `next`.
    pub(crate) fn close_early(&mut self, next: f64) {
        if self.times.len() <= 1 {
            return self.emit_all(next);
        }
        self.take_all_but(1, next);
        if self.out.is_empty() {
            self.emit();
        }
    }

    /// No more steps in this run, or none for a long time.
    pub(crate) fn end(&mut self) {
        self.emit_all(f64::INFINITY);
    }

    /// Fits the last step in, now that its neighbour at `next` is known, and any that a closed command left.
    #[inline(never)]
    fn take_last(&mut self, next: f64) {
        self.take_all_but(0, next);
    }

    /// Fits in all steps but the last `open` ones; whatever follows the last of all comes at `next`.
    fn take_all_but(&mut self, open: usize, next: f64) {
        while (self.stabbing.count() as usize) + open < self.times.len() {
            let index = self.stabbing.count() as usize;
            let (earliest, latest) = self.window(index, next);
            if index == 0 && latest > IDLE_TICKS_MAX as f64 {
                self.emit_after_rest();
            } else if !self.stabbing.take(earliest, latest) {
                self.emit();
            }
        }
    }

    /// When step `index` may come, in ticks after the last step given out.
    fn window(&self, index: usize, next: f64) -> (f64, f64) {
        let time = self.times[index];
        let before = if index == 0 { self.base_time } else { self.times[index - 1] };
        let after = self.times.get(index + 1).copied().unwrap_or(next);
        let error = self.error(time - before, after - time);
        let ticks = time - self.base_ticks;
        (larger(ticks - error, 1.0), ticks + error)
    }

    /// How early or late a step may come between two gaps.
    #[inline]
    fn error(&self, gap_before: f64, gap_after: f64) -> f64 {
        smaller(self.max_error, GAP_SHARE * smaller(gap_before, gap_after))
    }

    /// Gives out all steps; whatever follows them comes at `next`.
    fn emit_all(&mut self, next: f64) {
        loop {
            self.take_last(next);
            if self.times.is_empty() {
                break;
            }
            self.emit();
        }
    }

    /// Closes one command with the steps taken so far, or with the first of them.
    fn emit(&mut self) {
        let last = self.times[self.stabbing.count() as usize - 1];
        let fit = self.stabbing.fit(last - self.base_ticks);
        // Floats hold these integers exactly, and need no conversion to be compared.
        let mut clock = self.base_ticks;
        let mut interval = f64::from(fit.interval);
        let add = f64::from(fit.add);
        let mut error = 0.0;
        for &time in &self.times[..fit.count as usize] {
            clock += interval;
            interval += add;
            error = larger(error, (clock - time).abs());
        }
        let kind =
            StepCommandKind::QueueStep { interval: fit.interval, count: fit.count as u16, add: fit.add };
        self.put(kind, clock as u64, fit.count as usize, error);
    }

    /// A single step after a rest that the board's 32-bit clock cannot express: the distance wraps.
    fn emit_after_rest(&mut self) {
        let time = self.times[0];
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
        let first_time = self.times[0];
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
        self.base_time = self.times[steps - 1];
        self.times.drain(..steps);
        self.stabbing.clear();
    }
}
