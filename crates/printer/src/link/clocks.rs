//! The board's two clocks at one moment.

use core::num::NonZeroU16;

use units::Ticks;

use crate::pace::RATE_ONE;

/// The board's clocks now, as far as they are known. On a board that cannot hold its motion they are the same, and a
/// clock alone says it all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// The hardware clock: outputs are set by it.
    pub hardware: Ticks,
    /// The motion clock: steps are made by it.
    pub motion: Ticks,
    /// The rate at which the motion clock runs on, in 1/[`RATE_ONE`]; otherwise nothing can be said of when it gets anywhere.
    pub rate: Option<NonZeroU16>,
}

impl From<Ticks> for Clocks {
    fn from(clock: Ticks) -> Self {
        Self { hardware: clock, motion: clock, rate: NonZeroU16::new(RATE_ONE) }
    }
}

impl Clocks {
    /// How long the hardware clock takes until the motion clock gets to `clock`; nothing where that cannot be said.
    pub(crate) fn until_motion(&self, clock: Ticks) -> Option<Ticks> {
        let ahead = u128::from(clock.saturating_sub(self.motion).0) * u128::from(RATE_ONE);
        let ticks = ahead / u128::from(self.rate?.get());
        Some(Ticks(u64::try_from(ticks).unwrap_or(u64::MAX)))
    }
}
