//! The machine around the board, as its builder describes it: what is wired to which pin.
//!
//! Pins go by the names that the board's dictionary gives them. Lengths in millimetres. Does not know `printer.cfg`:
//! callers translate.

use crate::gantry::Gantry;
use crate::heater::{Plant, Sensor};
use crate::motor::{Mechanics, TIME_STEP_US};
use crate::switch::Side;
use std::fmt;
use units::Mm;

/// A wire from a pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The pin's name.
    pub pin: String,
    /// The part sees the opposite of the pin's level.
    pub inverted: bool,
}

impl Wire {
    /// A wire from the pin of this name.
    pub fn new(pin: impl Into<String>, inverted: bool) -> Self {
        Self { pin: pin.into(), inverted }
    }
}

/// A stepper motor behind a driver with step and direction inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Its name.
    pub name: String,
    /// A pulse is a microstep.
    pub step: Wire,
    /// High is towards higher positions.
    pub dir: Wire,
    /// High is current on. Without it the current is always on. Drivers whose input enables at low level: inverted.
    pub enable: Option<Wire>,
    /// What it is made of.
    pub mechanics: Mechanics,
    /// How far one microstep moves the load.
    pub step_distance: Mm,
    /// Where the load stands at power-up.
    pub start: Mm,
    /// The stops of the frame, lower and upper.
    pub frame: Option<(Mm, Mm)>,
    /// By how much the load sinks when the motor loses its power.
    pub sag: Mm,
}

/// A limit switch.
#[derive(Clone, Debug, PartialEq)]
pub struct Endstop {
    /// Its name; faults refer to it.
    pub name: String,
    /// High is closed.
    pub wire: Wire,
    /// The motor whose load presses it, by its place in [`Machine::motors`]; with a [`Gantry`] that couples motors, the
    /// axis of the head, 0, 1, 2 for X, Y, Z.
    pub motor: usize,
    /// At which end it sits.
    pub side: Side,
    /// Where it closes.
    pub position: Mm,
}

/// A heater with its sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Heater {
    /// Its name; faults refer to it.
    pub name: String,
    /// High is on.
    pub wire: Wire,
    /// The pin that its sensor is read with.
    pub sensor_pin: String,
    /// The sensor.
    pub sensor: Sensor,
    /// What it is made of.
    pub plant: Plant,
    /// The fan that blows on it, by its place in [`Machine::fans`].
    pub fan: Option<usize>,
    /// The filament that it melts.
    pub filament: Option<Filament>,
}

/// Filament that runs through a heater.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filament {
    /// The motor that pushes it, by its place in [`Machine::motors`].
    pub motor: usize,
    /// Its diameter.
    pub diameter: Mm,
}

/// A fan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fan {
    /// Its name.
    pub name: String,
    /// High is on.
    pub wire: Wire,
}

/// The whole machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Motors.
    pub motors: Vec<Motor>,
    /// How the first three of them hold the head. One that couples motors has no stops of the frame.
    pub gantry: Gantry,
    /// Limit switches.
    pub endstops: Vec<Endstop>,
    /// Heaters.
    pub heaters: Vec<Heater>,
    /// Fans.
    pub fans: Vec<Fan>,
    /// The step of time of the motors' integration, at most [`TIME_STEP_US`]; smaller ones change no
    /// result, unless a motor is within a hundredth of what it can do.
    pub time_step_us: u32,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            motors: Vec::new(),
            gantry: Gantry::default(),
            endstops: Vec::new(),
            heaters: Vec::new(),
            fans: Vec::new(),
            time_step_us: TIME_STEP_US,
        }
    }
}

/// Most motors of a machine.
pub const MOTORS_MAX: usize = 16;
/// Most limit switches of a machine.
pub const ENDSTOPS_MAX: usize = 16;

/// Why a machine cannot be built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WiringError {
    /// The board has no pin of this name.
    UnknownPin {
        /// The part that wants it.
        part: String,
        /// The name.
        pin: String,
    },
    /// Two parts want the same pin.
    PinTaken {
        /// The part that came second.
        part: String,
        /// The name.
        pin: String,
    },
    /// The pin has no converter.
    NotAnalog {
        /// The part that wants it.
        part: String,
        /// The name.
        pin: String,
    },
    /// A part refers to another that is not there.
    NoSuchPart {
        /// The part that refers.
        part: String,
        /// What it refers to.
        wants: &'static str,
    },
    /// Values that no part can have.
    Unsound {
        /// The part.
        part: String,
    },
    /// More motors or switches than there may be.
    TooMany {
        /// Of which.
        what: &'static str,
    },
    /// A fault names a part that the machine does not have.
    UnknownFaultTarget {
        /// The name.
        name: String,
    },
}

impl fmt::Display for WiringError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownPin { part, pin } => write!(f, "{part}: the board has no pin \"{pin}\""),
            Self::PinTaken { part, pin } => write!(f, "{part}: pin \"{pin}\" is already in use"),
            Self::NotAnalog { part, pin } => write!(f, "{part}: pin \"{pin}\" has no analog converter"),
            Self::NoSuchPart { part, wants } => write!(f, "{part} refers to a {wants} that is not there"),
            Self::Unsound { part } => write!(f, "{part} has values that no such part can have"),
            Self::TooMany { what } => write!(f, "the machine has too many {what}"),
            Self::UnknownFaultTarget { name } => {
                write!(f, "a fault names \"{name}\", which the machine does not have")
            }
        }
    }
}

impl std::error::Error for WiringError {}
