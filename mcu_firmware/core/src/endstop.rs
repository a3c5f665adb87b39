//! Switches, watched for a number of equal readings in a row so that bounce and noise do not count.

use units::Clock32;
use wire::{Response, ShutdownReason};

use crate::{
    board::{Board, Pin, Pull},
    objects::After,
};

/// What `endstop_home` asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watch {
    pub(crate) sample_ticks: u32,
    pub(crate) sample_count: u8,
    pub(crate) rest_ticks: u32,
    /// The level that counts as hit.
    pub(crate) level: bool,
    pub(crate) trsync: u8,
    pub(crate) reason: u8,
}

pub(crate) struct Endstop {
    pin: Pin,
    watch: Option<Watch>,
    /// Equal readings still wanted.
    wanted: u8,
    /// When the search goes on should the row break. Once fired, `rest_ticks` before it is the first reading of the
    /// row, by which hosts know when the switch was hit.
    next_clock: Clock32,
    homing: bool,
}

impl Endstop {
    pub(crate) fn new(board: &mut impl Board, pin: Pin, pull: Pull) -> Result<Self, ShutdownReason> {
        board.configure_input(pin, pull).map_err(|_| ShutdownReason::InvalidPin)?;
        Ok(Self { pin, watch: None, wanted: 0, next_clock: Clock32(0), homing: false })
    }

    /// Begins to watch.
    pub(crate) fn home(&mut self, clock: Clock32, watch: Watch) -> Result<(), ShutdownReason> {
        if watch.rest_ticks == 0 || (watch.sample_ticks == 0 && watch.sample_count > 1) {
            return Err(ShutdownReason::InvalidEndstop);
        }
        self.wanted = watch.sample_count;
        self.watch = Some(watch);
        self.next_clock = clock;
        self.homing = true;
        Ok(())
    }

    /// Stops watching; the trigger it was to fire, if it has not.
    pub(crate) fn stop(&mut self) -> Option<u8> {
        self.homing = false;
        self.watch.take().map(|watch| watch.trsync)
    }

    /// Reads the switch.
    pub(crate) fn event(&mut self, board: &mut impl Board, wake: Clock32) -> After {
        let Some(watch) = self.watch else { return After::Done };
        if board.read_pin(self.pin) != watch.level {
            // A broken row gives way to the search where that would have gone on, unless that has passed already.
            let is_mid_row = self.wanted != watch.sample_count;
            self.wanted = watch.sample_count;
            if is_mid_row && wake.is_before(self.next_clock) {
                return After::Again(self.next_clock);
            }
            return After::Again(wake.wrapping_add(watch.rest_ticks));
        }
        if self.wanted == watch.sample_count {
            self.next_clock = wake.wrapping_add(watch.rest_ticks);
        }
        self.wanted -= 1;
        if self.wanted != 0 {
            return After::Again(wake.wrapping_add(watch.sample_ticks));
        }
        self.watch = None;
        self.homing = false;
        After::Fire { trsync: watch.trsync, reason: watch.reason }
    }

    pub(crate) fn state(&self, board: &mut impl Board, oid: u8) -> Response<'static> {
        Response::EndstopState {
            oid,
            homing: self.homing.into(),
            next_clock: self.next_clock.0,
            pin_value: board.read_pin(self.pin).into(),
        }
    }

    pub(crate) fn shut_down(&mut self) {
        self.stop();
    }
}
