//! A motor driver's step and direction pins, driven by queued rows of steps.
//!
//! A step's rising edge comes at its clock; the falling edge is a timer of its own `pulse_ticks` later, so that
//! nothing ever waits. The pin then stays low for as long again before the next edge, which is also what a change of
//! direction is given to settle: the direction changes `pulse_ticks` before the first step of the new one (or when the
//! last pulse ends, where that is later). So the edges depend on the plan alone, not on when its rows arrived.
//!
//! Steps and turns are due on the motion clock that the host plans with; pulses and gaps are as long as the driver's
//! data sheet wants, on the hardware clock, and end even while the motion clock is held.

use units::Clock32;
use wire::{Response, RowCheck, ShutdownReason};

use crate::{
    board::{Board, Pin},
    motion_clock::MotionClock,
    moves::{MovePool, Queue, StepMove},
};

/// What comes next between pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// The step, at its motion clock.
    Step,
    /// The change of direction before it, on the motion clock.
    Turn,
    /// The end of the time that the pins need, on the hardware clock; the step may be due already.
    Gap,
}

/// The rows of a job.
struct Rows {
    received: u32,
    done: u32,
    check: RowCheck,
}

impl Rows {
    const NONE: Self = Self { received: 0, done: 0, check: RowCheck::new() };
}

pub(crate) struct Stepper {
    step_pin: Pin,
    dir_pin: Pin,
    /// Whether a pulse is low.
    inverted: bool,
    pulse_ticks: u32,
    /// A pulse has begun and not ended.
    in_pulse: bool,
    next: Next,
    /// The level of the direction pin; high counts the position up.
    forward: bool,
    /// The direction of moves that are yet to come from the host.
    next_forward: bool,
    /// The planned motion clock of the next step; of the last one during its pulse and when none is left.
    step_clock: Clock32,
    interval: u32,
    add: i16,
    /// Steps of the current row that have not begun. Between pulses the timer only runs while there are some.
    left: u16,
    queue: Queue,
    position: i32,
    /// A trigger stopped it, or its queue was dropped: rows are ignored until the host resets the clock.
    stopped: bool,
    /// Steps that were left in the current row when the queue was dropped, and their direction.
    dropped: (u16, bool),
    rows: Rows,
    /// The trigger that stops it.
    pub(crate) stop_on: Option<u8>,
    /// How far it came is still to be told.
    pub(crate) report_pending: bool,
}

impl Stepper {
    pub(crate) fn new(
        board: &mut impl Board,
        (step_pin, dir_pin): (Pin, Pin),
        inverted: bool,
        pulse_ticks: u32,
    ) -> Result<Self, ShutdownReason> {
        board.configure_output(step_pin, inverted).map_err(|_| ShutdownReason::InvalidPin)?;
        board.configure_output(dir_pin, false).map_err(|_| ShutdownReason::InvalidPin)?;
        Ok(Self {
            step_pin,
            dir_pin,
            inverted,
            pulse_ticks,
            in_pulse: false,
            next: Next::Step,
            forward: false,
            next_forward: false,
            step_clock: Clock32(0),
            interval: 0,
            add: 0,
            left: 0,
            queue: Queue::new(),
            position: 0,
            stopped: false,
            dropped: (0, false),
            rows: Rows::NONE,
            stop_on: None,
            report_pending: false,
        })
    }

    /// The next edge, and when the one after it is due; nothing where that is on the motion clock and out of its reach.
    /// Steps that are due before the pin may rise again are put off, not lost.
    #[inline]
    pub(crate) fn event<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        motion: &MotionClock,
        late_ticks: u32,
    ) -> Result<Option<Clock32>, ShutdownReason> {
        if !self.in_pulse {
            if self.next != Next::Step {
                let due = self.prepare(board, motion);
                if due.is_none_or(|due| due.since(board.now()) > 0) {
                    return Ok(due);
                }
                self.next = Next::Step;
            }
            board.set_pin(self.step_pin, !self.inverted);
            self.in_pulse = true;
            self.position = self.position.wrapping_add(i32::from(self.forward) * 2 - 1);
            self.left = self.left.wrapping_sub(1);
            return Ok(Some(board.now().wrapping_add(self.pulse_ticks)));
        }
        board.set_pin(self.step_pin, self.inverted);
        self.in_pulse = false;
        if self.left != 0 {
            self.step_clock = self.next_clock();
            self.interval = self.interval.wrapping_add_signed(i32::from(self.add));
        } else if !self.load_next(moves) {
            return Ok(None);
        } else if self.next == Next::Turn && !self.turn_if_due(board, motion) {
            return Ok(motion.when(self.turn_clock()));
        }
        let earliest = board.now().wrapping_add(self.pulse_ticks);
        if let Some(due) = motion.when(self.step_clock) {
            let ahead = due.since(earliest);
            if ahead >= 0 {
                return Ok(Some(due));
            }
            if ahead.unsigned_abs() > late_ticks {
                return Err(ShutdownReason::StepperTooFarInPast);
            }
        }
        // Out of the motion clock's reach it counts too: a ramp may bring the step within it sooner than that.
        self.next = Next::Gap;
        Ok(Some(earliest))
    }

    /// A turn or the end of a gap; when the step is due, if that is within reach.
    #[inline(never)]
    fn prepare(&mut self, board: &mut impl Board, motion: &MotionClock) -> Option<Clock32> {
        if self.next == Next::Turn {
            self.turn(board);
            return Some(self.after_gap(board, motion));
        }
        self.next = Next::Step;
        motion.when(self.step_clock)
    }

    /// The step, but not before the pins have had their time from now on.
    fn after_gap(&mut self, board: &mut impl Board, motion: &MotionClock) -> Clock32 {
        let earliest = board.now().wrapping_add(self.pulse_ticks);
        match motion.when(self.step_clock) {
            Some(due) if !due.is_before(earliest) => {
                self.next = Next::Step;
                due
            }
            _ => {
                self.next = Next::Gap;
                earliest
            }
        }
    }

    /// Goes on to the next row when one is finished; `false` when there is none.
    #[inline(never)]
    fn load_next<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        // A row that was cut off was counted, or not, when that happened.
        self.rows.done = self.rows.done.wrapping_add(u32::from(!self.stopped));
        self.load(moves)
    }

    /// Takes the next row off the queue; `false` when there is none.
    fn load<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        let Some(row) = moves.pop::<StepMove>(&mut self.queue) else { return false };
        self.interval = row.interval;
        self.add = row.add;
        self.left = row.count;
        self.step_clock = self.step_clock.wrapping_add(row.interval);
        self.next = if row.forward == self.forward { Next::Step } else { Next::Turn };
        true
    }

    /// The motion clock of the step after the one that was made last.
    const fn next_clock(&self) -> Clock32 {
        self.step_clock.wrapping_add(self.interval.wrapping_add_signed(self.add as i32))
    }

    const fn turn_clock(&self) -> Clock32 {
        self.step_clock.wrapping_add(self.pulse_ticks.wrapping_neg())
    }

    /// Turns if it is time; whether it was.
    #[inline(never)]
    fn turn_if_due(&mut self, board: &mut impl Board, motion: &MotionClock) -> bool {
        let is_due = motion.when(self.turn_clock()).is_some_and(|at| at.since(board.now()) <= 0);
        if is_due {
            self.turn(board);
        }
        is_due
    }

    /// Changes the direction.
    fn turn(&mut self, board: &mut impl Board) {
        self.next = Next::Step;
        self.forward = !self.forward;
        board.set_pin(self.dir_pin, self.forward);
    }

    /// What waits on the motion clock, and for when; nothing while the timer is on the hardware clock, or none runs.
    pub(crate) const fn motion_wake(&self) -> Option<Clock32> {
        match self.next {
            Next::Step if self.left != 0 && !self.in_pulse => Some(self.step_clock),
            Next::Turn if self.left != 0 && !self.in_pulse => Some(self.turn_clock()),
            _ => None,
        }
    }

    /// Queues a row; the clock at which to wake when the stepper was idle.
    pub(crate) fn queue_step<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        motion: &MotionClock,
        (interval, count, add): (u32, u16, i16),
    ) -> Result<Option<Clock32>, ShutdownReason> {
        if !is_row_valid(interval, count, add) {
            return Err(ShutdownReason::InvalidStepInterval);
        }
        if self.stopped {
            return Ok(None);
        }
        let is_busy = self.is_active() || self.in_pulse;
        moves.push(&mut self.queue, StepMove { interval, count, add, forward: self.next_forward })?;
        self.rows.received = self.rows.received.wrapping_add(1);
        self.rows.check.add(interval, count, add, self.next_forward);
        if is_busy {
            return Ok(None);
        }
        self.load(moves);
        if self.step_clock.is_before(motion.motion(board.now())) {
            return Err(ShutdownReason::TimerTooClose);
        }
        if self.next == Next::Turn && !self.turn_if_due(board, motion) {
            return Ok(motion.when(self.turn_clock()));
        }
        // The direction may have changed just now, or the last pulse ended just now.
        Ok(Some(self.after_gap(board, motion)))
    }

    pub(crate) const fn set_next_dir(&mut self, forward: bool) {
        self.next_forward = forward;
    }

    pub(crate) const fn reset_clock(&mut self, clock: Clock32) -> Result<(), ShutdownReason> {
        if self.is_active() {
            return Err(ShutdownReason::StepperActive);
        }
        self.step_clock = clock;
        self.stopped = false;
        self.dropped = (0, self.forward);
        Ok(())
    }

    /// Begins a new count of rows, which is only done when none is left of the last.
    pub(crate) const fn begin_job(&mut self) -> Result<(), ShutdownReason> {
        if self.is_active() || self.in_pulse {
            return Err(ShutdownReason::StepperActive);
        }
        self.rows = Rows::NONE;
        Ok(())
    }

    /// How far it has come in its rows.
    pub(crate) const fn progress(&self, oid: u8, job: u32) -> Response<'static> {
        let mut next = self.step_clock;
        if self.in_pulse && self.left != 0 {
            next = self.next_clock();
        }
        let (left, forward) = match self.next {
            _ if self.stopped => self.dropped,
            Next::Turn => (self.left, !self.forward),
            Next::Step | Next::Gap => (self.left, self.forward),
        };
        Response::StepperQueue {
            oid,
            job,
            received: self.rows.received,
            done: self.rows_done(),
            left,
            next: next.0,
            dir: forward as u8,
            pos: self.position,
            crc: self.rows.check.value(),
        }
    }

    /// A row is done when its last step has begun.
    const fn rows_done(&self) -> u32 {
        self.rows.done.wrapping_add((self.in_pulse && self.left == 0 && !self.stopped) as u32)
    }

    /// Drops what is queued, at rest; what was left of the current row is kept for [`Self::progress`]. Whether the timer
    /// may be stopped.
    pub(crate) fn drop_queue<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        if self.stopped {
            return !self.in_pulse;
        }
        if self.in_pulse && self.left != 0 {
            self.step_clock = self.next_clock();
        }
        let dropped = (self.left, self.forward ^ (self.next == Next::Turn));
        let stop_on = self.stop_on;
        let may_stop = self.stop(moves);
        self.stop_on = stop_on;
        self.dropped = dropped;
        may_stop
    }

    /// Steps made so far, those towards a high direction pin less those towards a low one.
    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    /// Drops what is queued. Whether the timer may be stopped: a pulse that has begun still has to end.
    pub(crate) fn stop<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        moves.clear(&mut self.queue);
        self.rows.done = self.rows_done();
        self.left = 0;
        self.next = Next::Step;
        self.stopped = true;
        self.dropped = (0, self.forward);
        self.stop_on = None;
        !self.in_pulse
    }

    /// Drops everything at once, the pulse too. The move pool is reset by the caller.
    pub(crate) fn shut_down(&mut self, board: &mut impl Board) {
        board.set_pin(self.step_pin, self.inverted);
        self.in_pulse = false;
        self.next = Next::Step;
        self.queue = Queue::new();
        self.left = 0;
        self.stopped = true;
        self.stop_on = None;
        self.report_pending = false;
    }

    const fn is_active(&self) -> bool {
        self.left != 0 || !self.queue.is_empty()
    }
}

/// Whether a row has steps and all its intervals are at least one tick and fit the clock. They change evenly, so the
/// first and the last tell.
fn is_row_valid(interval: u32, count: u16, add: i16) -> bool {
    let Some(changes) = count.checked_sub(1) else { return false };
    // At most 2³² + 2¹⁶·2¹⁵, which is far inside 64 bits.
    let last = i64::from(interval) + i64::from(add) * i64::from(changes);
    interval > 0 && last > 0 && last <= i64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_judged_by_both_ends() {
        assert!(is_row_valid(1, 1, i16::MIN), "a single step has no second interval");
        assert!(is_row_valid(u32::MAX, 1, 1));
        assert!(is_row_valid(101, 11, -10), "the last interval is 1");
        assert!(!is_row_valid(100, 11, -10), "the last interval is 0");
        assert!(!is_row_valid(u32::MAX, 2, 1), "the last interval overflows");
        assert!(!is_row_valid(0, 1, 1));
        assert!(!is_row_valid(100, 0, 0));
    }
}
