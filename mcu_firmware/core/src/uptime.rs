//! The upper half of the clock, and how busy the firmware is.

use units::{Clock32, Hertz};
use wire::Response;

/// How often the statistics are reported.
const STATS_SECONDS: u32 = 5;
/// The clock has to be looked at more than once each time that it wraps.
const LOOK_TICKS_MAX: u32 = 1 << 30;
/// The unit of the squares (`STATS_SUMSQ_BASE` in the dictionary), which keeps them inside 32 bits.
pub const STATS_SUMSQ_BASE: u32 = 256;

/// Counts the wraps of the 32-bit clock. Has to be shown the clock at least once in every 2³² ticks.
pub(crate) struct Uptime {
    high: u32,
    low: u32,
}

impl Uptime {
    pub(crate) const fn new() -> Self {
        Self { high: 0, low: 0 }
    }

    pub(crate) const fn look(&mut self, now: Clock32) {
        if now.0 < self.low {
            self.high = self.high.wrapping_add(1);
        }
        self.low = now.0;
    }

    pub(crate) const fn response(&self) -> Response<'static> {
        Response::Uptime { high: self.high, clock: self.low }
    }
}

/// How long the main loop's rounds took since the last report.
pub(crate) struct Stats {
    period: u32,
    due_at: Option<Clock32>,
    pub(crate) pending: bool,
    count: u32,
    sum: u32,
    sumsq: u32,
}

impl Stats {
    pub(crate) const fn new(clock: Hertz) -> Self {
        let period = clock.0.saturating_mul(STATS_SECONDS);
        let period = if period > LOOK_TICKS_MAX { LOOK_TICKS_MAX } else { period };
        Self { period, due_at: None, pending: false, count: 0, sum: 0, sumsq: 0 }
    }

    /// Whether it was never shown the clock.
    pub(crate) const fn is_new(&self) -> bool {
        self.due_at.is_none()
    }

    /// Sees whether a report is due; the clock of the next one.
    pub(crate) fn look(&mut self, now: Clock32) -> Clock32 {
        let due_at = self.due_at.unwrap_or_else(|| now.wrapping_add(self.period));
        if now.is_before(due_at) {
            self.due_at = Some(due_at);
            return due_at;
        }
        self.pending = true;
        let next = now.wrapping_add(self.period);
        self.due_at = Some(next);
        next
    }

    /// Counts one round of the main loop.
    pub(crate) fn add(&mut self, ticks: u32) {
        self.count = self.count.saturating_add(1);
        self.sum = self.sum.saturating_add(ticks);
        let square = (u64::from(ticks) * u64::from(ticks)).div_ceil(u64::from(STATS_SUMSQ_BASE));
        self.sumsq = self.sumsq.saturating_add(u32::try_from(square).unwrap_or(u32::MAX));
    }

    /// The report, after which counting starts anew.
    pub(crate) fn take(&mut self) -> Response<'static> {
        let report = Response::Stats { count: self.count, sum: self.sum, sumsq: self.sumsq };
        self.pending = false;
        self.count = 0;
        self.sum = 0;
        self.sumsq = 0;
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_are_counted() {
        let mut uptime = Uptime::new();
        for low in [10, u32::MAX, 3, 2_000_000_000, 1] {
            uptime.look(Clock32(low));
        }
        assert_eq!(uptime.response(), Response::Uptime { high: 2, clock: 1 });
    }

    #[test]
    fn a_long_round_saturates_the_squares() {
        let mut stats = Stats::new(Hertz(12_000_000));
        stats.add(16);
        assert_eq!((stats.count, stats.sum, stats.sumsq), (1, 16, 1));
        stats.add(u32::MAX);
        assert_eq!(stats.take(), Response::Stats { count: 2, sum: u32::MAX, sumsq: u32::MAX });
        assert_eq!(stats.count, 0);
    }
}
