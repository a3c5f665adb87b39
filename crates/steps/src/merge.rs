//! The paths of several axes over common stretches of time, for a motor that follows more than one.

use crate::Segment;
use crate::kinematics::AXES;
use std::collections::VecDeque;

/// Segments of each axis that wait for those of the others. Where an axis has none, it stands still.
#[derive(Clone, Debug)]
pub(crate) struct Merge {
    axes: [bool; AXES],
    queues: [VecDeque<Segment>; AXES],
    positions: [f64; AXES],
    time: f64,
}

impl Merge {
    pub(crate) fn new(axes: [bool; AXES]) -> Self {
        Self { axes, queues: Default::default(), positions: [0.0; AXES], time: 0.0 }
    }

    pub(crate) fn begin(&mut self, positions: [f64; AXES]) {
        self.queues.iter_mut().for_each(VecDeque::clear);
        self.positions = positions;
        self.time = 0.0;
    }

    /// Everything before this print time (s) has been merged.
    pub(crate) const fn time(&self) -> f64 {
        self.time
    }

    /// Takes what has become known of the axes, each up to its print time in `known`, and gives out what all of them are
    /// known for.
    pub(crate) fn take(
        &mut self,
        paths: &[Vec<Segment>; AXES],
        known: &[f64; AXES],
        mut out: impl FnMut(&[Segment; AXES]),
    ) {
        for axis in (0..AXES).filter(|&axis| self.axes[axis]) {
            self.queues[axis].extend(&paths[axis]);
        }
        loop {
            // Also what is so short that the clock does not tell its end from its start.
            self.pop_done();
            let seams = (0..AXES).filter(|&axis| self.axes[axis]).map(|axis| self.seam(axis, known[axis]));
            let end = seams.fold(f64::INFINITY, f64::min);
            if !(end > self.time && end < f64::INFINITY) {
                return;
            }
            let stretch: [Segment; AXES] = core::array::from_fn(|axis| self.part(axis, end));
            if stretch.iter().any(|segment| !segment.is_rest()) {
                out(&stretch);
            }
            self.time = end;
        }
    }

    /// Forgets what has come to its end.
    fn pop_done(&mut self) {
        for (queue, position) in self.queues.iter_mut().zip(&mut self.positions) {
            while let Some(done) = queue.pop_front_if(|front| front.end_time() <= self.time) {
                *position = done.end;
            }
        }
    }

    /// Where the axis' next seam is, or what is known of it ends.
    fn seam(&self, axis: usize, known: f64) -> f64 {
        match self.queues[axis].front() {
            Some(front) if front.start_time > self.time => front.start_time,
            Some(front) => front.end_time(),
            None => known,
        }
    }

    /// An axis from now to `end`.
    fn part(&self, axis: usize, end: f64) -> Segment {
        let front = self.queues[axis].front().filter(|front| front.start_time <= self.time);
        let Some(front) = front else {
            return Segment::rest(self.time, end - self.time, self.positions[axis]);
        };
        let to = if end >= front.end_time() { front.duration } else { end - front.start_time };
        let mut part = front.part(self.time - front.start_time, to);
        part.start_time = self.time;
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_no_time_holds_nothing_up() {
        let mut merge = Merge::new([true, true, false, false]);
        merge.begin([0.0; AXES]);
        // So short that adding it to its start changes nothing.
        let dust = |start_time: f64, start: f64| Segment {
            start_time,
            duration: 1e-18,
            start,
            end: start + 1e-15,
            powers: [1e3, 0.0, 0.0, 0.0, 0.0],
        };
        let way = |start_time: f64, start: f64| Segment {
            start_time,
            duration: 1.0,
            start,
            end: start + 1.0,
            powers: [1.0, 0.0, 0.0, 0.0, 0.0],
        };
        let mut stretches = 0;
        for second in 0..10 {
            let at = 30.0 + f64::from(second);
            let paths = [vec![dust(at, at), way(at, at)], vec![], vec![], vec![]];
            merge.take(&paths, &[at + 1.0; AXES], |_| stretches += 1);
            assert_eq!(merge.time(), at + 1.0);
        }
        assert_eq!(stretches, 10);
    }
}
