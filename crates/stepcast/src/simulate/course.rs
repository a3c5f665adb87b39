//! What a long print may not let grow: the program's memory, the motion that is queued, the error of the board's clock.
//! One entry for each hour of the board's time.
//!
//! Knows no session and no board: it is told. Memory is that of the whole program, simulated machine included.

use serde::Serialize;
use units::Seconds;

/// Entries are so far apart.
const INTERVAL: Seconds = Seconds(3600.0);
/// A print for a month has no more.
const ENTRIES_MAX: usize = 31 * 24;

/// An hour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Hour {
    /// The board's time at its end.
    pub(crate) until_h: f64,
    /// What the program keeps in memory then; `null` where the system does not say.
    pub(crate) memory_kib: Option<u64>,
    /// The journal's size then.
    pub(crate) journal_kib: u64,
    /// The least and the most that was queued in it; `null` where nothing moved.
    pub(crate) queued_min_s: Option<f64>,
    pub(crate) queued_max_s: Option<f64>,
    /// How far off the host's idea of the board's clock was at worst.
    pub(crate) clock_error_max_us: f64,
}

/// All hours so far.
#[derive(Debug, Default)]
pub(super) struct Course {
    hours: Vec<Hour>,
    current: Hour,
}

impl Course {
    /// So much motion is queued while there is more to come.
    pub(super) fn queued(&mut self, ahead: Seconds) {
        let Hour { queued_min_s: min, queued_max_s: max, .. } = &mut self.current;
        *min = Some(min.map_or(ahead.0, |min| min.min(ahead.0)));
        *max = Some(max.map_or(ahead.0, |max| max.max(ahead.0)));
    }

    /// The host is wrong by so much about the board's clock.
    pub(super) fn clock_error(&mut self, error: Seconds) {
        self.current.clock_error_max_us = self.current.clock_error_max_us.max(error.0.abs() * 1e6);
    }

    /// The board's time since power-up, and the journal's bytes.
    pub(super) fn pass(&mut self, time: Seconds, journal_bytes: usize) {
        let until = INTERVAL.0 * (self.hours.len() + 1) as f64;
        if time.0 >= until && self.hours.len() < ENTRIES_MAX {
            self.close(time, journal_bytes);
        }
    }

    /// The last hour is not whole.
    pub(super) fn finish(mut self, time: Seconds, journal_bytes: usize) -> Vec<Hour> {
        self.close(time, journal_bytes);
        self.hours
    }

    fn close(&mut self, time: Seconds, journal_bytes: usize) {
        let hour = std::mem::take(&mut self.current);
        self.hours.push(Hour {
            until_h: time.0 / 3600.0,
            memory_kib: memory_kib(),
            journal_kib: journal_bytes as u64 / 1024,
            ..hour
        });
    }
}

/// What Linux says that the program keeps in memory.
fn memory_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_hour_has_its_own_extremes() {
        let mut course = Course::default();
        course.pass(Seconds(3599.0), 5);
        course.queued(Seconds(3.0));
        course.queued(Seconds(2.0));
        course.clock_error(Seconds(-2e-6));
        course.pass(Seconds(3600.5), 2048);
        course.queued(Seconds(4.0));
        course.clock_error(Seconds(1e-6));
        let hours = course.finish(Seconds(5400.0), 4096);
        let of = |hour: &Hour| (hour.until_h, hour.queued_min_s, hour.queued_max_s, hour.clock_error_max_us);
        assert_eq!(hours.len(), 2);
        assert_eq!(of(&hours[0]), (3600.5 / 3600.0, Some(2.0), Some(3.0), 2.0));
        assert_eq!(of(&hours[1]), (1.5, Some(4.0), Some(4.0), 1.0));
        assert_eq!((hours[0].journal_kib, hours[1].journal_kib), (2, 4));
    }
}
