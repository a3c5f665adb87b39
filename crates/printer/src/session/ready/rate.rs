//! The rate of motion. What the user slows down acts at once: the part of the queue that was planned faster goes at a lower
//! rate, and what is planned with the new factor follows at the full one. Nothing goes faster than it was planned, so
//! more speed comes behind the queue.
//!
//! What is wanted follows from what is made now and from what the user said last, and so from the journal: a host that
//! takes a print up comes to the same. Where nothing is leased the rate is 1. Boards without a motion clock are told nothing.

use units::Seconds;

use super::Ready;
use crate::{pace::RATE_ONE, session::lease::RAMP_AT_REST};

/// A board that goes at another rate for so long is told again.
const TELL_AGAIN: Seconds = Seconds(0.5);

/// What the board was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    /// Nothing where another host may have told it anything.
    told: Option<u16>,
    at: Seconds,
}

impl Rate {
    /// Of a board that has just been set up.
    pub(super) const fn new() -> Self {
        Self { told: Some(RATE_ONE), at: Seconds(f64::NEG_INFINITY) }
    }

    /// Of a board that another host has set up.
    pub(super) const fn unknown() -> Self {
        Self { told: None, ..Self::new() }
    }
}

impl Ready {
    fn wanted_rate(&self) -> u16 {
        let moves = self.stream.run().is_some_and(|run| !run.homing);
        let wanted = self.job.as_ref().filter(|_| moves && self.plans_job() && self.lease.is_on());
        let pace = self.stream.pace();
        wanted.zip(pace).map_or(RATE_ONE, |(job, pace)| pace.rate(job.source.wanted_pace()))
    }

    /// Has motion go at the rate that is wanted; while it is held, from when it goes on.
    pub(super) fn keep_rate(&mut self, now: Seconds) {
        if !self.board.layout.has_motion_clock {
            return;
        }
        let rate = self.wanted_rate();
        let is_lost = self.hold.is_none() && !self.board.motion.is_as_told();
        if self.rate.told == Some(rate) && !(is_lost && now - self.rate.at >= TELL_AGAIN) {
            return;
        }
        self.rate = Rate { told: Some(rate), at: now };
        let motion_now = self.board.motion_at(now);
        let is_at_rest = self.stream.run().is_none_or(|run| run.end.is_some_and(|end| motion_now >= end));
        let ramp = if is_at_rest { RAMP_AT_REST } else { self.lease.ramp() };
        let ramp = self.board.ticks(ramp);
        self.board.set_rate(rate, ramp, now);
    }
}
