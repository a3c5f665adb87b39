//! How many entries of the board's move queue are taken, reckoned from what was sent to it.
//!
//! Every `queue_step` (and every queued output event) holds one entry of a pool that all objects share, from when it
//! is sent until it has been executed. The board does not report this; the host knows it from the clocks. Knows
//! nothing of blocks or of what a message does. Units: the board's clock, in ticks.

use std::collections::VecDeque;

use units::Ticks;

use crate::link::{Clocks, MOTION_LANES_MAX};

/// Entries that motion leaves free, so that a heater or a fan never waits behind a full queue of steps.
pub const MOVE_ENTRIES_RESERVED_MAX: usize = 16;
/// Of small pools at most this part is kept free: one eighth.
const RESERVED_PART: usize = 8;

/// The entries of the board's move queue that are taken.
#[derive(Clone, Debug)]
pub struct MoveQueue {
    capacity: usize,
    taken: usize,
    /// The board's clock is only estimated: an entry counts as free this much after it should be.
    margin: Ticks,
    /// The clocks at which entries come free, ascending; one row a motion lane.
    motion: [VecDeque<Ticks>; MOTION_LANES_MAX],
    /// The same for everything else: few, and kept sorted.
    other: VecDeque<Ticks>,
}

impl MoveQueue {
    /// An empty queue of `capacity` entries (the board's `move_count`), whose entries count as free `margin` after
    /// their clock.
    pub fn new(capacity: usize, margin: Ticks) -> Self {
        Self { capacity, taken: 0, margin, motion: Default::default(), other: VecDeque::new() }
    }

    /// Entries that the board has.
    pub const fn capacity(&self) -> usize {
        self.capacity
    }

    /// Entries that are taken, as of the last [`release`](Self::release).
    pub const fn taken(&self) -> usize {
        self.taken
    }

    /// Entries that are free for outputs.
    pub const fn free(&self) -> usize {
        self.capacity.saturating_sub(self.taken)
    }

    /// Entries that are free for motion: a few are left to outputs.
    pub fn free_for_motion(&self) -> usize {
        let reserved = MOVE_ENTRIES_RESERVED_MAX.min(self.capacity / RESERVED_PART);
        self.free().saturating_sub(reserved)
    }

    /// A motion lane takes an entry until `end`. Entries of one lane end in the order in which they are taken.
    pub fn take_motion(&mut self, lane: usize, end: Ticks) {
        let row = &mut self.motion[lane];
        let end = row.back().map_or(end, |&last| last.max(end));
        row.push_back(end);
        self.taken += 1;
    }

    /// Anything else takes an entry until `end`.
    pub fn take_other(&mut self, end: Ticks) {
        let at = self.other.partition_point(|&taken| taken <= end);
        self.other.insert(at, end);
        self.taken += 1;
    }

    /// Frees what has been executed by now: steps by the motion clock, everything else by the hardware clock.
    pub fn release(&mut self, clocks: impl Into<Clocks>) {
        let clocks = clocks.into();
        let motion = self.motion.iter_mut().map(|row| (row, clocks.motion));
        for (row, clock) in motion.chain([(&mut self.other, clocks.hardware)]) {
            while row.front().is_some_and(|&end| end.0.saturating_add(self.margin.0) <= clock.0) {
                row.pop_front();
                self.taken -= 1;
            }
        }
    }

    /// How long until the next entry comes free, as far as that can be said.
    pub fn next_release(&self, clocks: impl Into<Clocks>) -> Option<Ticks> {
        let clocks = clocks.into();
        let free_at = |end: &Ticks| Ticks(end.0.saturating_add(self.margin.0));
        let motion = self.motion.iter().filter_map(|row| row.front()).min();
        let motion = motion.and_then(|end| clocks.until_motion(free_at(end)));
        let other = self.other.front().map(|end| free_at(end).saturating_sub(clocks.hardware));
        motion.into_iter().chain(other).min()
    }

    /// The board dropped the entries of one motion lane: its stepper was stopped by a trigger.
    pub fn forget_motion(&mut self, lane: usize) {
        self.taken -= self.motion[lane].len();
        self.motion[lane].clear();
    }

    /// The board dropped everything: it was reset, or shut down and cleared.
    pub fn forget_all(&mut self) {
        self.motion.iter_mut().for_each(VecDeque::clear);
        self.other.clear();
        self.taken = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn entries_come_back_when_their_clock_has_passed_by_the_margin() {
        let mut queue = MoveQueue::new(64, Ticks(10));
        queue.take_motion(0, Ticks(100));
        queue.take_motion(1, Ticks(50));
        queue.take_other(Ticks(70));
        assert_eq!((queue.taken(), queue.next_release(Ticks(0))), (3, Some(Ticks(60))));
        queue.release(Ticks(59));
        assert_eq!(queue.taken(), 3);
        queue.release(Ticks(60));
        assert_eq!((queue.taken(), queue.next_release(Ticks(60))), (2, Some(Ticks(20))));
        queue.release(Ticks(1000));
        assert_eq!((queue.taken(), queue.next_release(Ticks(0))), (0, None));
    }

    #[test]
    fn steps_go_by_the_motion_clock_and_outputs_by_the_other() {
        let mut queue = MoveQueue::new(64, Ticks(10));
        queue.take_motion(0, Ticks(100));
        queue.take_other(Ticks(100));
        let held = Clocks { hardware: Ticks(105), motion: Ticks(40), rate: None };
        assert_eq!(queue.next_release(held), Some(Ticks(5)));
        queue.release(Clocks { hardware: Ticks(200), ..held });
        assert_eq!((queue.taken(), queue.next_release(held)), (1, None));
        let runs = Clocks { hardware: Ticks(200), motion: Ticks(50), ..Clocks::from(Ticks(200)) };
        assert_eq!(queue.next_release(runs), Some(Ticks(60)));
    }

    #[test]
    fn motion_leaves_some_entries_to_outputs() {
        let mut queue = MoveQueue::new(64, Ticks(0));
        assert_eq!((queue.free(), queue.free_for_motion()), (64, 56));
        for _ in 0..56 {
            queue.take_motion(0, Ticks(1));
        }
        assert_eq!((queue.free(), queue.free_for_motion()), (8, 0));
        assert_eq!(MoveQueue::new(8000, Ticks(0)).free_for_motion(), 8000 - MOVE_ENTRIES_RESERVED_MAX);
    }

    #[test]
    fn a_stopped_stepper_gives_its_entries_back() {
        let mut queue = MoveQueue::new(64, Ticks(0));
        queue.take_motion(0, Ticks(100));
        queue.take_motion(1, Ticks(100));
        queue.forget_motion(0);
        assert_eq!(queue.taken(), 1);
        queue.forget_all();
        assert_eq!((queue.taken(), queue.next_release(Ticks(0))), (0, None));
    }

    proptest! {
        #[test]
        fn the_count_is_that_of_the_entries_still_running(
            takes in prop::collection::vec((0..=MOTION_LANES_MAX, 0_u64..1000), 0..200), clock in 0_u64..1000,
        ) {
            let mut queue = MoveQueue::new(1000, Ticks(0));
            let mut lane_end = [0; MOTION_LANES_MAX];
            let mut running = 0;
            for (lane, end) in takes {
                let end = if lane == MOTION_LANES_MAX {
                    queue.take_other(Ticks(end));
                    end
                } else {
                    lane_end[lane] = lane_end[lane].max(end);
                    queue.take_motion(lane, Ticks(end));
                    lane_end[lane]
                };
                running += usize::from(end > clock);
            }
            queue.release(Ticks(clock));
            prop_assert_eq!(queue.taken(), running);
        }
    }
}
