//! The host's clock in a simulation. It is not the board's: it starts anywhere, and the board's crystal is a little off, so
//! that the session has to find out both.

use units::{Hertz, Seconds, Ticks};

/// The host's clock when the board's starts.
const HOST_START: Seconds = Seconds(4321.0);
/// How much faster than it says the board's clock runs, as crystals do.
const CRYSTAL_ERROR: f64 = 30e-6;

/// The host's clock, as the board's tells it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HostClock {
    start: Ticks,
    ticks_per_s: f64,
}

impl HostClock {
    pub(crate) fn new(start: Ticks, clock: Hertz) -> Self {
        Self { start, ticks_per_s: f64::from(clock.0) * (1.0 + CRYSTAL_ERROR) }
    }

    pub(crate) fn at(self, now: Ticks) -> Seconds {
        Seconds(HOST_START.0 + now.saturating_sub(self.start).0 as f64 / self.ticks_per_s)
    }

    /// The first tick at or after a time.
    pub(crate) fn ticks_at(self, time: Seconds) -> Ticks {
        Ticks(self.start.0 + ((time - HOST_START).0 * self.ticks_per_s).ceil().max(0.0) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_time_and_ticks_agree() {
        let clock = HostClock::new(Ticks(1 << 32), Hertz(12_000_000));
        assert_eq!(clock.at(Ticks(1 << 32)), HOST_START);
        for ticks in [1u64, 17, 12_000_000, 75_000_000_000] {
            let at = Ticks((1 << 32) + ticks);
            let back = clock.ticks_at(clock.at(at));
            assert!(back.0.abs_diff(at.0) <= 1, "{ticks}");
        }
        assert_eq!(clock.ticks_at(Seconds(0.0)), Ticks(1 << 32));
    }
}
