//! A fingerprint of every edge on the motors' pins.
//!
//! An edge counts with its motor, its kind and its distance in ticks of the motion clock from the first step of its run
//! of motion; the end of a pulse, which waits for nothing, with the pulse's length. Two
//! prints with the same fingerprint made the same pulses, however late the board got its orders and wherever on its clock
//! the runs began. Homing is left out: there a switch decides when a run ends.
//!
//! Not a cryptographic hash: it tells accidents apart, not adversaries.

use std::collections::VecDeque;

use printer::machine::MOTORS;
use units::Ticks;

/// The most runs that may be announced and not yet begun.
const RUNS_AHEAD_MAX: usize = 4096;

/// An odd number without structure (the golden ratio's digits).
const MULTIPLIER: u64 = 0x9e37_79b9_7f4a_7c15;

/// What an edge is.
#[derive(Clone, Copy, Debug)]
enum Kind {
    StepForward = 1,
    StepBackward = 2,
    StepEnd = 3,
    Forward = 4,
    Backward = 5,
    Run = 6,
}

#[derive(Clone, Copy, Debug, Default)]
struct Motor {
    /// Of its pulses.
    hash: u64,
    /// Of the changes of its direction pin.
    direction_hash: u64,
    /// A change of direction belongs to the run of the step that follows it.
    direction: Option<(Ticks, bool)>,
    /// The last step belongs to a run that counts.
    in_run: bool,
}

/// The fingerprint of the edges so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Digest {
    motors: [Motor; MOTORS],
    /// Runs that have not begun: from when on, and whether they home.
    ahead: VecDeque<(Ticks, bool)>,
    /// Where the present run's first step was; `None` while homing and before any run.
    base: Option<u64>,
    runs: u64,
    /// The run that was put aside in a pause: where its first step was, or when it was to begin.
    aside: Option<Aside>,
}

#[derive(Clone, Debug)]
struct Aside {
    base: Option<u64>,
    ahead: VecDeque<(Ticks, bool)>,
}

impl Digest {
    /// The present run is put aside: what is made until it goes on does not count.
    pub(crate) fn put_aside(&mut self) {
        let (base, ahead) = (self.base.take(), core::mem::take(&mut self.ahead));
        self.aside = Some(Aside { base, ahead });
    }

    /// The run that was put aside goes on, so much later.
    pub(crate) fn go_on(&mut self, by: Ticks) {
        if let Some(Aside { base, ahead }) = self.aside.take() {
            self.base = base.map(|base| base + by.0);
            self.ahead = ahead.into_iter().map(|(at, homing)| (at + by, homing)).collect();
        }
    }

    /// A run of motion begins at this clock or, with its first step, somewhat later.
    pub(crate) fn expect_run(&mut self, at: Ticks, homing: bool) {
        if self.ahead.len() < RUNS_AHEAD_MAX {
            self.ahead.push_back((at, homing || self.aside.is_some()));
        }
    }

    /// A pulse began.
    #[inline]
    pub(crate) fn step(&mut self, motor: usize, at: Ticks, forward: bool) {
        if !self.ahead.is_empty() {
            self.begin_runs(at);
        }
        let Some(state) = self.motors.get_mut(motor) else { return };
        let direction = state.direction.take();
        state.in_run = self.base.is_some();
        let Some(base) = self.base else { return };
        if let Some((changed, forward)) = direction {
            let kind = if forward { Kind::Forward } else { Kind::Backward };
            state.direction_hash = mix(state.direction_hash, changed.0.wrapping_sub(base) << 3 | kind as u64);
        }
        state.add(if forward { Kind::StepForward } else { Kind::StepBackward }, at.0.wrapping_sub(base));
    }

    /// A pulse ended, so long after it began.
    #[inline]
    pub(crate) fn step_end(&mut self, motor: usize, lasted: Ticks) {
        if let Some(state) = self.motors.get_mut(motor).filter(|state| state.in_run) {
            state.add(Kind::StepEnd, lasted.0);
        }
    }

    /// The direction pin changed.
    #[inline]
    pub(crate) fn direction(&mut self, motor: usize, at: Ticks, forward: bool) {
        if let Some(state) = self.motors.get_mut(motor) {
            state.direction = Some((at, forward));
        }
    }

    /// The fingerprint of all edges, as 16 hexadecimal digits.
    pub(crate) fn text(&self) -> String {
        let all = self.motors.iter().fold(self.step_hash(), |hash, motor| mix(hash, motor.direction_hash));
        format!("{all:016x}")
    }

    /// The same of the pulses alone, each with its direction: when the direction pin changed does not count, as long as it
    /// was before the pulse.
    pub(crate) fn step_text(&self) -> String {
        format!("{:016x}", self.step_hash())
    }

    fn step_hash(&self) -> u64 {
        self.motors.iter().fold(self.runs, |hash, motor| mix(hash, motor.hash))
    }

    #[cold]
    fn begin_runs(&mut self, at: Ticks) {
        while let Some((_, homing)) = self.ahead.pop_front_if(|(start, _)| *start <= at) {
            if homing {
                self.base = None;
                continue;
            }
            self.base = Some(at.0);
            self.runs += 1;
            for motor in &mut self.motors {
                motor.add(Kind::Run, self.runs);
            }
        }
    }
}

impl Motor {
    #[inline]
    fn add(&mut self, kind: Kind, value: u64) {
        self.hash = mix(self.hash, value << 3 | kind as u64);
    }
}

#[inline]
fn mix(hash: u64, value: u64) -> u64 {
    let product = (hash.rotate_left(29) ^ value).wrapping_mul(MULTIPLIER);
    product ^ product >> 32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two runs with a reversal, beginning at these clocks; `nudge` is added to one step.
    fn digest(starts: [u64; 2], first_step: u64, nudge: u64) -> String {
        let mut digest = Digest::default();
        for start in starts {
            digest.expect_run(Ticks(start), false);
        }
        for start in starts {
            let base = start + first_step;
            digest.step(0, Ticks(base), true);
            digest.step_end(0, Ticks(5));
            digest.step(1, Ticks(base + 3), true);
            digest.direction(0, Ticks(base + 50), false);
            digest.step(0, Ticks(base + 100 + nudge), false);
        }
        digest.text()
    }

    #[test]
    fn only_distances_from_the_first_step_count() {
        let one = digest([1000, 5000], 7, 0);
        assert_eq!(one, digest([90_000, 123_456], 19, 0));
        assert_ne!(one, digest([1000, 5000], 7, 1));
        assert_eq!(one.len(), 16);
    }

    #[test]
    fn what_is_made_in_a_pause_does_not_count() {
        let run = |pause: Option<u64>| {
            let mut digest = Digest::default();
            digest.expect_run(Ticks(1000), false);
            digest.step(0, Ticks(1100), true);
            digest.step_end(0, Ticks(5));
            let by = pause.unwrap_or_default();
            if pause.is_some() {
                digest.put_aside();
                digest.expect_run(Ticks(1200), false);
                digest.step(0, Ticks(1300), false);
                digest.step_end(0, Ticks(5));
                digest.go_on(Ticks(by));
            }
            digest.step(0, Ticks(1400 + by), true);
            digest.step_end(0, Ticks(5));
            digest.step_text()
        };
        assert_eq!(run(None), run(Some(0)));
        assert_eq!(run(None), run(Some(777)));
    }

    #[test]
    fn homing_does_not_count() {
        let mut digest = Digest::default();
        let empty = digest.text();
        digest.expect_run(Ticks(10), true);
        digest.step(0, Ticks(20), true);
        digest.step_end(0, Ticks(5));
        assert_eq!(digest.text(), empty);
    }

    #[test]
    fn a_direction_that_changed_before_the_run_counts_with_it() {
        let run = |changed: u64| {
            let mut digest = Digest::default();
            digest.direction(0, Ticks(changed), false);
            digest.expect_run(Ticks(100), false);
            digest.step(0, Ticks(110), false);
            [digest.text(), digest.step_text()]
        };
        let ([all, steps], [other, same]) = (run(50), run(60));
        assert_ne!(all, other);
        assert_eq!(steps, same);
    }
}
