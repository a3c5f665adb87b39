//! The firmware without a chip: command dispatch, timers, steppers, endstops and triggers, analog inputs, outputs and
//! shutdown, speaking Klipper's wire protocol.
#![no_std]

mod board;

pub use board::{AnalogSample, Board, Pin, PinError, Pull};

use units::{Clock32, Hertz};

/// One board's firmware: `OBJECTS` is how many oids it has (at most 255), `MOVES` the entries of its move pool (at most 65534).
pub struct Firmware<const OBJECTS: usize, const MOVES: usize> {
    clock: Hertz,
    move_count: u16,
}

impl<const OBJECTS: usize, const MOVES: usize> Firmware<OBJECTS, MOVES> {
    /// A firmware that has just started, on a board whose clock runs at `clock`.
    pub const fn new(clock: Hertz) -> Self {
        Self { clock, move_count: MOVES as u16 }
    }

    /// Uses fewer entries of the move pool than there are, as a board with less memory would.
    #[must_use]
    pub const fn with_move_count(mut self, move_count: u16) -> Self {
        if (move_count as usize) < MOVES {
            self.move_count = move_count;
        }
        self
    }

    /// Takes bytes from the host, in pieces of any size: answers and obeys.
    pub fn receive(&mut self, board: &mut impl Board, bytes: &[u8]) {
        let _ = (board, bytes, self.clock, self.move_count);
    }

    /// Runs every timer that is due and returns the clock of the next one.
    pub fn run_timers(&mut self, board: &mut impl Board) -> Option<Clock32> {
        let _ = board;
        None
    }

    /// Sends what is waiting to be sent.
    pub fn run_tasks(&mut self, board: &mut impl Board) {
        let _ = board;
    }

    /// Whether [`Self::run_tasks`] has something to do.
    pub fn has_tasks(&self) -> bool {
        false
    }
}
