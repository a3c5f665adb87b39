//! The board's two clocks at one moment.

use units::Ticks;

/// The board's clocks now, as far as they are known. On a board that cannot hold its motion they are the same, and a
/// clock alone says it all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// The hardware clock: outputs are set by it.
    pub hardware: Ticks,
    /// The motion clock: steps are made by it.
    pub motion: Ticks,
    /// Whether the motion clock runs on at the full rate; otherwise nothing can be said of when it gets anywhere.
    pub is_steady: bool,
}

impl From<Ticks> for Clocks {
    fn from(clock: Ticks) -> Self {
        Self { hardware: clock, motion: clock, is_steady: true }
    }
}

impl Clocks {
    /// How far ahead a motion clock is; nothing where that cannot be said.
    pub(crate) fn until_motion(&self, clock: Ticks) -> Option<Ticks> {
        self.is_steady.then(|| clock.saturating_sub(self.motion))
    }
}
