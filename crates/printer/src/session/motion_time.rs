//! What the host knows of the board's motion clock, by which steps are made: it follows the hardware clock, but for
//! holds, which leave it behind, and for motion that this host slows down.
//!
//! While motion goes at its full rate the two are a fixed lag apart. The board tells that lag, several times a second
//! while there is a lease or motion is slowed down; in a ramp there is none, and where it is not fixed nothing new may be
//! started. A board without a motion clock never tells, and the lag stays zero.
//!
//! What is claimed of the motion clock is never beyond what it can be: steps that have not been made still take room.
//!
//! After a long silence 32 bits are little: what the board said meanwhile may have waited on the line, and both clocks may
//! have gone round unseen. Then only what was certainly said since counts.
//!
//! Knows no board and no lease. Clocks in ticks, 64 bits: those of the motion clock are the host's own continuation of
//! the 32 bits on the wire.

use core::num::NonZeroU16;

use units::{Clock32, Ticks};

use crate::pace::RATE_ONE;

/// After a silence of this many ticks, what arrives may have been said at any time in it.
const SILENCE_LONG: Ticks = Ticks(1 << 30);

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
    /// The hardware clock of what is claimed.
    clock: Ticks,
    /// The motion clock then, at least.
    motion: Ticks,
    /// As the board last said.
    rate: u16,
    state: MotionState,
    /// It slows down, or is slow, because it is held.
    is_hold: bool,
    /// The rate that the board was last told.
    told: u16,
    /// When it was told that first, or to rest or to go on.
    told_at: Ticks,
    /// The lowest rate that it may be heading for: of all that it was told since its last word that fits what it had been
    /// told by then. Never above `told`, and 0 for rest.
    least_told: u16,
    /// It was told to come to rest, and not to go on.
    rests: bool,
    /// The clock of its last word.
    heard: Ticks,
    /// The motion clock that it said.
    said: Ticks,
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
            is_hold: false,
            told: RATE_ONE,
            told_at: Ticks(0),
            least_told: RATE_ONE,
            rests: false,
            heard: Ticks(0),
            said: Ticks(0),
            in_doubt: None,
        }
    }
}

impl MotionTime {
    /// The motion clock at a hardware clock; never beyond what it can be. While it comes to rest, no more is claimed than
    /// was told: what it was told to run at, it runs at no longer.
    pub(super) fn at(&self, clock: Ticks) -> Ticks {
        if self.in_doubt.is_some() || self.rests {
            return self.motion;
        }
        let since = clock.0 as i64 - self.clock.0 as i64;
        let made = match self.state {
            // A lower rate may be in force already, a higher one not yet.
            MotionState::Running => scaled(since, self.rate.min(self.least_told)),
            MotionState::Slowing if self.is_hold => 0,
            MotionState::Slowing | MotionState::Speeding => {
                scaled(since.max(0), self.rate.min(self.least_told))
            }
            MotionState::Held => 0,
        };
        Ticks(self.motion.0.saturating_add_signed(made))
    }

    /// The latest that the motion clock can be at a hardware clock.
    pub(super) fn latest(&self, clock: Ticks) -> Ticks {
        if self.is_steady() { self.at(clock) } else { self.said + clock.saturating_sub(self.heard) }
    }

    /// The hardware clock at which the motion clock gets to `motion` at the earliest: at the full rate from now on.
    pub(super) fn hardware(&self, motion: Ticks, clock_now: Ticks) -> Ticks {
        let ahead = motion.0 as i64 - self.latest(clock_now).0 as i64;
        Ticks(clock_now.0.saturating_add_signed(ahead))
    }

    /// The rate that motion has, or is about to have where that is more; nothing where that cannot be said.
    pub(super) fn even_rate(&self) -> Option<NonZeroU16> {
        NonZeroU16::new(self.rate.max(self.told)).filter(|_| self.is_running())
    }

    /// The board is told another rate.
    pub(super) fn tell(&mut self, rate: u16, clock_now: Ticks) {
        self.rebase(clock_now);
        if rate != self.told {
            self.told_at = clock_now;
        }
        self.told = rate;
        self.least_told = self.least_told.min(rate);
    }

    /// The board is told to come to rest, or to go on.
    pub(super) fn tell_rest(&mut self, rests: bool, clock_now: Ticks) {
        self.rebase(clock_now);
        if rests != self.rests {
            self.told_at = clock_now;
        }
        self.rests = rests;
        if rests {
            self.least_told = 0;
        }
    }

    /// What is claimed by now stays so: what the board is told next is not in force before.
    fn rebase(&mut self, clock_now: Ticks) {
        if !self.may_rest() && !self.rests {
            let clock = clock_now.max(self.clock);
            self.motion = self.at(clock);
            self.clock = clock;
        }
    }

    /// Whether the board's word, said at `clock`, can follow from what it was told last, and so from nothing before that. In
    /// a ramp downwards it may be on its way to what it was told before.
    fn fits(&self, clock: Ticks) -> bool {
        let is_on_the_way = match self.state {
            MotionState::Running => self.rate == self.told,
            MotionState::Speeding => self.rate <= self.told,
            MotionState::Slowing | MotionState::Held => false,
        };
        is_on_the_way && !self.rests && clock >= self.told_at
    }

    /// Whether motion goes at the rate that the board was last told.
    pub(super) const fn is_as_told(&self) -> bool {
        self.is_running() && self.rate == self.told && self.least_told == self.told
    }

    /// Whether motion is at rest, wherever on its path.
    pub(super) const fn is_held(&self) -> bool {
        self.in_doubt.is_none() && matches!(self.state, MotionState::Held)
    }

    /// Whether motion is held, slows down for that, or what it does is not known.
    pub(super) const fn may_rest(&self) -> bool {
        self.in_doubt.is_some() || self.is_hold
    }

    /// Whether motion goes at an even rate.
    pub(super) const fn is_running(&self) -> bool {
        self.in_doubt.is_none() && !self.rests && matches!(self.state, MotionState::Running)
    }

    /// Whether the two clocks are a fixed lag apart, and stay so.
    pub(super) const fn is_steady(&self) -> bool {
        self.is_running() && self.rate == RATE_ONE && self.least_told == RATE_ONE
    }

    /// The clock up to which the board's word is known.
    pub(super) const fn known_until(&self) -> Ticks {
        self.heard
    }

    /// Nothing has been leased before `clock`, so the two clocks run on together up to there.
    pub(super) fn trust(&mut self, clock: Ticks) {
        if self.is_steady() {
            self.motion = self.at(clock);
            self.said = self.motion;
            (self.clock, self.heard) = (clock, clock);
        }
    }

    /// The board has not been heard of for too long, as is found at `clock_now`: whether motion goes on is not known.
    pub(super) fn doubt(&mut self, clock_now: Ticks) {
        self.in_doubt.get_or_insert(clock_now);
    }

    /// Takes the board's word; gives the report's clock, or nothing for one that cannot be, or may be old.
    pub(super) fn report(&mut self, report: &MotionReport, heard: Heard) -> Option<Ticks> {
        let Heard { clock_now, said_after, slack } = heard;
        let is_stale = |doubted: Ticks| doubted > self.heard + SILENCE_LONG && said_after < doubted;
        if self.in_doubt.is_some_and(is_stale) {
            return None;
        }
        let clock = clock_now.nearest(report.clock);
        if clock > clock_now + slack {
            return None;
        }
        self.motion = self.about(report, clock).nearest(report.motion);
        self.said = self.motion;
        (self.clock, self.heard) = (clock, clock);
        self.rate = report.rate.min(RATE_ONE);
        self.state = report.state;
        self.is_hold = report.reason != HoldReason::None;
        self.in_doubt = None;
        if self.fits(clock) {
            self.least_told = self.told;
        }
        Some(clock)
    }

    /// About where the motion clock is. Only a host ends a hold, so motion that runs after a silence has run all along;
    /// what is held by then was so soon after the last renewal of the lease.
    fn about(&self, report: &MotionReport, clock: Ticks) -> Ticks {
        match (self.in_doubt, report.state) {
            (None, _) => self.at(clock),
            (Some(_), MotionState::Running) => {
                let since = clock.saturating_sub(self.clock).0 as i64;
                Ticks(self.motion.0.saturating_add_signed(scaled(since, report.rate.min(RATE_ONE))))
            }
            (Some(_), _) => self.motion,
        }
    }
}

/// Motion in so many ticks at a rate, rounded down.
fn scaled(ticks: i64, rate: u16) -> i64 {
    let scaled = i128::from(ticks) * i128::from(rate);
    i64::try_from(scaled.div_euclid(i128::from(RATE_ONE))).unwrap_or(0)
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
    fn a_lower_rate_is_believed_at_once_and_a_higher_one_when_the_board_says_so() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1000));
        time.tell(1024, Ticks(2000));
        // Whether it has been heard yet is not known: never beyond what it can be.
        assert_eq!((time.at(Ticks(2000)), time.at(Ticks(6003))), (Ticks(2000), Ticks(3000)));
        assert_eq!(time.latest(Ticks(6003)), Ticks(6003));
        assert_eq!(time.even_rate().map(NonZeroU16::get), Some(RATE_ONE));
        assert!(!time.is_steady() && time.is_running() && !time.is_as_told());
        let mut report = |clock: u32, motion: u32, rate, state| {
            let report = MotionReport::new(clock, motion, rate, state, 0);
            assert!(time.report(&report, heard(u64::from(clock) + 10)).is_some());
            time
        };
        assert_eq!(report(6000, 5000, 2000, 1).at(Ticks(6400)), Ticks(5100));
        let slow = report(7000, 5500, 1024, 0);
        assert!(slow.is_as_told() && !slow.is_steady() && !slow.may_rest());
        assert_eq!((slow.at(Ticks(11_003)), slow.at(Ticks(6996))), (Ticks(6500), Ticks(5499)));
        assert_eq!(slow.hardware(Ticks(6000), Ticks(7000)), Ticks(7500));
        let mut time = slow;
        time.tell(RATE_ONE, Ticks(11_000));
        assert_eq!((time.at(Ticks(11_000)), time.at(Ticks(15_000))), (Ticks(6500), Ticks(7500)));
        assert!(!time.is_steady());
        let report = MotionReport::new(16_000, 9000, RATE_ONE, 0, 0);
        assert!(time.report(&report, heard(16_000)).is_some() && time.is_steady());
        assert_eq!(time.at(Ticks(16_100)), Ticks(9100));
    }

    #[test]
    fn what_is_told_to_rest_makes_nothing_more_until_the_board_says_so() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1000));
        time.tell_rest(true, Ticks(3000));
        assert_eq!((time.at(Ticks(9000)), time.is_running()), (Ticks(3000), false));
        assert_eq!(time.latest(Ticks(9000)), Ticks(9000));
        assert!(time.report(&MotionReport::new(3500, 3500, RATE_ONE, 0, 0), heard(3600)).is_some());
        assert_eq!(time.at(Ticks(9000)), Ticks(3500));
        assert!(time.report(&MotionReport::new(5000, 4200, 0, 2, 1), heard(5000)).is_some());
        time.tell_rest(false, Ticks(6000));
        assert_eq!((time.at(Ticks(9000)), time.is_held()), (Ticks(4200), true));
        assert!(time.report(&MotionReport::new(8000, 5000, RATE_ONE, 0, 0), heard(8000)).is_some());
        assert_eq!((time.at(Ticks(9000)), time.is_steady()), (Ticks(6000), true));
    }

    /// At 1 MHz, with a ramp of 0.3 s.
    const fn said(clock: u32, motion: u32, rate: u16, state: u8) -> MotionReport {
        MotionReport::new(clock, motion, rate, state, 0)
    }

    #[test]
    fn what_is_undone_in_the_ramp_is_not_claimed() {
        const START: u64 = 1_000_000;
        let mut time = MotionTime::default();
        time.trust(Ticks(START));
        time.tell(41, Ticks(START));
        assert!(time.report(&said(1_002_000, 1_002_000, 4088, 1), heard(START + 3000)).is_some());
        let before = time.at(Ticks(START + 240_000));
        assert_eq!(before, Ticks(1_004_382));
        time.tell(RATE_ONE, Ticks(START + 240_000));
        assert_eq!(time.at(Ticks(START + 240_000)), before);
        // The board may have come to the lower rate and stay there, for all that is known; or it never left the full one.
        assert_eq!(time.at(Ticks(START + 340_000)), Ticks(1_005_382));
        assert_eq!(time.latest(Ticks(START + 340_000)), Ticks(START + 340_000));
        // Said before it was told: still the ramp downwards.
        assert!(time.report(&said(1_239_000, 1_145_000, 856, 1), heard(START + 241_000)).is_some());
        assert_eq!(time.at(Ticks(START + 339_000)), Ticks(1_146_000));
        // It goes up again, and falls no more.
        assert!(time.report(&said(1_260_000, 1_149_500, 1000, 3), heard(START + 261_000)).is_some());
        assert_eq!(time.at(Ticks(1_260_000 + 40_960)), Ticks(1_159_500));
        assert!(!time.is_as_told() && !time.is_steady());
        assert!(time.report(&said(1_490_000, 1_292_000, 4096, 0), heard(START + 491_000)).is_some());
        assert!(time.is_as_told() && time.is_steady());
        // Down, up, and down before the board's next word: never more than the lowest.
        time.tell(2048, Ticks(1_500_000));
        assert!(time.report(&said(1_500_500, 1_302_500, 4000, 1), heard(1_500_600)).is_some());
        time.tell(3000, Ticks(1_501_000));
        assert!(time.report(&said(1_501_500, 1_303_400, 2900, 3), heard(1_501_600)).is_some());
        time.tell(41, Ticks(1_502_000));
        assert_eq!(time.at(Ticks(1_502_000)), Ticks(1_303_754));
        assert_eq!(time.at(Ticks(1_502_000 + 4096)), Ticks(1_303_795));
    }

    #[test]
    fn a_word_that_was_on_the_line_is_none_on_what_the_board_is_told_after_it() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1_000_000));
        time.tell(1024, Ticks(1_000_000));
        time.tell(RATE_ONE, Ticks(1_100_000));
        assert!(time.report(&said(1_000_500, 1_000_500, 4096, 0), heard(1_100_100)).is_some());
        assert!(!time.is_steady() && !time.is_as_told());
        assert_eq!(time.at(Ticks(1_000_500 + 4096)), Ticks(1_001_524));
        // Told the same again, it is the first time that counts.
        time.tell(RATE_ONE, Ticks(1_600_000));
        assert!(time.report(&said(1_599_000, 1_580_000, 4096, 0), heard(1_600_100)).is_some());
        assert!(time.is_steady() && time.is_as_told());
    }

    #[test]
    fn a_rest_that_is_taken_back_is_believed_until_the_board_says_more() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1_000_000));
        time.tell_rest(true, Ticks(1_010_000));
        time.tell_rest(false, Ticks(1_110_000));
        assert_eq!((time.at(Ticks(1_200_000)), time.is_steady()), (Ticks(1_010_000), false));
        assert_eq!(time.latest(Ticks(1_200_000)), Ticks(1_200_000));
        assert!(time.report(&said(1_300_000, 1_150_000, 2000, 3), heard(1_300_100)).is_some());
        assert_eq!(time.at(Ticks(1_300_000 + 4096)), Ticks(1_152_000));
    }

    #[test]
    fn the_latest_counts_from_what_the_board_said() {
        let mut time = MotionTime::default();
        time.trust(Ticks(1000));
        assert!(time.report(&said(5000, 5000, 2048, 0), heard(5100)).is_some());
        time.tell(RATE_ONE, Ticks(9000));
        assert_eq!((time.at(Ticks(9000)), time.latest(Ticks(9000))), (Ticks(7000), Ticks(9000)));
        time.tell(1024, Ticks(13_000));
        assert_eq!((time.at(Ticks(13_000)), time.latest(Ticks(13_000))), (Ticks(9000), Ticks(13_000)));
        time.tell_rest(true, Ticks(17_000));
        assert_eq!((time.at(Ticks(17_000)), time.latest(Ticks(17_000))), (Ticks(10_000), Ticks(17_000)));
        assert_eq!(time.hardware(Ticks(18_000), Ticks(17_000)), Ticks(18_000));
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
