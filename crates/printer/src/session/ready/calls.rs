//! How often the session is called. A host may be held up for any time: what it had planned before is then no longer what
//! its user expects.

use units::Seconds;

/// A pause between two calls that is worth telling.
const GAP_MIN: Seconds = Seconds(0.5);
/// A run that was planned before one so long does not begin after it unasked.
const GAP_BEGIN_MAX: Seconds = Seconds(1.0);
/// After one so long, what was not heard of meanwhile is not silence.
pub(super) const GAP_LONG: Seconds = Seconds(3.0);

/// When the session was last called, and the longest pause since then that it has noticed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Calls {
    last: Option<Seconds>,
    pub(super) gap: Option<Seconds>,
    /// The longest since the present run was planned.
    longest: Seconds,
}

impl Calls {
    /// Notes a call; the pause before it, where it was one.
    pub(super) fn note(&mut self, now: Seconds) -> Option<Seconds> {
        let gap = self.last.replace(now).map(|last| now - last).filter(|&gap| gap >= GAP_MIN);
        self.gap = gap.or(self.gap);
        self.longest = gap.map_or(self.longest, |gap| gap.max(self.longest));
        gap
    }

    /// A run of motion has been planned.
    pub(super) const fn run_planned(&mut self) {
        self.longest = Seconds::ZERO;
    }

    /// Whether there has been no long pause since then.
    pub(super) fn come_often(&self) -> bool {
        self.longest < GAP_BEGIN_MAX
    }
}
