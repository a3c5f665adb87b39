//! What a user types and moves by hand: one thing after the other, each with line numbers of its own.
//!
//! All of it shares one modal state, in which only typed lines leave anything: a move by hand changes no mode and no feed.
//! Knows no board and no time. Bounded: what is too much is refused, not dropped.

use std::collections::VecDeque;

use units::{Mm, MmPerS};

use crate::{
    error::{ErrorCode, PrinterError},
    machine::MOTORS,
    planner::Source,
};

/// The longest text that may be typed at once, in bytes.
pub const CONSOLE_BYTES_MAX: usize = 16 * 1024;
/// The most texts and moves that wait for those before them.
const WAITING_MAX: usize = 64;
/// No machine is larger, in mm; nobody moves by hand faster, in mm/s.
const BY_HAND_MAX: f64 = 1e4;

/// Something to be done.
#[derive(Clone, Debug, PartialEq)]
enum Typed {
    Text(String),
    Move { axis: usize, distance: Mm, speed: MmPerS },
}

/// What was typed and is not yet done.
#[derive(Debug)]
pub(super) struct Console {
    pub(super) source: Source,
    waiting: VecDeque<Typed>,
}

impl Console {
    /// With nothing typed yet.
    pub(super) const fn new(source: Source) -> Self {
        Self { source, waiting: VecDeque::new() }
    }

    /// Takes lines of G-code.
    pub(super) fn type_text(&mut self, text: String) -> Result<(), PrinterError> {
        if text.len() > CONSOLE_BYTES_MAX {
            let detail = format!("more than {CONSOLE_BYTES_MAX} bytes at once");
            return Err(PrinterError::new(ErrorCode::InvalidGcode, detail));
        }
        self.wait(Typed::Text(text))
    }

    /// Takes a move of one axis, or of the filament, from where the last one will have ended.
    pub(super) fn move_by(&mut self, axis: usize, distance: Mm, speed: MmPerS) -> Result<(), PrinterError> {
        // Written so that what is not a number is refused too.
        if !(axis < MOTORS && distance.abs().0 <= BY_HAND_MAX && speed.0 > 0.0 && speed.0 <= BY_HAND_MAX) {
            let detail = format!("a move of {distance} at {speed} cannot be made by hand");
            return Err(PrinterError::new(ErrorCode::InvalidGcode, detail));
        }
        self.wait(Typed::Move { axis, distance, speed })
    }

    fn wait(&mut self, typed: Typed) -> Result<(), PrinterError> {
        if self.waiting.len() >= WAITING_MAX {
            return Err(PrinterError::new(ErrorCode::BusyPrinting, "what was typed is still being done"));
        }
        self.waiting.push_back(typed);
        Ok(())
    }

    /// The source has nothing left: gives it what comes next. `false` when nothing does.
    pub(super) fn advance(&mut self) -> bool {
        match self.waiting.pop_front() {
            Some(Typed::Text(text)) => self.source.begin_text(text.as_bytes()),
            Some(Typed::Move { axis, distance, speed }) => self.source.move_by(axis, distance, speed),
            None => return false,
        }
        true
    }

    /// Whether nothing is left to be read.
    pub(super) fn is_drained(&self) -> bool {
        self.waiting.is_empty() && self.source.is_drained()
    }

    /// Forgets everything that has not been read.
    pub(super) fn clear(&mut self) {
        self.waiting.clear();
        self.source.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_much_or_no_move_is_refused() {
        let mut console = Console::new(Source::default());
        let refused = |result: Result<(), PrinterError>| result.unwrap_err().code;
        assert_eq!(refused(console.type_text("G".repeat(CONSOLE_BYTES_MAX + 1))), ErrorCode::InvalidGcode);
        for (axis, distance, speed) in [
            (MOTORS, 1.0, 1.0),
            (0, f64::NAN, 1.0),
            (0, f64::INFINITY, 1.0),
            (0, 1.0, 0.0),
            (0, 1.0, -1.0),
            (0, 1.0, f64::NAN),
            (0, 1.0, f64::INFINITY),
        ] {
            assert_eq!(refused(console.move_by(axis, Mm(distance), MmPerS(speed))), ErrorCode::InvalidGcode);
        }
        assert!(console.is_drained() && !console.advance());
        for _ in 0..WAITING_MAX {
            console.type_text("G28".into()).unwrap();
        }
        assert_eq!(refused(console.move_by(0, Mm(1.0), MmPerS(1.0))), ErrorCode::BusyPrinting);
        assert!(!console.is_drained() && console.advance());
        console.move_by(0, Mm(1.0), MmPerS(1.0)).unwrap();
        console.clear();
        assert!(console.is_drained() && !console.advance());
    }
}
