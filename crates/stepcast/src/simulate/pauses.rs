//! The user's pauses of a simulated print: when they are asked for, and when the print is resumed.
//!
//! Knows no session. Ticks of the board's clock.

use units::{Hertz, Ticks};
use virtual_printer::UserPause;

/// See the module.
#[derive(Clone, Debug, Default)]
pub(super) struct Pauses {
    /// When they are asked for and how long they last; soonest last.
    coming: Vec<(Ticks, Ticks)>,
    /// How long the one lasts that has been asked for.
    asked: Option<Ticks>,
    resume_at: Option<Ticks>,
    /// When the one was asked for that has not come to rest.
    pub(super) since: Option<Ticks>,
    /// When the one was asked for that has not come.
    awaited: Option<Ticks>,
}

/// What the user wants now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    Pause,
    Resume,
}

impl Pauses {
    pub(super) fn new(pauses: &[UserPause], start: Ticks, clock: Hertz) -> Self {
        let span = |pause: &UserPause| (start + clock.ticks_in(pause.at), clock.ticks_in(pause.lasts));
        let mut coming: Vec<_> = pauses.iter().map(span).collect();
        coming.sort_by_key(|&(at, _)| core::cmp::Reverse(at));
        Self { coming, ..Self::default() }
    }

    /// What is due; once.
    pub(super) fn take(&mut self, now: Ticks) -> Option<Wanted> {
        if self.resume_at.take_if(|at| *at <= now).is_some() {
            return Some(Wanted::Resume);
        }
        let (_, lasts) = self.coming.pop_if(|(at, _)| *at <= now)?;
        (self.asked, self.since, self.awaited) = (Some(lasts), Some(now), Some(now));
        Some(Wanted::Pause)
    }

    /// There is nothing to be paused, or it is already.
    pub(super) const fn is_refused(&mut self) {
        (self.asked, self.since, self.awaited) = (None, None, None);
    }

    /// Whether one was accepted before `until` and never came.
    pub(super) fn is_forgotten(&self, until: Ticks) -> bool {
        self.awaited.is_some_and(|at| at < until)
    }

    /// The print is paused: it is resumed at once, unless it is the user's pause.
    pub(super) fn is_paused(&mut self, now: Ticks) {
        (self.since, self.awaited) = (None, None);
        self.resume_at = Some(now + self.asked.take().unwrap_or_default());
    }

    /// The host is gone, and with it the pause that it was in: who takes the print up says anew how it is.
    pub(super) const fn host_is_gone(&mut self) {
        (self.asked, self.resume_at, self.since, self.awaited) = (None, None, None, None);
    }

    /// When something is due next.
    pub(super) fn next(&self) -> Option<Ticks> {
        self.resume_at.into_iter().chain(self.coming.last().map(|(at, _)| *at)).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::Seconds;

    #[test]
    fn what_is_paused_is_resumed() {
        let pause = |at, lasts| UserPause { at: Seconds(at), lasts: Seconds(lasts) };
        let mut pauses = Pauses::new(&[pause(7.0, 2.0), pause(3.0, 4.0)], Ticks(100), Hertz(10));
        assert_eq!((pauses.next(), pauses.take(Ticks(129))), (Some(Ticks(130)), None));
        assert_eq!(pauses.take(Ticks(130)), Some(Wanted::Pause));
        pauses.is_paused(Ticks(135));
        assert_eq!((pauses.next(), pauses.take(Ticks(169))), (Some(Ticks(170)), None));
        assert_eq!(pauses.take(Ticks(175)), Some(Wanted::Resume));
        assert_eq!(pauses.take(Ticks(175)), Some(Wanted::Pause));
        assert_eq!((pauses.take(Ticks(175)), pauses.next()), (None, None));
        pauses.is_paused(Ticks(180));
        pauses.host_is_gone();
        assert_eq!((pauses.take(Ticks(999)), pauses.next()), (None, None));
        let mut forgotten = Pauses::new(&[pause(1.0, 2.0)], Ticks(100), Hertz(10));
        assert_eq!(forgotten.take(Ticks(110)), Some(Wanted::Pause));
        assert!(forgotten.is_forgotten(Ticks(111)) && !forgotten.is_forgotten(Ticks(110)));
        forgotten.is_refused();
        assert!(!forgotten.is_forgotten(Ticks(111)));
        // One in the file.
        pauses.is_paused(Ticks(200));
        assert_eq!(pauses.take(Ticks(200)), Some(Wanted::Resume));
        pauses.is_paused(Ticks(300));
        assert_eq!(pauses.take(Ticks(300)), Some(Wanted::Resume));
    }
}
