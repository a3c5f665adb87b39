//! What has been given to the board of the present run and may not have been made yet: kept here, so that it can be given
//! again after the board has dropped it.
//!
//! Rows are known by their place among those that the board counts. Knows no board; rows in ticks from the run's start,
//! the fan's changes on the motion clock.

use std::collections::VecDeque;

use units::{Seconds, Ticks};

use crate::{
    error::{ErrorCode, PrinterError},
    journal::{MotorQueue, Row, RowPlace},
    machine::MOTORS,
};

/// Rows are kept for so long after they should have been made: the board's clock is an estimate.
pub(super) const KEPT_AFTER: Seconds = Seconds(1.0);
/// The most changes of the fan that wait for their clock.
pub(super) const FANS_MAX: usize = 4096;

/// One motor's rows.
#[derive(Clone, Debug, Default)]
struct Lane {
    /// The place of the first among those that the board counts.
    first: u32,
    rows: VecDeque<Row>,
}

/// See the module.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept {
    lanes: [Lane; MOTORS],
    /// Where the board's count begins.
    from: [RowPlace; MOTORS],
    /// The part fan's speed now, and what is to come of it.
    fan: f64,
    fans: VecDeque<(Ticks, f64)>,
    /// Of these, so many have been given to the board.
    fans_given: usize,
}

/// What was kept, from where the board has dropped it.
#[derive(Clone, Debug)]
pub(super) struct Left {
    pub(super) rows: [VecDeque<Row>; MOTORS],
    pub(super) from: [RowPlace; MOTORS],
    pub(super) fan: f64,
    pub(super) fans: VecDeque<(Ticks, f64)>,
}

impl Kept {
    /// The board counts anew, from here. The fan goes on.
    pub(super) fn begin(&mut self, from: [RowPlace; MOTORS]) {
        self.lanes = Default::default();
        self.from = from;
    }

    /// A motor's next row goes to the board.
    pub(super) fn push(&mut self, motor: usize, row: Row) {
        self.lanes[motor].rows.push_back(row);
    }

    /// The fan changes at a motion clock …
    pub(super) fn push_fan(&mut self, at: Ticks, speed: f64) {
        self.fans.push_back((at, speed));
    }

    /// … or now.
    pub(super) const fn set_fan(&mut self, speed: f64) {
        self.fan = speed;
    }

    /// What was to come of the fan does not.
    pub(super) fn forget_fans(&mut self) {
        self.fans.clear();
        self.fans_given = 0;
    }

    /// The next change of the fan until a motion clock that has not been given to the board: now it is.
    pub(super) fn next_fan(&mut self, until: Ticks) -> Option<(Ticks, f64)> {
        let next = self.fans.get(self.fans_given).copied().filter(|(at, _)| *at <= until)?;
        self.fans_given += 1;
        Some(next)
    }

    /// Whether no more changes of the fan are taken.
    pub(super) fn is_full(&self) -> bool {
        self.fans.len() >= FANS_MAX
    }

    /// Forgets rows that were made before this time of the run, and changes of the fan before that motion clock.
    pub(super) fn forget(&mut self, made_until: Ticks, motion_now: Ticks) {
        for lane in &mut self.lanes {
            while lane.rows.pop_front_if(|row| row.end < made_until).is_some() {
                lane.first = lane.first.wrapping_add(1);
            }
        }
        while let Some((_, speed)) = self.fans.pop_front_if(|(at, _)| *at <= motion_now) {
            self.fan = speed;
            self.fans_given = self.fans_given.saturating_sub(1);
        }
    }

    /// What the board has not made, by what it says of its motors.
    pub(super) fn cut(&mut self, queues: &[MotorQueue; MOTORS]) -> Result<Left, PrinterError> {
        let mut from = self.from;
        for (motor, queue) in queues.iter().enumerate() {
            let lane = &mut self.lanes[motor];
            let made = queue.done.wrapping_sub(lane.first) as usize;
            if made > lane.rows.len() {
                return Err(other_steps());
            }
            lane.rows.drain(..made);
            if queue.left > 0 {
                let row = lane.rows.front_mut().filter(|row| queue.left <= row.count);
                let row = row.ok_or_else(other_steps)?;
                *row = row.tail(queue.left);
            }
            from[motor] = self.from[motor].after(queue);
        }
        self.fans_given = 0;
        let rows = core::mem::take(&mut self.lanes).map(|lane| lane.rows);
        Ok(Left { rows, from, fan: self.fan, fans: core::mem::take(&mut self.fans) })
    }
}

fn other_steps() -> PrinterError {
    PrinterError::new(ErrorCode::Internal, "the board counts other steps than it was given")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(start: u64, count: u16) -> Row {
        let end = Ticks(start + 100 * u64::from(count));
        Row { interval: 100, count, add: 0, forward: true, start: Ticks(start), end }
    }

    fn queue(done: u32, left: u16) -> MotorQueue {
        MotorQueue { received: 3, done, left, ..MotorQueue::default() }
    }

    fn kept() -> Kept {
        let mut kept = Kept::default();
        let from = RowPlace { done: 10, left: 4 };
        kept.begin([from; MOTORS]);
        for motor in 0..MOTORS {
            for row in [row(0, 4), row(400, 5), row(900, 6)] {
                kept.push(motor, row);
            }
        }
        kept
    }

    #[test]
    fn what_is_left_begins_with_the_next_step() {
        let mut kept = kept();
        kept.forget(Ticks(401), Ticks(0));
        let left = kept.cut(&[queue(1, 0), queue(1, 5), queue(1, 2), queue(3, 0)]).unwrap();
        assert_eq!(left.rows[0], [row(400, 5), row(900, 6)]);
        assert_eq!(left.rows[1], [row(400, 5), row(900, 6)]);
        assert_eq!(left.rows[2], [row(700, 2), row(900, 6)]);
        assert!(left.rows[3].is_empty());
        let places = [(11, 0), (11, 5), (11, 2), (13, 0)];
        assert_eq!(left.from, places.map(|(done, left)| RowPlace { done, left }));
    }

    #[test]
    fn the_rest_of_a_row_that_was_given_again_is_none_of_its_own() {
        let left = kept().cut(&[queue(0, 0), queue(0, 4), queue(0, 1), queue(0, 0)]).unwrap();
        assert_eq!(left.from.map(|place| (place.done, place.left)), [(10, 4), (10, 4), (10, 1), (10, 4)]);
        assert_eq!(left.rows[2][0], row(300, 1));
    }

    #[test]
    fn a_board_that_counts_otherwise_is_not_believed() {
        let [same, more] = [queue(0, 0), queue(4, 0)];
        assert!(kept().cut(&[same, same, more, same]).is_err());
        assert!(kept().cut(&[same, same, queue(0, 5), same]).is_err());
        let mut forgotten = kept();
        forgotten.forget(Ticks(401), Ticks(0));
        assert!(forgotten.cut(&[same; MOTORS]).is_err());
    }

    #[test]
    fn the_fan_is_what_it_was_last() {
        let mut kept = kept();
        for (at, speed) in [(10, 0.1), (20, 0.2), (30, 0.3)] {
            kept.push_fan(Ticks(at), speed);
        }
        assert_eq!(kept.next_fan(Ticks(9)), None);
        assert_eq!(kept.next_fan(Ticks(25)), Some((Ticks(10), 0.1)));
        assert_eq!(kept.next_fan(Ticks(25)), Some((Ticks(20), 0.2)));
        assert_eq!(kept.next_fan(Ticks(25)), None);
        kept.forget(Ticks(0), Ticks(20));
        assert_eq!(kept.clone().next_fan(Ticks(30)), Some((Ticks(30), 0.3)));
        let left = kept.cut(&[queue(0, 0); MOTORS]).unwrap();
        assert_eq!((left.fan, left.fans), (0.2, VecDeque::from([(Ticks(30), 0.3)])));
    }
}
