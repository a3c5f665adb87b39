//! What a session tells its owner, and what the owner asks of it.

use gcode::{Annotation, Diagnostic, Heater, ObjectAction};
use units::{Celsius, Seconds, Ticks};

use crate::{error::PrinterError, planner::Position};

/// The most events that wait for their owner: the oldest are dropped beyond that, and the owner is told how many.
pub const EVENTS_MAX: usize = 16_384;

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The phase of the connection changed.
    Phase(PhaseName),
    /// The board said who it is.
    Identified {
        /// Its firmware's version.
        version: String,
        /// Its chip.
        mcu: String,
        /// Its clock in Hz.
        clock_freq: f64,
    },
    /// A heater's latest reading.
    Temperature {
        /// Which heater.
        heater: Heater,
        /// What its sensor says.
        temperature: Celsius,
        /// What it should be; 0 is off.
        target: Celsius,
        /// The share of time that it is on.
        duty: f64,
    },
    /// A run of motion starts at this clock and position.
    RunStarted {
        /// The board's clock.
        at: Ticks,
        /// The machine's position, in mm.
        position: Position,
    },
    /// A move will be made between these clocks. Told when it is planned, some seconds ahead.
    Move(ScheduledMove),
    /// A run of motion ends at rest at this clock. Told when it is planned.
    RunEnded {
        /// The board's clock.
        at: Ticks,
    },
    /// An axis found its endstop: it is at this position now.
    Homed {
        /// 0, 1, 2 for X, Y, Z.
        axis: usize,
        /// Where it is, in mm.
        position_mm: f64,
        /// How many steps of the homing move were made, both approaches together.
        steps: u64,
    },
    /// The job passed this line.
    Progress {
        /// The line of the last move that has been made.
        line: u32,
        /// Print time of the runs so far.
        elapsed: Seconds,
    },
    /// The slicer's comment at the place where the print is now.
    Annotation(Annotation),
    /// An object begins or ends where the print is now.
    Object(ObjectAction),
    /// A text for the user.
    Message(String),
    /// Something in the G-code that the user should know of.
    Notice(Diagnostic),
    /// The job was paused, and the machine is at rest.
    Paused,
    /// The job goes on.
    Resumed,
    /// The job ended; all its moves have been made.
    JobDone,
    /// The job ended early because the user said so.
    JobCancelled,
    /// Something failed. What it stopped is part of the error's text.
    Error(PrinterError),
    /// Events were lost because nobody took them.
    Dropped(u64),
}

/// A planned move on the board's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledMove {
    /// The line of the source that asked for it; 0 for moves that no line asked for (homing).
    pub line: u32,
    /// When it starts.
    pub start: Ticks,
    /// When it ends.
    pub end: Ticks,
    /// Where it starts.
    pub from: Position,
    /// Where it ends.
    pub to: Position,
    /// Whether it belongs to homing, where a trigger may cut it short.
    pub homing: bool,
}

/// How far a connection is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseName {
    /// The board's dictionary is being read.
    Identifying,
    /// The board's clock is being measured, and its state asked for.
    Synchronising,
    /// The board is restarting.
    Restarting,
    /// The board's pins are being set up.
    Configuring,
    /// Ready for commands.
    Ready,
    /// The board has stopped everything and says why; a firmware restart is needed.
    Shutdown,
    /// The connection is of no use any more.
    Failed,
}

/// What an owner may ask.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Lines of G-code, typed by a user.
    Gcode(String),
    /// A heater's target; 0 is off.
    SetTemperature(Heater, Celsius),
    /// The part fan's speed, 0 ..= 1.
    SetFan(f64),
    /// The speed factor of everything that is planned from now on, 1 is as written.
    SetSpeedFactor(f64),
    /// The extrusion factor of everything that is planned from now on.
    SetFlowFactor(f64),
    /// The job comes to rest and waits.
    Pause,
    /// The job goes on from where it paused.
    Resume,
    /// The job comes to rest and ends; heaters and fan go off.
    Cancel,
    /// Everything stops at once.
    EmergencyStop,
    /// The board starts anew, after a shutdown or because the user wants it.
    FirmwareRestart,
}
