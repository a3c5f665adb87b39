//! What a plan is made of, in the order in which it has to be handled.

use gcode::{Annotation, Diagnostic, Heater, LineNumber, ObjectAction, PauseReason, Wait};
use motion::PlannedMove;
use steps::StepCommand;
use units::{Celsius, Seconds};

use crate::pace::Pace;

/// A machine position: X, Y, Z in mm and the extruder in mm of filament.
pub type Position = [f64; 4];

/// Something that happens at a time of the run without stopping it.
#[derive(Clone, Debug, PartialEq)]
pub enum TimedAction {
    /// A heater gets a new target; the print does not wait for it.
    SetTemperature {
        /// Which heater.
        heater: Heater,
        /// Its new target; 0 is off.
        target: Celsius,
    },
    /// Every heater goes off.
    TurnOffHeaters,
    /// A fan gets a new speed.
    Fan {
        /// Which fan.
        index: u8,
        /// 0 ..= 1.
        speed: f64,
    },
    /// A text for the user.
    Message(String),
    /// A comment of the slicer's that means something.
    Annotation(Annotation),
    /// One of several objects on the bed begins, ends or is defined.
    Object(ObjectAction),
    /// The source asked for temperatures.
    ReportTemperatures,
    /// The source asked for the position.
    ReportPosition,
}

/// Something that the machine must be at rest for, and that may take any time.
#[derive(Clone, Debug, PartialEq)]
pub enum Barrier {
    /// Home these axes; the owner then calls [`Planner::set_axis`] and [`Planner::tell_homed`].
    Home([bool; 3]),
    /// Set a target and wait until the heater is there.
    WaitTemperature {
        /// Which heater.
        heater: Heater,
        /// Its new target.
        target: Celsius,
        /// When the wait ends.
        wait: Wait,
    },
    /// Wait at rest.
    Dwell(Seconds),
    /// Release these motors (X, Y, Z, E).
    MotorsOff([bool; 4]),
    /// Nothing but coming to rest.
    WaitForMoves,
    /// Stop here until the user says so.
    Pause(PauseReason),
    /// End the job here.
    Cancel,
    /// Wait until a heater is within bounds.
    WaitForTemperature {
        /// Which heater.
        heater: Heater,
        /// Not below this.
        minimum: Option<Celsius>,
        /// Not above this.
        maximum: Option<Celsius>,
    },
    /// Stop everything at once.
    EmergencyStop,
}

/// One item of the plan, in the order in which it has to be handled.
#[derive(Clone, Debug, PartialEq)]
pub enum Planned {
    /// A run of motion starts at rest at this position.
    RunStarted(Position),
    /// A move's final speeds; its steps follow, though not at once.
    Move(PlannedMove, Pace),
    /// A motor's next step command.
    Steps(StepCommand),
    /// Something that happens on the way.
    Timed {
        /// Print time from the start of the run.
        at: Seconds,
        /// The line that asked for it.
        line: LineNumber,
        /// What happens.
        action: TimedAction,
    },
    /// The run ends at rest at this print time, and all its step commands have been handed out.
    RunEnded(Seconds),
    /// The machine is at rest, and this has to be done before anything else.
    Barrier {
        /// The line that asked for it.
        line: LineNumber,
        /// What has to be done.
        barrier: Barrier,
    },
    /// Something in the source that the user should know of. Blocking ones that nobody confirmed are errors instead.
    Notice(Diagnostic),
    /// The source must be fed.
    NeedsInput,
    /// The source has ended, and the machine is at rest.
    EndOfSource,
}
