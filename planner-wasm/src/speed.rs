//! The toolhead's planned speed over time, for an instrument that shows it around now.
//!
//! Keeps the corners of the speed's curve on the board's clock: what was, and what has been planned. Knows no session.
//! Bounded: beyond [`CORNERS_MAX`] the oldest go. Times in seconds relative to now, speeds in mm/s.

use std::collections::VecDeque;

use printer::session::ScheduledMove;
use units::{Seconds, Ticks};

/// The most corners that are kept: 1 MiB. A minute's, for a path of 300 moves a second.
const CORNERS_MAX: usize = 65_536;
/// The most pairs of time and speed that are handed out at once.
pub const SPEED_PAIRS_MAX: usize = 4096;
/// The longest stretch that may be asked for, either way.
const STRETCH_MAX: Seconds = Seconds(600.0);
/// Of a stretch of time, the first and the last corner are kept, and the lowest and the highest.
const KEPT_OF_STRETCH: usize = 4;

/// A corner of the curve: its clock, and the speed there.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corner {
    at: Ticks,
    speed: f64,
}

/// The curve.
#[derive(Debug, Default)]
pub(crate) struct SpeedRecord {
    corners: VecDeque<Corner>,
}

impl SpeedRecord {
    /// A move has been planned, after those that were before.
    pub(crate) fn push(&mut self, mv: &ScheduledMove) {
        let speed = &mv.speed;
        self.corner(mv.start, speed.start.0);
        self.corner(speed.cruise_from, speed.cruise.0);
        self.corner(speed.cruise_until, speed.cruise.0);
        self.corner(mv.end, speed.end.0);
    }

    /// A corner, which is never before the last one; of several in one tick the last counts.
    fn corner(&mut self, at: Ticks, speed: f64) {
        let at = self.corners.back().map_or(at, |last| at.max(last.at));
        self.corners.pop_back_if(|last| last.at == at);
        if self.corners.len() >= CORNERS_MAX {
            self.corners.pop_front();
        }
        self.corners.push_back(Corner { at, speed });
    }

    /// The machine stands still at this clock, whatever was planned after it.
    pub(crate) fn stop(&mut self, at: Ticks) {
        let Some(speed) = self.speed_at(at) else { return };
        while self.corners.pop_back_if(|corner| corner.at >= at).is_some() {}
        self.corner(at, speed);
        self.corner(at + Ticks(1), 0.0);
    }

    /// Forgets everything: the board's clock is not known any more.
    pub(crate) fn clear(&mut self) {
        self.corners.clear();
    }

    /// The speed at a clock between the first corner and the last.
    fn speed_at(&self, at: Ticks) -> Option<f64> {
        let next = self.corners.partition_point(|corner| corner.at < at);
        let after = self.corners.get(next)?;
        if after.at == at {
            return Some(after.speed);
        }
        let before = self.corners.get(next.checked_sub(1)?)?;
        let share = (at - before.at).0 as f64 / (after.at - before.at).0 as f64;
        Some(before.speed + share * (after.speed - before.speed))
    }

    /// The curve around now: pairs of time and speed, ascending in time, at most [`SPEED_PAIRS_MAX`]. Outside of all
    /// motion it is zero; where it goes on and is not known (not planned yet, or forgotten) it ends.
    pub(crate) fn around(&self, now: Ticks, freq: f64, behind: Seconds, ahead: Seconds) -> Vec<f64> {
        // Written so that what is not a number is nothing.
        let stretch = |time: Seconds| if time.0 > 0.0 { time.min(STRETCH_MAX).0 } else { 0.0 };
        let (behind, ahead) = (stretch(behind), stretch(ahead));
        let from = Ticks(now.0.saturating_sub((behind * freq) as u64));
        let until = now + Ticks((ahead * freq) as u64);
        let first = self.corners.partition_point(|corner| corner.at <= from);
        let end = self.corners.partition_point(|corner| corner.at < until).max(first);
        let is_at_rest = |corner: Option<&Corner>| corner.is_none_or(|corner| corner.speed == 0.0);
        let at_rest = |at: Ticks| {
            let outside = match (self.corners.front(), self.corners.back()) {
                (Some(front), _) if at < front.at => Some(front),
                (_, Some(back)) if at > back.at => Some(back),
                _ => None,
            };
            is_at_rest(outside).then_some(0.0)
        };
        let edge =
            |at: Ticks, time: f64| self.speed_at(at).or_else(|| at_rest(at)).map(|speed| (time, speed));
        let time = |at: Ticks| (at.0 as f64 - now.0 as f64) / freq;
        let inner = self.corners.range(first..end).map(|corner| (time(corner.at), corner.speed));
        let pairs = edge(from, -behind).into_iter().chain(inner);
        let last = if until > from { edge(until, ahead) } else { None };
        thinned(pairs.chain(last).collect()).into_iter().flat_map(|(time, speed)| [time, speed]).collect()
    }
}

/// The curve with fewer pairs: lowest and highest stay, and so do the ends.
fn thinned(pairs: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let (Some(&(first, _)), Some(&(last, _))) = (pairs.first(), pairs.last()) else { return pairs };
    if pairs.len() <= SPEED_PAIRS_MAX {
        return pairs;
    }
    let stretches = SPEED_PAIRS_MAX / KEPT_OF_STRETCH;
    let stretch_of = |time: f64| {
        let stretch = (time - first) / (last - first) * stretches as f64;
        (stretch as usize).min(stretches - 1)
    };
    let mut kept = Vec::with_capacity(SPEED_PAIRS_MAX);
    for stretch in pairs.chunk_by(|a, b| stretch_of(a.0) == stretch_of(b.0)) {
        let (mut low, mut high) = (0, 0);
        for (index, pair) in stretch.iter().enumerate() {
            low = if pair.1 < stretch[low].1 { index } else { low };
            high = if pair.1 > stretch[high].1 { index } else { high };
        }
        let mut indices = [0, low.min(high), low.max(high), stretch.len() - 1].to_vec();
        indices.dedup();
        kept.extend(indices.into_iter().map(|index| stretch[index]));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use printer::session::SpeedProfile;
    use units::MmPerS;

    const FREQ: f64 = 1000.0;

    /// A move whose clock counts milliseconds.
    fn mv(start: u64, ramps: [u64; 2], end: u64, speeds: [f64; 3]) -> ScheduledMove {
        let [start_speed, cruise, end_speed] = speeds.map(MmPerS);
        let [cruise_from, cruise_until] = ramps.map(Ticks);
        let speed = SpeedProfile { start: start_speed, cruise, end: end_speed, cruise_from, cruise_until };
        let (start, end, place) = (Ticks(start), Ticks(end), [0.0; 4]);
        ScheduledMove { line: 1, start, end, from: place, to: place, speed, homing: false }
    }

    fn pairs(record: &SpeedRecord, now: u64, behind: f64, ahead: f64) -> Vec<(f64, f64)> {
        let flat = record.around(Ticks(now), FREQ, Seconds(behind), Seconds(ahead));
        flat.chunks(2).map(|pair| (pair[0], pair[1])).collect()
    }

    fn two_moves() -> SpeedRecord {
        let mut record = SpeedRecord::default();
        record.push(&mv(10_000, [11_000, 12_000], 12_500, [0.0, 20.0, 10.0]));
        record.push(&mv(12_500, [12_500, 13_000], 14_000, [10.0, 10.0, 0.0]));
        record
    }

    #[test]
    fn the_curve_is_that_of_the_moves_with_zeros_around_it() {
        let record = two_moves();
        let expected = [
            (-3.0, 0.0),
            (-2.0, 0.0),
            (-1.0, 20.0),
            (0.0, 20.0),
            (0.5, 10.0),
            (1.0, 10.0),
            (2.0, 0.0),
            (5.0, 0.0),
        ];
        assert_eq!(pairs(&record, 12_000, 3.0, 5.0), expected);
        // The edges lie on the curve.
        assert_eq!(
            pairs(&record, 12_000, 1.5, 0.25),
            [(-1.5, 10.0), (-1.0, 20.0), (0.0, 20.0), (0.25, 15.0)]
        );
        assert_eq!(pairs(&record, 90_000, 2.0, 2.0), [(-2.0, 0.0), (2.0, 0.0)]);
        assert_eq!(pairs(&SpeedRecord::default(), 90_000, 2.0, 2.0), [(-2.0, 0.0), (2.0, 0.0)]);
        assert_eq!(pairs(&record, 12_250, f64::NAN, -1.0), [(0.0, 15.0)]);
    }

    #[test]
    fn what_is_not_known_is_not_shown_as_rest() {
        let mut record = SpeedRecord::default();
        record.push(&mv(1000, [2000, 3000], 3000, [0.0, 20.0, 20.0]));
        assert_eq!(pairs(&record, 2500, 0.0, 5.0), [(0.0, 20.0), (0.5, 20.0)]);
        assert_eq!(pairs(&record, 9000, 1.0, 5.0), []);
    }

    #[test]
    fn a_pause_between_two_runs_is_zero_and_a_trigger_ends_the_curve() {
        let mut record = two_moves();
        record.push(&mv(20_000, [21_000, 29_000], 30_000, [0.0, 5.0, 0.0]));
        assert!(pairs(&record, 15_000, 2.0, 8.0).starts_with(&[(-2.0, 10.0), (-1.0, 0.0), (5.0, 0.0)]));
        record.stop(Ticks(25_000));
        assert_eq!(pairs(&record, 24_000, 0.0, 4.0), [(0.0, 5.0), (1.0, 5.0), (1.001, 0.0), (4.0, 0.0)]);
        // What stands still is not stopped again.
        record.stop(Ticks(28_000));
        assert_eq!(pairs(&record, 24_000, 0.0, 4.0).len(), 4);
    }

    #[test]
    fn many_moves_stay_bounded_and_keep_their_peaks() {
        let mut record = SpeedRecord::default();
        for n in 0..100_000_u64 {
            let peak = if n == 95_000 { 300.0 } else { 50.0 + (n % 7) as f64 };
            record.push(&mv(n * 10, [n * 10 + 3, n * 10 + 6], n * 10 + 10, [0.0, peak, 0.0]));
        }
        assert_eq!(record.corners.len(), CORNERS_MAX);
        let pairs = pairs(&record, 950_000, 100.0, 100.0);
        assert!(pairs.len() <= SPEED_PAIRS_MAX && pairs.len() > SPEED_PAIRS_MAX / 2, "{}", pairs.len());
        assert!(pairs.is_sorted_by(|a, b| a.0 < b.0));
        assert!(pairs.iter().any(|pair| pair.1 == 300.0 && pair.0 > 0.0 && pair.0 < 0.01));
        assert_eq!((pairs[0], pairs[pairs.len() - 1]), ((-100.0, 0.0), (100.0, 0.0)));
        assert!(pairs.iter().filter(|pair| pair.1 == 0.0).count() > 500);
    }
}
