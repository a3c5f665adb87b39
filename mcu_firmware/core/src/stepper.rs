//! A motor driver's step and direction pins, driven by queued rows of steps.
//!
//! A step's rising edge comes at its clock; the falling edge is a timer of its own `pulse_ticks` later, so that
//! nothing ever waits. The pin then stays low for as long again before the next edge, which is also what a change of
//! direction is given to settle: the direction changes `pulse_ticks` before the first step of the new one (or when the
//! last pulse ends, where that is later). So the edges depend on the plan alone, not on when its rows arrived.
//!
//! Steps are due on the clock that the host plans with, pulses are as long as the driver's data sheet wants: where the
//! two clocks differ (a motion clock that slows down), `step_clock` is of the first and the rest of the second.

use units::Clock32;
use wire::ShutdownReason;

use crate::{
    board::{Board, Pin},
    moves::{MovePool, Queue, StepMove},
};

pub(crate) struct Stepper {
    step_pin: Pin,
    dir_pin: Pin,
    /// Whether a pulse is low.
    inverted: bool,
    pulse_ticks: u32,
    /// A pulse has begun and not ended.
    in_pulse: bool,
    /// The direction has to change before the next step.
    turning: bool,
    /// The level of the direction pin; high counts the position up.
    forward: bool,
    /// The direction of moves that are yet to come from the host.
    next_forward: bool,
    /// The planned clock of the next step; of the last one during its pulse and when none is left.
    step_clock: Clock32,
    interval: u32,
    add: i16,
    /// Steps of the current row that have not begun. Between pulses the timer only runs while there are some.
    left: u16,
    queue: Queue,
    position: i32,
    /// A trigger stopped it: rows are ignored until the host resets the clock.
    stopped: bool,
    /// The trigger that stops it.
    pub(crate) stop_on: Option<u8>,
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
            turning: false,
            forward: false,
            next_forward: false,
            step_clock: Clock32(0),
            interval: 0,
            add: 0,
            left: 0,
            queue: Queue::new(),
            position: 0,
            stopped: false,
            stop_on: None,
        })
    }

    /// The next edge, and when the one after it is due. Steps that are due before the pin may rise again are put off,
    /// not lost.
    #[inline]
    pub(crate) fn event<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        late_ticks: u32,
    ) -> Result<Option<Clock32>, ShutdownReason> {
        if !self.in_pulse {
            if self.turning {
                return Ok(Some(self.turn(board)));
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
            self.interval = self.interval.wrapping_add_signed(i32::from(self.add));
            self.step_clock = self.step_clock.wrapping_add(self.interval);
        } else if !self.load(moves) {
            return Ok(None);
        } else if let Some(wake) = self.start_turning(board) {
            return Ok(Some(wake));
        }
        let earliest = board.now().wrapping_add(self.pulse_ticks);
        let ahead = self.step_clock.since(earliest);
        if ahead >= 0 {
            Ok(Some(self.step_clock))
        } else if ahead.unsigned_abs() > late_ticks {
            Err(ShutdownReason::StepperTooFarInPast)
        } else {
            Ok(Some(earliest))
        }
    }

    /// Takes the next row off the queue; `false` when there is none.
    #[inline(never)]
    fn load<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        let Some(row) = moves.pop::<StepMove>(&mut self.queue) else { return false };
        self.interval = row.interval;
        self.add = row.add;
        self.left = row.count;
        self.step_clock = self.step_clock.wrapping_add(row.interval);
        self.turning = row.forward != self.forward;
        true
    }

    /// When to turn, if the row that was just loaded needs it and it is not time yet; where it is, turns at once.
    #[inline(never)]
    fn start_turning(&mut self, board: &mut impl Board) -> Option<Clock32> {
        if !self.turning {
            return None;
        }
        let at = self.step_clock.wrapping_add(self.pulse_ticks.wrapping_neg());
        if at.since(board.now()) > 0 {
            return Some(at);
        }
        self.turn(board);
        None
    }

    /// Changes the direction; the earliest clock of the step that follows.
    #[inline(never)]
    fn turn(&mut self, board: &mut impl Board) -> Clock32 {
        self.turning = false;
        self.forward = !self.forward;
        board.set_pin(self.dir_pin, self.forward);
        let earliest = board.now().wrapping_add(self.pulse_ticks);
        if self.step_clock.is_before(earliest) { earliest } else { self.step_clock }
    }

    /// Queues a row; the clock at which to wake when the stepper was idle.
    pub(crate) fn queue_step<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
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
        if is_busy {
            return Ok(None);
        }
        self.load(moves);
        let now = board.now();
        if self.step_clock.is_before(now) {
            return Err(ShutdownReason::TimerTooClose);
        }
        if let Some(wake) = self.start_turning(board) {
            return Ok(Some(wake));
        }
        // The direction may have changed just now, or the last pulse ended just now.
        let earliest = now.wrapping_add(self.pulse_ticks);
        Ok(Some(if self.step_clock.is_before(earliest) { earliest } else { self.step_clock }))
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
        Ok(())
    }

    /// Steps made so far, those towards a high direction pin less those towards a low one.
    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    /// Drops what is queued. Whether the timer may be stopped: a pulse that has begun still has to end.
    pub(crate) fn stop<const M: usize>(&mut self, moves: &mut MovePool<M>) -> bool {
        moves.clear(&mut self.queue);
        self.left = 0;
        self.turning = false;
        self.stopped = true;
        self.stop_on = None;
        !self.in_pulse
    }

    /// Drops everything at once, the pulse too. The move pool is reset by the caller.
    pub(crate) fn shut_down(&mut self, board: &mut impl Board) {
        board.set_pin(self.step_pin, self.inverted);
        self.in_pulse = false;
        self.turning = false;
        self.queue = Queue::new();
        self.left = 0;
        self.stopped = true;
        self.stop_on = None;
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
