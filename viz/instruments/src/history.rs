//! What the heaters' sensors said, as far back as is kept. Readings come about once a second.

use std::collections::VecDeque;

use crate::thin::{Point, thinned};

/// Readings kept of each heater: two hours at one a second. Older ones go.
pub const READINGS_MAX: usize = 7200;
/// Readings further apart than this are not joined by a line: nobody was listening in between.
pub const GAP_S: f64 = 5.0;

/// A reading of a heater.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// When, in s on the clock of whoever reads.
    pub t_s: f64,
    /// What the sensor says, °C.
    pub measured_c: f64,
    /// What it should say, °C; 0 is off.
    pub target_c: f64,
}

/// One heater's readings, in the order of time.
#[derive(Clone, Debug)]
pub struct Heater {
    /// Its name, as people know it.
    pub label: String,
    readings: VecDeque<Reading>,
}

impl Heater {
    /// A heater that has not been read.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), readings: VecDeque::new() }
    }

    /// Takes a reading. One that is no number, or not later than the last, is left out.
    pub fn push(&mut self, reading: Reading) {
        let is_later = self.readings.back().is_none_or(|last| reading.t_s > last.t_s);
        if !(is_later
            && reading.t_s.is_finite()
            && reading.measured_c.is_finite()
            && reading.target_c.is_finite())
        {
            return;
        }
        if self.readings.len() == READINGS_MAX {
            self.readings.pop_front();
        }
        self.readings.push_back(reading);
    }

    /// When it was first and last read, as far as is kept; s.
    pub fn kept_s(&self) -> Option<(f64, f64)> {
        Some((self.readings.front()?.t_s, self.readings.back()?.t_s))
    }

    /// The reading nearest to a moment, unless that lies in a gap.
    pub fn at(&self, t_s: f64) -> Option<Reading> {
        let after = self.readings.partition_point(|reading| reading.t_s < t_s);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let distance = |reading: &Reading| (reading.t_s - t_s).abs();
        near.filter_map(|index| self.readings.get(index))
            .copied()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .filter(|reading| distance(reading) <= GAP_S)
    }

    /// The readings of a span of time and one to each side of it, so that lines reach the edge.
    fn around(&self, (start_s, end_s): (f64, f64)) -> impl Iterator<Item = &Reading> + Clone {
        let from = self.readings.partition_point(|reading| reading.t_s < start_s).saturating_sub(1);
        let to = self.readings.partition_point(|reading| reading.t_s <= end_s);
        self.readings.range(from..(to + 1).min(self.readings.len()).max(from))
    }

    /// The highest temperature, measured or wished for, in a span of time.
    pub fn peak_c(&self, span_s: (f64, f64)) -> Option<f64> {
        self.around(span_s).map(|reading| reading.measured_c.max(reading.target_c)).reduce(f64::max)
    }

    /// The measured temperature as lines, one for each stretch without a gap.
    pub fn measured(&self, span_s: (f64, f64), column_s: f64) -> Vec<Vec<Point>> {
        stretches(self.around(span_s))
            .into_iter()
            .map(|stretch| thinned(stretch.iter().map(|reading| [reading.t_s, reading.measured_c]), column_s))
            .collect()
    }

    /// The target as lines with corners; none while the heater is off.
    pub fn target(&self, span_s: (f64, f64)) -> Vec<Vec<Point>> {
        let mut lines = Vec::new();
        for stretch in stretches(self.around(span_s)) {
            let mut line: Vec<Point> = Vec::new();
            for reading in stretch {
                let level = line.last().map(|point| point[1]);
                if let Some(level) = level.filter(|&level| level != reading.target_c) {
                    extend_level(&mut line, [reading.t_s, level]);
                }
                if reading.target_c <= 0.0 {
                    lines.extend((!line.is_empty()).then(|| std::mem::take(&mut line)));
                    continue;
                }
                extend_level(&mut line, [reading.t_s, reading.target_c]);
            }
            lines.extend((!line.is_empty()).then_some(line));
        }
        lines
    }
}

/// Adds a point; where the last two are on the same level already, the last one moves.
fn extend_level(line: &mut Vec<Point>, point: Point) {
    if let [.., before, last] = line.as_mut_slice()
        && before[1] == point[1]
        && last[1] == point[1]
    {
        *last = point;
    } else {
        line.push(point);
    }
}

/// Readings without a gap between them.
fn stretches<'a>(readings: impl Iterator<Item = &'a Reading>) -> Vec<Vec<Reading>> {
    let mut all: Vec<Vec<Reading>> = Vec::new();
    for reading in readings {
        match all.last_mut() {
            Some(open) if open.last().is_some_and(|last| reading.t_s - last.t_s <= GAP_S) => {
                open.push(*reading);
            }
            _ => all.push(vec![*reading]),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(readings: impl IntoIterator<Item = (f64, f64, f64)>) -> Heater {
        let mut heater = Heater::new("Nozzle");
        for (t_s, measured_c, target_c) in readings {
            heater.push(Reading { t_s, measured_c, target_c });
        }
        heater
    }

    #[test]
    fn no_more_than_two_hours_are_kept() {
        let heater = read((0..10_000).map(|i| (f64::from(i), 20.0, 0.0)));
        assert_eq!(heater.kept_s(), Some((10_000.0 - READINGS_MAX as f64, 9999.0)));
    }

    #[test]
    fn what_is_no_reading_is_left_out() {
        let heater = read([(1.0, 20.0, 0.0), (1.0, 30.0, 0.0), (0.5, 30.0, 0.0), (2.0, f64::NAN, 0.0)]);
        assert_eq!(heater.kept_s(), Some((1.0, 1.0)));
        assert_eq!(heater.at(1.0).map(|reading| reading.measured_c), Some(20.0));
    }

    #[test]
    fn a_gap_breaks_the_line() {
        let heater = read([(0.0, 20.0, 0.0), (1.0, 21.0, 0.0), (60.0, 40.0, 0.0), (61.0, 41.0, 0.0)]);
        let lines = heater.measured((0.0, 100.0), 0.1);
        assert_eq!(lines, [vec![[0.0, 20.0], [1.0, 21.0]], vec![[60.0, 40.0], [61.0, 41.0]]]);
        assert_eq!(heater.at(30.0), None);
    }

    #[test]
    fn lines_reach_past_the_edges_of_the_window() {
        let heater = read((0..100).map(|i| (f64::from(i), f64::from(i), 0.0)));
        let lines = heater.measured((10.5, 12.5), 0.1);
        assert_eq!(lines, [vec![[10.0, 10.0], [11.0, 11.0], [12.0, 12.0], [13.0, 13.0]]]);
        assert_eq!(heater.peak_c((10.5, 12.5)), Some(13.0));
    }

    #[test]
    fn targets_have_corners_and_end_when_the_heater_is_off() {
        let heater = read([
            (0.0, 20.0, 0.0),
            (1.0, 20.0, 200.0),
            (2.0, 30.0, 200.0),
            (3.0, 40.0, 200.0),
            (4.0, 50.0, 210.0),
            (5.0, 60.0, 0.0),
            (6.0, 60.0, 50.0),
        ]);
        assert_eq!(
            heater.target((0.0, 10.0)),
            [vec![[1.0, 200.0], [4.0, 200.0], [4.0, 210.0], [5.0, 210.0]], vec![[6.0, 50.0]],]
        );
    }

    #[test]
    fn nothing_is_known_of_a_heater_that_was_never_read() {
        let heater = Heater::new("Bed");
        assert_eq!(heater.kept_s(), None);
        assert_eq!(heater.at(0.0), None);
        assert_eq!(heater.peak_c((0.0, 1.0)), None);
        assert!(heater.measured((0.0, 1.0), 0.1).is_empty());
        assert!(heater.target((0.0, 1.0)).is_empty());
    }
}
