//! From a `printer.cfg` to a machine that can be simulated: the board that has the file's pins, and a usual printer wired
//! to them.
//!
//! Knows the machine file and the virtual printer, which do not know each other. Knows no session, no file, no clock.
//! Lengths are millimetres, temperatures °C.

mod pins;
mod wiring;

pub use pins::fit;
pub use wiring::machine;

/// The text of the machine that is simulated where none is given: `samples/printer.cfg`.
pub const USUAL_MACHINE: &str = include_str!("../../../samples/printer.cfg");
