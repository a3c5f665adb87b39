//! The planned speed of the toolhead around now: what it did a moment ago, and what the board has in its queue.

use crate::axis;
use crate::thin::{Point, thinned};

/// How far back is shown, s.
pub const BEHIND_S: f64 = 3.0;
/// How far ahead is shown, s.
pub const AHEAD_S: f64 = 6.0;
/// More pairs than this are not taken.
pub const PAIRS_MAX: usize = 4096;
/// The least that the scale reaches to, mm/s.
const SCALE_MIN_MM_S: f64 = 20.0;
/// The scale shrinks when so many plans in a row had no use for it: ten seconds of them.
const SHRINK_AFTER: u32 = 100;
/// Marks of the scale.
const SCALE_STEPS: f64 = 4.0;

/// Speed over time, by corners: s from now, mm/s.
#[derive(Clone, Debug, Default)]
pub struct PlannedSpeed {
    corners: Vec<Point>,
    scale_mm_s: f64,
    /// Plans in a row for which a smaller scale would do, and the largest that one of them needed.
    too_big: u32,
    needed_since_mm_s: f64,
}

impl PlannedSpeed {
    /// Takes the plan as it is now: pairs of time and speed, in the order of time. Pairs that are no numbers or go
    /// back in time are left out, as is what comes after [`PAIRS_MAX`].
    pub fn set(&mut self, pairs: &[f64]) {
        self.corners.clear();
        for pair in pairs.chunks_exact(2).take(PAIRS_MAX) {
            let (t_s, speed_mm_s) = (pair[0], pair[1]);
            let is_next = self.corners.last().is_none_or(|last| t_s >= last[0]);
            if t_s.is_finite() && speed_mm_s.is_finite() && is_next {
                self.corners.push([t_s, speed_mm_s.max(0.0)]);
            }
        }
        let (_, needed_mm_s) = axis::scale(self.peak_mm_s().max(SCALE_MIN_MM_S), SCALE_STEPS);
        // It grows at once and shrinks late: a scale that jumps is hard to read.
        if needed_mm_s >= self.scale_mm_s {
            (self.scale_mm_s, self.too_big, self.needed_since_mm_s) = (needed_mm_s, 0, 0.0);
            return;
        }
        self.too_big += 1;
        self.needed_since_mm_s = self.needed_since_mm_s.max(needed_mm_s);
        if self.too_big >= SHRINK_AFTER {
            (self.scale_mm_s, self.too_big, self.needed_since_mm_s) = (self.needed_since_mm_s, 0, 0.0);
        }
    }

    fn peak_mm_s(&self) -> f64 {
        self.corners.iter().map(|corner| corner[1]).fold(0.0, f64::max)
    }

    /// Whether there is anything to draw.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The end of the scale, mm/s.
    pub fn scale_mm_s(&self) -> f64 {
        self.scale_mm_s.max(SCALE_MIN_MM_S)
    }

    /// The speed at a moment, mm/s; none beyond the plan's ends.
    pub fn at(&self, t_s: f64) -> Option<f64> {
        let after = self.corners.partition_point(|corner| corner[0] < t_s);
        let end = self.corners.get(after)?;
        let Some(start) = after.checked_sub(1).map(|before| self.corners[before]) else {
            return (end[0] == t_s).then_some(end[1]);
        };
        let share = (t_s - start[0]) / (end[0] - start[0]);
        Some(start[1] + share * (end[1] - start[1]))
    }

    /// The plan before and after now as two lines that meet at now.
    pub fn lines(&self, column_s: f64) -> (Vec<Point>, Vec<Point>) {
        let now = self.at(0.0).map(|speed_mm_s| [0.0, speed_mm_s]);
        let made = self.corners.iter().copied().filter(|corner| corner[0] < 0.0).chain(now);
        let ahead = now.into_iter().chain(self.corners.iter().copied().filter(|corner| corner[0] > 0.0));
        (thinned(made, column_s), thinned(ahead, column_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planned(pairs: &[f64]) -> PlannedSpeed {
        let mut speed = PlannedSpeed::default();
        speed.set(pairs);
        speed
    }

    #[test]
    fn speed_is_linear_between_the_corners() {
        let speed = planned(&[-1.0, 0.0, 1.0, 100.0, 2.0, 100.0]);
        assert_eq!(speed.at(0.0), Some(50.0));
        assert_eq!(speed.at(1.5), Some(100.0));
        assert_eq!(speed.at(-1.0), Some(0.0));
        assert_eq!(speed.at(2.1), None);
        assert_eq!(speed.at(-1.1), None);
        assert_eq!(planned(&[]).at(0.0), None);
    }

    #[test]
    fn a_jump_in_speed_is_no_division_by_zero() {
        let speed = planned(&[0.0, 10.0, 1.0, 10.0, 1.0, 50.0, 2.0, 50.0]);
        assert_eq!(speed.at(1.0), Some(10.0));
        assert_eq!(speed.at(1.5), Some(50.0));
    }

    #[test]
    fn nonsense_is_left_out_and_the_number_is_bounded() {
        let speed = planned(&[0.0, 10.0, f64::NAN, 5.0, -1.0, 5.0, 1.0, f64::INFINITY, 2.0, -3.0, 7.0]);
        assert_eq!(speed.lines(0.1).1, [[0.0, 10.0], [2.0, 0.0]]);
        let many: Vec<f64> = (0..20_000).flat_map(|i| [f64::from(i), 1.0]).collect();
        assert_eq!(planned(&many).corners.len(), PAIRS_MAX);
    }

    #[test]
    fn the_lines_meet_at_now() {
        let (made, ahead) = planned(&[-1.0, 0.0, 1.0, 100.0]).lines(0.01);
        assert_eq!(made, [[-1.0, 0.0], [0.0, 50.0]]);
        assert_eq!(ahead, [[0.0, 50.0], [1.0, 100.0]]);
    }

    #[test]
    fn the_scale_grows_at_once_and_shrinks_late() {
        let mut speed = planned(&[0.0, 180.0]);
        assert_eq!(speed.scale_mm_s(), 200.0);
        for _ in 1..SHRINK_AFTER {
            speed.set(&[0.0, 30.0]);
            assert_eq!(speed.scale_mm_s(), 200.0);
        }
        speed.set(&[0.0, 60.0]);
        assert_eq!(speed.scale_mm_s(), 60.0, "what the largest of them needed");
        speed.set(&[0.0, 210.0]);
        assert_eq!(speed.scale_mm_s(), 300.0);
        assert_eq!(PlannedSpeed::default().scale_mm_s(), SCALE_MIN_MM_S);
    }
}
