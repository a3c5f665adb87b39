//! The virtual printer: the firmware core on a simulated board with a simulated machine around it, in virtual time.
//!
//! A thermal plant with thermistors, motors that follow or slip by their own physics, carriages with stops and bouncing
//! switches, a link with latency, a recorder of every edge on the motors' pins, and faults by script. Everything that is
//! chance comes from one seed; the same bytes at the same times give the same run, natively and in WebAssembly.
//!
//! Does not know: real clocks, ports, files, `printer.cfg`, planners. Time is the board's clock ([`units::Ticks`]),
//! lengths are millimetres, temperatures °C.
//!
//! ```
//! use virtual_printer::{BoardProfile, Faults, Machine, VirtualPrinter};
//! let board = BoardProfile::rp2040();
//! let mut printer = VirtualPrinter::new(board, &Machine::default(), &Faults::default(), 1, ()).expect("sound");
//! let mut to_host = Vec::new();
//! let later = printer.start() + printer.profile().clock.ticks_in(units::Seconds(1.0));
//! while printer.run_until(later, &mut to_host) < later {}
//! ```

mod board;
mod faults;
mod gantry;
mod heater;
mod machine;
mod motor;
mod pipe;
mod printer;
mod profile;
mod random;
mod recorder;
mod rotor;
mod state;
mod switch;
mod thermistor;
mod wiring;

pub use faults::{ByteFaults, FAULT_ITEMS, Failure, FailureKind, FaultError, Faults, HostStall, UserPause};
pub use gantry::{Gantry, Towers};
pub use heater::{Plant, Sensor};
pub use machine::{
    ENDSTOPS_MAX, Endstop, Fan, Filament, Heater, MOTORS_MAX, Machine, Motor, Wire, WiringError,
};
pub use motor::{Mechanics, TIME_STEP_US};
pub use printer::{OBJECTS_MAX, VirtualPrinter};
pub use profile::{BoardProfile, LinkProfile, MOVES_MAX};
pub use recorder::{Edge, EdgeKind, EdgeLog, Recorder};
pub use rotor::Rotor;
pub use state::{EndstopView, FanView, HeaterView, MotorView, State};
pub use switch::Side;
pub use thermistor::Thermistor;
