//! The state in which nothing moves and nothing heats, and what is still answered in it.

use units::Clock32;
use wire::{Command, Response, ShutdownReason};

/// Whether the board is shut down, why, and whether the host has been told.
pub(crate) struct Halt {
    reason: Option<ShutdownReason>,
    clock: Clock32,
    /// The announcement has yet to find room.
    pub(crate) announce: bool,
}

impl Halt {
    pub(crate) const fn new() -> Self {
        Self { reason: None, clock: Clock32(0), announce: false }
    }

    pub(crate) const fn reason(&self) -> Option<ShutdownReason> {
        self.reason
    }

    /// The first reason stays; what follows from it is none of its own.
    pub(crate) fn enter(&mut self, reason: ShutdownReason, clock: Clock32) -> bool {
        if self.reason.is_some() {
            return false;
        }
        *self = Self { reason: Some(reason), clock, announce: true };
        true
    }

    pub(crate) const fn leave(&mut self) {
        *self = Self::new();
    }

    pub(crate) fn announcement(&self) -> Option<Response<'static>> {
        self.reason.map(|reason| Response::Shutdown { clock: self.clock.0, static_string_id: reason as u16 })
    }

    pub(crate) fn refusal(&self) -> Option<Response<'static>> {
        self.reason.map(|reason| Response::IsShutdown { static_string_id: reason as u16 })
    }
}

/// Whether a command is obeyed while the board is shut down.
pub(crate) const fn is_allowed(command: &Command<'_>) -> bool {
    matches!(
        command,
        Command::Identify { .. }
            | Command::GetConfig {}
            | Command::GetClock {}
            | Command::GetUptime {}
            | Command::ClearShutdown {}
            | Command::ConfigReset {}
            | Command::Reset {}
    )
}
