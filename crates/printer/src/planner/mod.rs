//! From G-code to step commands, with everything that happens between them at its print time.
//!
//! This is the deterministic heart of the product: the same file and machine give the same output natively and in a
//! browser. It pulls from a [`Source`], holds a bounded window, and hands out one [`Planned`] item at a time. It
//! knows no host time and no board clock: times are seconds, and step commands are ticks, from the start of a **run of
//! motion**, which is a stretch that begins and ends at rest.

mod guard;
mod report;
mod source;

use std::collections::VecDeque;

use gcode::{
    Action, Annotation, CHORD_TOLERANCE, Diagnostic, DiagnosticCode, Heater, LineNumber, Move, ObjectAction,
    PauseReason, Severity, VelocityLimit, Wait,
};
use motion::{Limits, LookAhead, MoveRequest, PlannedMove};
use steps::{StepCommand, StepGenerator};
use units::{Celsius, Hertz, MmPerS, Seconds, Ticks};

pub use guard::{ExtrusionPermit, Guard};
pub use report::{MotorReport, PLAN_CLOCK, PlanReport, PlanStream};
pub use source::{SOURCE_BYTES_MAX, Source};

use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine,
};

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
    /// Home these axes; the owner then calls [`Planner::set_axis`] and the interpreter's `set_axes`.
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
    Move(PlannedMove),
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

/// How far the run of motion is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Run {
    /// At rest, no run.
    None,
    /// Moves come.
    Active,
    /// All moves are in the look-ahead, and the last one ends at rest.
    Ending,
    /// All moves are in the step generator.
    Draining,
}

#[derive(Clone, Debug)]
struct Deferred {
    /// How many moves come before it.
    after: u64,
    line: LineNumber,
    action: TimedAction,
}

/// The most timed actions that wait for their move at once: more end the run, so that memory stays bounded.
const DEFERRED_MAX: usize = 4096;

/// Turns G-code into step commands.
#[derive(Debug)]
pub struct Planner {
    /// What the machine allows.
    pub guard: Guard,
    machine_limits: Limits,
    limits: Limits,
    look_ahead: LookAhead,
    generator: StepGenerator,
    position: Position,
    /// The toolhead's extruder position less the interpreter's, which counts from its own start.
    e_offset: f64,
    run: Run,
    moves_pushed: u64,
    moves_planned: u64,
    /// Print time at which the last planned move ends.
    planned_until: Seconds,
    deferred: VecDeque<Deferred>,
    ready: VecDeque<Planned>,
    barrier: Option<(LineNumber, Barrier)>,
}

impl Planner {
    /// A planner for a machine and a board's clock. No axis is homed, and the machine stands at 0, 0, 0.
    pub fn new(config: &PrinterConfig, clock: Hertz) -> Result<Self, PrinterError> {
        let limits = machine::limits(config);
        let look_ahead = LookAhead::new(limits)
            .map_err(|error| PrinterError::new(ErrorCode::ConfigInvalid, error.to_string()))?;
        Ok(Self {
            guard: Guard::new(config),
            machine_limits: limits,
            look_ahead,
            limits,
            generator: machine::step_generator(config, clock)?,
            position: [0.0; 4],
            e_offset: 0.0,
            run: Run::None,
            moves_pushed: 0,
            moves_planned: 0,
            planned_until: Seconds::ZERO,
            deferred: VecDeque::new(),
            ready: VecDeque::new(),
            barrier: None,
        })
    }

    /// Where the last accepted move ends.
    pub const fn position(&self) -> Position {
        self.position
    }

    /// Whether there is no run of motion.
    pub fn is_at_rest(&self) -> bool {
        self.run == Run::None
    }

    /// Print time up to which moves have been planned in this run.
    pub const fn planned_until(&self) -> Seconds {
        self.planned_until
    }

    /// Run clock up to which step commands have been handed out.
    pub fn generated_until(&self) -> Ticks {
        self.generator.settled()
    }

    /// What the step generator counted so far.
    pub fn generator(&self) -> &StepGenerator {
        &self.generator
    }

    /// Says where an axis is, at rest.
    pub fn set_axis(&mut self, axis: usize, position_mm: f64, homed: bool) {
        debug_assert!(self.is_at_rest(), "an axis is only set at rest");
        self.position[axis] = position_mm;
        self.guard.set_homed(axis, homed);
    }

    /// Makes a source continue from where the machine is: before its first line, and whenever another source moved.
    pub fn adopt(&mut self, source: &mut Source) {
        let [x, y, z, e] = self.position;
        source.interpreter.set_axes(Some(x), Some(y), Some(z));
        self.e_offset = e - source.interpreter.position().e;
    }

    /// Makes a source that was interrupted go on: the machine is where the source thinks that it is, but for the
    /// extruder, which may have been moved.
    pub fn rejoin(&mut self, source: &Source) {
        self.e_offset = self.position[3] - source.interpreter.position().e;
    }

    /// Lets the machine come to rest after the moves that were read; [`Planned::RunEnded`] tells when.
    pub fn finish_run(&mut self) {
        if self.run == Run::Active {
            self.look_ahead.flush();
            self.run = Run::Ending;
        }
    }

    /// Forgets a barrier that has been read and not been reached.
    pub fn drop_barrier(&mut self) {
        self.barrier = None;
    }

    /// Drops everything that was planned: the motors have been stopped by something else. The position is where the
    /// dropped moves would have ended, so the owner has to set what it knows.
    pub fn abandon_run(&mut self) {
        self.look_ahead.begin_run();
        // Forgets what has not been taken; the position was taken before, so it is in range.
        let _ = self.generator.begin_run(self.position);
        self.deferred.clear();
        self.ready.clear();
        self.barrier = None;
        self.moves_planned = self.moves_pushed;
        self.run = Run::None;
    }

    /// A single straight move outside any source, not judged by the guard: homing, and going back after a pause.
    pub fn push_raw_move(
        &mut self,
        to: Position,
        feed: MmPerS,
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        self.push(to, feed, line)
    }

    /// The next item of the plan.
    pub fn next(&mut self, source: &mut Source) -> Result<Planned, PrinterError> {
        loop {
            if let Some(item) = self.ready.pop_front() {
                return Ok(item);
            }
            if let Some(command) = self.generator.pop() {
                return Ok(Planned::Steps(command));
            }
            if let Some(planned) = self.look_ahead.pop() {
                self.take_planned(planned)?;
                continue;
            }
            match self.run {
                Run::Ending => {
                    self.generator.end_run();
                    self.run = Run::Draining;
                    continue;
                }
                Run::Draining => {
                    self.run = Run::None;
                    self.planned_until = self.look_ahead.print_time();
                    return Ok(Planned::RunEnded(self.planned_until));
                }
                Run::Active | Run::None => {}
            }
            if let Some((line, barrier)) = self.barrier.take() {
                if self.run == Run::None {
                    return Ok(Planned::Barrier { line, barrier });
                }
                self.barrier = Some((line, barrier));
                self.finish_run();
                continue;
            }
            if let Some(chord) = source.chords.pop_front() {
                self.judge_and_push(&chord)?;
                continue;
            }
            match source.next() {
                source::Next::Action(action) => self.act(action, source)?,
                source::Next::Diagnostic(diagnostic) => return Ok(Planned::Notice(diagnostic)),
                source::Next::NeedsInput => return Ok(Planned::NeedsInput),
                source::Next::End if self.run == Run::None => return Ok(Planned::EndOfSource),
                source::Next::End => self.finish_run(),
            }
        }
    }

    fn act(&mut self, action: Action, source: &mut Source) -> Result<(), PrinterError> {
        let line = source.line();
        match action {
            Action::Move(mv) => self.judge_and_push(&mv)?,
            Action::Arc(arc) => source.chords.extend(arc.chords(CHORD_TOLERANCE)),
            Action::VelocityLimit(limit) => self.limit(limit),
            Action::SetTemperature { heater, target, wait: Wait::No } => {
                self.defer(line, TimedAction::SetTemperature { heater, target });
            }
            Action::SetTemperature { heater, target, wait } => {
                self.barrier = Some((line, Barrier::WaitTemperature { heater, target, wait }));
            }
            Action::Fan { index, speed } => self.defer(line, TimedAction::Fan { index, speed }),
            Action::Message(text) => self.defer(line, TimedAction::Message(text)),
            Action::Annotation(annotation) => self.defer(line, TimedAction::Annotation(annotation)),
            Action::Object(object) => self.defer(line, TimedAction::Object(object)),
            Action::ReportTemperatures => self.defer(line, TimedAction::ReportTemperatures),
            Action::ReportPosition => self.defer(line, TimedAction::ReportPosition),
            Action::Home { x, y, z } => self.barrier = Some((line, Barrier::Home([x, y, z]))),
            Action::Dwell(pause) if self.run == Run::Active => self.look_ahead.dwell(pause),
            Action::Dwell(pause) => self.barrier = Some((line, Barrier::Dwell(pause))),
            Action::MotorsOff { x, y, z, e } => self.barrier = Some((line, Barrier::MotorsOff([x, y, z, e]))),
            Action::WaitForMoves => self.barrier = Some((line, Barrier::WaitForMoves)),
            Action::Pause(reason) => self.barrier = Some((line, Barrier::Pause(reason))),
            Action::EmergencyStop => self.barrier = Some((line, Barrier::EmergencyStop)),
            Action::SelectTool(tool) if tool > 0 => {
                let detail = format!("tool T{tool} is not in the machine file");
                return Err(PrinterError::new(ErrorCode::NoSuchHeater, detail).at_line(line.0));
            }
            Action::WaitForTemperature { heater, minimum, maximum } => {
                self.barrier = Some((line, Barrier::WaitForTemperature { heater, minimum, maximum }));
            }
            Action::TurnOffHeaters => self.defer(line, TimedAction::TurnOffHeaters),
            Action::Cancel => self.barrier = Some((line, Barrier::Cancel)),
            Action::PressureAdvance { .. } => {
                self.notice(
                    line,
                    "pressure advance is not applied by this version: the print is made without it",
                );
            }
            // The interpreter has the factors in its moves already; the machine file knows the machine's limits; there
            // is only one tool.
            Action::SpeedFactor(_)
            | Action::FlowFactor(_)
            | Action::MachineLimits(_)
            | Action::SelectTool(_) => {}
        }
        Ok(())
    }

    fn notice(&mut self, line: LineNumber, message: &str) {
        self.ready.push_back(Planned::Notice(Diagnostic {
            line,
            columns: 0..0,
            severity: Severity::Info,
            code: DiagnosticCode::IgnoredSetting,
            message: message.into(),
        }));
    }

    /// A file may ask for less than the machine file allows, never for more.
    fn limit(&mut self, limit: VelocityLimit) {
        let machine = &self.machine_limits;
        let mut limits = self.limits;
        if let Some(velocity) = limit.velocity {
            limits.max_velocity = velocity.min(machine.max_velocity);
        }
        if let Some(accel) = limit.accel {
            limits.max_accel = accel.min(machine.max_accel);
        }
        if let Some(corner) = limit.square_corner_velocity {
            limits.square_corner_velocity = corner.min(machine.square_corner_velocity);
        }
        if let Some(ratio) = limit.minimum_cruise_ratio {
            limits.minimum_cruise_ratio = ratio;
        }
        // Limits that make no sense (zero, not a number) leave those that hold.
        if self.look_ahead.set_limits(limits).is_ok() {
            self.limits = limits;
        }
    }

    /// Attaches an action to the end of the moves read so far.
    fn defer(&mut self, line: LineNumber, action: TimedAction) {
        if self.moves_planned == self.moves_pushed {
            let at = if self.run == Run::None { Seconds::ZERO } else { self.planned_until };
            self.ready.push_back(Planned::Timed { at, line, action });
            return;
        }
        self.deferred.push_back(Deferred { after: self.moves_pushed, line, action });
        if self.deferred.len() >= DEFERRED_MAX {
            self.finish_run();
        }
    }

    fn judge_and_push(&mut self, mv: &Move) -> Result<(), PrinterError> {
        self.guard.judge(mv)?;
        self.push([mv.to.x, mv.to.y, mv.to.z, mv.to.e + self.e_offset], mv.feed, mv.line)
    }

    fn push(&mut self, to: Position, feed: MmPerS, line: LineNumber) -> Result<(), PrinterError> {
        if to == self.position {
            return Ok(());
        }
        if self.run == Run::None {
            self.look_ahead.begin_run();
            self.generator.begin_run(self.position).map_err(|error| wrong(&error).at_line(line.0))?;
            self.planned_until = Seconds::ZERO;
            self.run = Run::Active;
            self.ready.push_back(Planned::RunStarted(self.position));
        }
        let before = self.look_ahead.len();
        let request = MoveRequest { from: self.position, to, feed, tag: line.0 };
        self.look_ahead.push(&request).map_err(|error| wrong(&error).at_line(line.0))?;
        // The look-ahead drops moves without length.
        self.moves_pushed += (self.look_ahead.len() - before) as u64;
        self.position = to;
        Ok(())
    }

    fn take_planned(&mut self, planned: PlannedMove) -> Result<(), PrinterError> {
        self.generator.push(&planned).map_err(|error| wrong(&error).at_line(planned.tag))?;
        self.planned_until = Seconds(planned.end_time());
        self.moves_planned += 1;
        self.ready.push_back(Planned::Move(planned));
        while let Some(deferred) = self.deferred.pop_front_if(|deferred| deferred.after <= self.moves_planned)
        {
            let Deferred { line, action, .. } = deferred;
            self.ready.push_back(Planned::Timed { at: self.planned_until, line, action });
        }
        Ok(())
    }
}

/// A move that cannot be planned: too fast for the board, or too far to be counted.
fn wrong(error: &dyn core::error::Error) -> PrinterError {
    PrinterError::new(ErrorCode::InvalidGcode, error.to_string())
}
