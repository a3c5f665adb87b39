//! What the host knows of the board's motion clock, by which steps are made: it follows the hardware clock, but for
//! holds, which leave it behind.
//!
//! While motion goes at its full rate the two are a fixed lag apart. The board tells that lag, several times a second
//! while there is a lease; in a ramp there is none, and nothing new may be started. A board without a motion clock
//! never tells, and the lag stays zero.
//!
//! After a long silence 32 bits are little: what the board said meanwhile may have waited on the line, and both clocks may
//! have gone round unseen. Then only what was certainly said since counts.
//!
//! Knows no board and no lease. Clocks in ticks, 64 bits: those of the motion clock are the host's own continuation of
//! the 32 bits on the wire.

use units::{Clock32, Ticks};

/// After a silence of this many ticks, what arrives may have been said at any time in it.
const SILENCE_LONG: Ticks = Ticks(1 << 30);
/// The full rate on the wire.
const RATE_ONE: u16 = 4096;

/// What the board's motion does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MotionState {
    Running,
    Slowing,
    Held,
    Speeding,
}

/// Why motion is held, or slows down to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HoldReason {
    /// It is not.
    None,
    /// A host asked for it.
    Asked,
    /// The host was not heard of in time.
    HostAway,
    /// The queue was about to run dry.
    QueueDry,
}

/// A `motion_state` as it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotionReport {
    pub(super) clock: Clock32,
    pub(super) motion: Clock32,
    pub(super) rate: u16,
    pub(super) state: MotionState,
    pub(super) reason: HoldReason,
}

impl MotionReport {
    /// As the wire's numbers say.
    pub(super) const fn new(clock: u32, motion: u32, rate: u16, state: u8, reason: u8) -> Self {
        Self {
            clock: Clock32(clock),
            motion: Clock32(motion),
            rate,
            state: match state {
                1 => MotionState::Slowing,
                2 => MotionState::Held,
                3 => MotionState::Speeding,
                _ => MotionState::Running,
            },
            reason: match reason {
                1 => HoldReason::Asked,
                2 => HoldReason::HostAway,
                3 => HoldReason::QueueDry,
                _ => HoldReason::None,
            },
        }
    }
}

/// The motion clock as last told.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionTime {
    /// The hardware clock of what is known.
    clock: Ticks,
    /// The motion clock then.
    motion: Ticks,
    rate: u16,
    state: MotionState,
    /// Since this hardware clock nothing is claimed beyond what is known: the board may have done anything.
    in_doubt: Option<Ticks>,
}

/// When a report came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard {
    /// The hardware clock, about.
    pub(super) clock_now: Ticks,
    /// It was said after this.
    pub(super) said_after: Ticks,
    /// How far off `clock_now` may be.
    pub(super) slack: Ticks,
}

impl Default for MotionTime {
    fn default() -> Self {
        Self {
            clock: Ticks(0),
            motion: Ticks(0),
            rate: RATE_ONE,
            state: MotionState::Running,
            in_doubt: None,
        }
    }
}

impl MotionTime {
    /// The motion clock at a hardware clock; never beyond what it can be. While it slows, no more is claimed than was told:
    /// what it was told to run at, it runs at no longer.
    pub(super) fn at(&self, clock: Ticks) -> Ticks {
        if self.in_doubt.is_some() {
            return self.motion;
        }
        let since = clock.0 as i64 - self.clock.0 as i64;
        let made = match (self.state, self.rate) {
            (MotionState::Running, RATE_ONE) => since,
            (MotionState::Slowing, _) => 0,
            (_, rate) => since.max(0) / i64::from(RATE_ONE) * i64::from(rate.min(RATE_ONE)),
        };
        Ticks(self.motion.0.saturating_add_signed(made))
    }

    /// The latest that the motion clock can be at a hardware clock.
    pub(super) fn latest(&self, clock: Ticks) -> Ticks {
        if self.is_steady() { self.at(clock) } else { self.motion + clock.saturating_sub(self.clock) }
    }

    /// The hardware clock at which the motion clock gets to `motion`, should it run at the full rate from now on.
    pub(super) fn hardware(&self, motion: Ticks, clock_now: Ticks) -> Ticks {
        let ahead = motion.0 as i64 - self.at(clock_now).0 as i64;
        Ticks(clock_now.0.saturating_add_signed(ahead))
    }

    /// Whether motion is at rest, wherever on its path.
    pub(super) const fn is_held(&self) -> bool {
        self.in_doubt.is_none() && matches!(self.state, MotionState::Held)
    }

    /// Whether the two clocks are a fixed lag apart.
    pub(super) const fn is_steady(&self) -> bool {
        self.in_doubt.is_none() && matches!(self.state, MotionState::Running) && self.rate == RATE_ONE
    }

    /// The clock up to which the board's word is known.
    pub(super) const fn known_until(&self) -> Ticks {
        self.clock
    }

    /// Nothing has been leased before `clock`, so the two clocks run on together up to there.
    pub(super) fn trust(&mut self, clock: Ticks) {
        if self.is_steady() {
            self.motion = self.at(clock);
            self.clock = clock;
        }
    }

    /// The board has not been heard of for too long, as is found at `clock_now`: whether motion goes on is not known.
    pub(super) fn doubt(&mut self, clock_now: Ticks) {
        self.in_doubt.get_or_insert(clock_now);
    }

    /// Takes the board's word; gives the report's clock, or nothing for one that cannot be, or may be old.
    pub(super) fn report(&mut self, report: &MotionReport, heard: Heard) -> Option<Ticks> {
        let Heard { clock_now, said_after, slack } = heard;
        let is_stale = |doubted: Ticks| doubted > self.clock + SILENCE_LONG && said_after < doubted;
        if self.in_doubt.is_some_and(is_stale) {
            return None;
        }
        let clock = clock_now.nearest(report.clock);
        if clock > clock_now + slack {
            return None;
        }
        self.motion = self.about(report, clock).nearest(report.motion);
        self.clock = clock;
        self.rate = report.rate;
        self.state = report.state;
        self.in_doubt = None;
        Some(clock)
    }

    /// About where the motion clock is. Only a host ends a hold, so motion that runs after a silence has run all along;
    /// what is held by then was so soon after the last renewal of the lease.
    fn about(&self, report: &MotionReport, clock: Ticks) -> Ticks {
        match (self.in_doubt, report.state) {
            (None, _) => self.at(clock),
            (Some(_), MotionState::Running) => {
                let since = clock.saturating_sub(self.clock).0;
                self.motion + Ticks(since / u64::from(RATE_ONE) * u64::from(report.rate.min(RATE_ONE)))
            }
            (Some(_), _) => self.motion,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn heard(clock_now: u64) -> Heard {
        Heard { clock_now: Ticks(clock_now), said_after: Ticks(0), slack: Ticks(100) }
    }

    #[test]
    fn without_a_word_of_the_board_the_clocks_are_one() {
        let time = MotionTime::default();
        assert!(time.is_steady());
        assert_eq!(time.at(Ticks(12345)), Ticks(12345));
        assert_eq!(time.hardware(Ticks(7000), Ticks(12345)), Ticks(7000));
    }

    #[test]
    fn a_hold_leaves_a_lag_however_long_it_was() {
        let mut time = MotionTime::default();
        let start = (7 << 32) - 50;
        let mut report = |clock: u64, motion: u64, rate, state| {
            let report = MotionReport::new(clock as u32, motion as u32, rate, state, 2);
            assert_eq!(time.report(&report, heard(clock + 10)), Some(Ticks(clock)));
            time
        };
        report(start, start, 4096, 0);
        report(start + 10, start + 10, 4095, 1);
        assert!(!report(start + 100, start + 60, 0, 2).is_steady());
        for quarter in 1..40 {
            let held = report(start + 100 + (quarter << 30), start + 60, 0, 2);
            assert_eq!(held.at(Ticks(start + (quarter << 30) + 999)), Ticks(start + 60));
        }
        let end = start + 100 + (40 << 30);
        let time = report(end, start + 90, 4096, 0);
        assert!(time.is_steady());
        assert_eq!(time.at(Ticks(end + 5)), Ticks(start + 95));
        assert_eq!(time.hardware(Ticks(start + 95), Ticks(end)), Ticks(end + 5));
    }

    #[test]
    fn in_doubt_nothing_is_claimed_until_the_board_says_more() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1000));
        time.doubt(Ticks(4000));
        assert_eq!((time.at(Ticks(5000)), time.is_steady()), (Ticks(1000), false));
        let report = MotionReport::new(5000, 5000, 4096, 0, 0);
        // From the future: not a word of this board's.
        assert_eq!(time.report(&report, heard(1000)), None);
        assert_eq!(time.report(&report, heard(5001)), Some(Ticks(5000)));
        assert_eq!(time.at(Ticks(6000)), Ticks(6000));
    }

    #[test]
    fn after_a_long_silence_only_what_was_said_since_counts() {
        let silent: u64 = 3 << 32;
        for (motion, state, rate, expected) in
            [(silent + 500, 0, 4096, silent + 500), (1700, 2, 0, 1700), (1700, 1, 2000, 1700)]
        {
            let mut time = MotionTime::default();
            time.trust(Ticks(1000));
            time.doubt(Ticks(silent));
            // It was on the line all the while, and its clock might be one of just now.
            let old = MotionReport::new(silent as u32 + 400, 1250, 4096, 0, 0);
            assert_eq!(time.report(&old, heard(silent + 450)), None);
            let new = MotionReport::new(silent as u32 + 500, motion as u32, rate, state, 2);
            let since = Heard { said_after: Ticks(silent + 100), ..heard(silent + 600) };
            assert_eq!(time.report(&new, since), Some(Ticks(silent + 500)));
            assert_eq!(time.at(Ticks(silent + 500)), Ticks(expected));
        }
    }
}
