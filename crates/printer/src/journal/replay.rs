//! Makes a print's plan again, up to where its board holds.
//!
//! The board says how many rows of steps each motor has received and made in a run of motion, and the check over them.
//! The plan is made from the file and the journal, and compared row by row: only where all checks agree there is
//! anything to go on with. What has been made is passed over; what has not is the [`Continuation`].
//!
//! Knows no board but what it said, sends nothing, and takes its time in small pieces. Units: ticks from the run's start.

use std::collections::VecDeque;

use gcode::{Heater, LineNumber};
use motion::PlannedMove;
use steps::{Geometry, StepCommand, StepCommandKind};
use units::{Celsius, Clock32, Seconds, Ticks};
use wire::RowCheck;

use super::{
    CountedRun, Height, Input, Journal, Parked, Place, RowPlace, machine_check,
    rows::{BoardQueue, Row},
};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine::{self, MOTORS},
    planner::{
        Barrier, ExtrusionPermit, Pace, Planned, Planner, Position, Skip, Skipped, Source, TimedAction,
    },
};

/// Items of the plan that are made in one go.
const ITEMS_MAX: usize = 8192;
/// The most rows that a board can have received of one motor and not made: more than any board's memory holds.
const BACKLOG_MAX: usize = 65_536;
/// The most things that may wait for their time.
const TIMELINE_MAX: usize = 65_536;

/// Something that comes at a time of the run.
#[derive(Clone, Debug)]
pub(crate) enum TimedDue {
    Move(PlannedMove, Pace),
    Action(LineNumber, TimedAction),
}

/// One motor's share of the run that the board is in.
#[derive(Clone, Debug, Default)]
struct Motor {
    forward: bool,
    /// Rows of the run so far …
    rows: u32,
    /// … and of those that the board counts.
    counted: u32,
    check: RowCheck,
    /// Steps that the board has made of the run, towards larger positions less towards smaller.
    made: i32,
    backlog: VecDeque<Row>,
}

/// What there is to go on with.
#[derive(Debug)]
pub(crate) struct Continuation {
    pub(crate) planner: Planner,
    pub(crate) source: Source,
    pub(crate) place: Place,
    /// Runs of motion so far, the present one included.
    pub(crate) runs: u32,
    /// Inputs of the journal that have come into force.
    pub(crate) inputs: usize,
    /// Those that had not, and hold from here on.
    pub(crate) adopted: Vec<Input>,
    /// The low half of the motion clock of the run's start.
    pub(crate) start: Clock32,
    /// When the run ends, if that is known.
    pub(crate) end: Option<Ticks>,
    /// The run's time up to which everything has certainly been made.
    pub(crate) made_until: Ticks,
    pub(crate) position_at_start: Position,
    /// For each motor: steps made of the run, rows that are not, the direction of the last, and where its rows stand.
    pub(crate) made: [i32; MOTORS],
    pub(crate) backlog: [VecDeque<Row>; MOTORS],
    pub(crate) forward: [bool; MOTORS],
    pub(crate) from: [RowPlace; MOTORS],
    pub(crate) timeline: VecDeque<(Ticks, TimedDue)>,
    /// What heaters and fan had been told by then.
    pub(crate) targets: Vec<(Heater, Celsius)>,
    pub(crate) fan: f64,
    /// Print time of the runs before this one.
    pub(crate) elapsed: Seconds,
    /// The number under which the board last counted.
    pub(crate) id: u32,
    /// How it was put aside, where it was.
    pub(crate) parked: Option<Parked>,
    /// What was last written of where Z stands.
    pub(crate) height: Option<Height>,
    /// How far axes are from where the plan has them, in mm.
    pub(crate) off_mm: [f64; 3],
}

/// How far a replay is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Advance {
    /// It must be fed.
    NeedsInput,
    /// There is more to do.
    Working,
    Done,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct Replay {
    planner: Planner,
    source: Source,
    inputs: VecDeque<(Place, Input)>,
    inputs_done: usize,
    place: Place,
    wanted: CountedRun,
    queue: BoardQueue,
    /// By how much each direction pin's level is turned round.
    inverted: [bool; MOTORS],
    endstops: [f64; 3],
    geometry: Geometry,
    runs: u32,
    position_at_start: Position,
    motors: [Motor; MOTORS],
    made_until: Ticks,
    end: Option<Ticks>,
    timeline: VecDeque<(Ticks, TimedDue)>,
    targets: Vec<(Heater, Celsius)>,
    fan: f64,
    elapsed: Seconds,
    /// The last number in the journal.
    last_id: u32,
    parked: Option<Parked>,
    height: Option<Height>,
    off_mm: [f64; 3],
    /// Reads up to the line with which the print begins.
    skip: Option<Skip>,
    is_done: bool,
}

fn differs(detail: impl Into<String>) -> PrinterError {
    PrinterError::new(ErrorCode::ContinuationRefused, detail)
}

impl Replay {
    /// Of a print, up to where the board is; refused where the journal is not that of what the board carries out.
    pub(crate) fn new(
        config: &PrinterConfig,
        clock: units::Hertz,
        journal: &Journal,
        queue: BoardQueue,
    ) -> Result<Self, PrinterError> {
        if journal.has_ended {
            return Err(differs("its journal says that the print has ended"));
        }
        if journal.machine != machine_check(config) || journal.clock != clock {
            return Err(differs("the machine file or the board is not the one it was begun with"));
        }
        let (queue, parked) = journal.unparked(queue);
        let wanted = journal.runs.iter().rfind(|run| run.id == queue.id);
        let wanted = *wanted.ok_or_else(|| differs("the board carries out something else"))?;
        let mut planner = Planner::new(config, clock)?;
        planner.set_recorded_transform(&journal.transform)?;
        if journal.start_line.is_none() {
            planner.stand_at(journal.position);
            (0..3).for_each(|axis| planner.guard.set_homed(axis, journal.homed[axis]));
        }
        // What is planned has been printed before; how hot it is now is judged when it goes on.
        planner.guard.extrusion = ExtrusionPermit::Allowed;
        let mut source = Source::new(machine::gcode_settings(config));
        planner.begin_job(&mut source);
        let endstops = config.steppers.each_ref().map(|stepper| stepper.position_endstop.0);
        let pins = config.steppers.each_ref().map(|stepper| stepper.motor.dir_pin.inverted);
        let extruder = config.extruder.as_ref().is_some_and(|extruder| extruder.motor.dir_pin.inverted);
        Ok(Self {
            planner,
            source,
            inputs: journal.inputs.iter().copied().collect(),
            inputs_done: 0,
            place: Place::default(),
            wanted,
            queue,
            inverted: [pins[0], pins[1], pins[2], extruder],
            endstops,
            geometry: machine::geometry(config),
            runs: 0,
            position_at_start: journal.position,
            motors: core::array::from_fn(|_| Motor::default()),
            made_until: Ticks(0),
            end: None,
            timeline: VecDeque::new(),
            targets: Vec::new(),
            fan: 0.0,
            elapsed: Seconds::ZERO,
            last_id: journal.last_id,
            parked,
            height: journal.height,
            off_mm: journal.off_mm,
            skip: journal.start_line.map(|line| Skip::new(line, endstops)),
            is_done: false,
        })
    }

    /// How many bytes of the file may be fed now: never beyond where an input came into force.
    pub(crate) fn wants(&self) -> usize {
        let wants = self.source.wants();
        let until = self.inputs.front().and_then(|(at, _)| at.drained);
        until.map_or(wants, |until| {
            wants.min(usize::try_from(until - self.source.fed().min(until)).unwrap_or(wants))
        })
    }

    pub(crate) fn feed(&mut self, bytes: &[u8]) {
        self.source.feed(bytes);
    }

    pub(crate) fn end(&mut self) {
        self.source.end();
    }

    /// Makes a piece of the plan.
    pub(crate) fn advance(&mut self) -> Result<Advance, PrinterError> {
        if let Some(skip) = &mut self.skip {
            match skip.advance(&mut self.planner, &mut self.source)? {
                Skipped::NeedsInput => return Ok(Advance::NeedsInput),
                Skipped::Working => return Ok(Advance::Working),
                Skipped::Done => {
                    self.targets.clone_from(&skip.targets);
                    self.fan = skip.fan;
                    self.skip = None;
                }
            }
        }
        for _ in 0..ITEMS_MAX {
            if self.is_done {
                return Ok(Advance::Done);
            }
            while let Some((_, input)) = self.inputs.pop_front_if(|(at, _)| *at == self.place) {
                self.inputs_done += 1;
                self.apply(input);
            }
            if self.inputs.front().is_some_and(|(at, _)| at.items < self.place.items) {
                return Err(differs("its journal does not belong to this file"));
            }
            match self.planner.next(&mut self.source)? {
                Planned::NeedsInput => {
                    let place = Place { drained: Some(self.source.fed()), ..self.place };
                    let is_behind =
                        |(at, _): &(Place, Input)| at.drained.is_some_and(|until| until <= self.source.fed());
                    if place == self.place && self.inputs.front().is_some_and(is_behind) {
                        return Err(differs("its journal does not belong to this file"));
                    }
                    if place == self.place {
                        return Ok(Advance::NeedsInput);
                    }
                    self.place = place;
                }
                item => {
                    self.place = Place { items: self.place.items + 1, drained: None };
                    self.take(item)?;
                }
            }
        }
        Ok(Advance::Working)
    }

    /// What there is to go on with, once it is done.
    pub(crate) fn finish(self) -> Continuation {
        let mut source = self.source;
        // What the user had set last holds, though it had not come into force where the board is.
        let adopted: Vec<Input> =
            self.inputs.iter().map(|(_, input)| *input).filter(|input| *input != Input::FinishRun).collect();
        for &input in &adopted {
            input.apply_factor(&mut source);
        }
        let from = core::array::from_fn(|motor| self.wanted.from[motor].after(&self.queue.motors[motor]));
        let forward = self.motors.each_ref().map(|motor| motor.forward);
        let made = self.motors.each_ref().map(|motor| motor.made);
        Continuation {
            planner: self.planner,
            source,
            place: self.place,
            runs: self.runs,
            inputs: self.inputs_done,
            adopted,
            start: Clock32(self.wanted.start),
            made_until: self.made_until,
            end: self.end,
            position_at_start: self.position_at_start,
            made,
            forward,
            backlog: self.motors.map(|motor| motor.backlog),
            from,
            timeline: self.timeline,
            targets: self.targets,
            fan: self.fan,
            elapsed: self.elapsed,
            id: self.last_id,
            parked: self.parked,
            height: self.height,
            off_mm: self.off_mm,
        }
    }

    fn is_reached(&self) -> bool {
        self.runs == self.wanted.run
    }

    fn apply(&mut self, input: Input) {
        match input {
            Input::FinishRun => {
                self.planner.finish_run();
            }
            Input::Target(heater, celsius) => {
                self.set_target(heater.heater(), Celsius(celsius));
            }
            Input::Fan(speed) => self.fan = speed,
            Input::Speed(_) | Input::Flow(_) => input.apply_factor(&mut self.source),
        }
    }

    fn set_target(&mut self, heater: Heater, target: Celsius) {
        self.targets.retain(|(known, _)| *known != heater);
        self.targets.push((heater, target));
    }

    fn take(&mut self, item: Planned) -> Result<(), PrinterError> {
        match item {
            Planned::RunStarted(position) => {
                self.runs += 1;
                if self.is_reached() {
                    self.position_at_start = position;
                    // Perhaps the board has got nothing of it.
                    self.is_done = self.queue.is_held && self.has_all();
                }
            }
            Planned::Move(planned, pace) if self.is_reached() => {
                self.later(Seconds(planned.end_time()), TimedDue::Move(planned, pace))?;
            }
            Planned::Timed { at, line, action } if self.is_reached() => {
                self.later(at, TimedDue::Action(line, action))?;
            }
            Planned::Timed { action, .. } => self.act(&action),
            Planned::Steps(command) if self.is_reached() => self.row(&command)?,
            Planned::RunEnded(at) if self.runs < self.wanted.run => self.elapsed += at,
            Planned::RunEnded(at) if self.is_reached() => {
                if !self.has_all() {
                    return Err(differs("the board has got more moves than the plan has"));
                }
                self.end = Some(self.clock_ticks(at));
                self.is_done = true;
            }
            Planned::Barrier { barrier, .. } => self.pass(&barrier)?,
            Planned::EndOfSource => return Err(differs("the file ends before the place where the board is")),
            _ => {}
        }
        Ok(())
    }

    /// Passes what the machine had to be at rest for.
    fn pass(&mut self, barrier: &Barrier) -> Result<(), PrinterError> {
        match *barrier {
            Barrier::Home(axes) => {
                for axis in (0..3).filter(|&axis| axes[axis]) {
                    self.planner.set_axis(axis, self.endstops[axis], true);
                }
                self.planner.tell_homed(axes, &mut self.source);
            }
            Barrier::WaitTemperature { heater, target, .. } => self.set_target(heater, target),
            Barrier::MotorsOff(motors) => {
                let motors = self.geometry.coupled(motors);
                (0..3)
                    .filter(|&axis| motors[axis])
                    .for_each(|axis| self.planner.guard.set_homed(axis, false));
            }
            Barrier::Cancel | Barrier::EmergencyStop => {
                return Err(differs("the file ends the print before the place where the board is"));
            }
            Barrier::Dwell(_)
            | Barrier::WaitForMoves
            | Barrier::Pause(_)
            | Barrier::WaitForTemperature { .. } => {}
        }
        Ok(())
    }

    fn act(&mut self, action: &TimedAction) {
        match *action {
            TimedAction::SetTemperature { heater, target } => self.set_target(heater, target),
            TimedAction::TurnOffHeaters => self.targets.clear(),
            TimedAction::Fan { speed, .. } => self.fan = speed,
            _ => {}
        }
    }

    /// Something of the board's run that comes at a time of it; what has certainly come is over.
    fn later(&mut self, at: Seconds, due: TimedDue) -> Result<(), PrinterError> {
        let at = self.clock_ticks(at);
        self.timeline.push_back((at, due));
        while let Some((_, due)) = self.timeline.pop_front_if(|(at, _)| *at <= self.made_until) {
            if let TimedDue::Action(_, action) = due {
                self.act(&action);
            }
        }
        if self.timeline.len() > TIMELINE_MAX {
            return Err(differs("too much is to be done at once"));
        }
        Ok(())
    }

    fn clock_ticks(&self, time: Seconds) -> Ticks {
        self.planner.clock().ticks_in(time)
    }

    /// A row of the board's run: made, received, or neither.
    fn row(&mut self, command: &StepCommand) -> Result<(), PrinterError> {
        let at = command.motor;
        let (base, queue, inverted) = (self.wanted.from[at], self.queue.motors[at], self.inverted[at]);
        let motor = &mut self.motors[at];
        let (interval, count, add) = match command.kind {
            StepCommandKind::SetDir { forward } => {
                motor.forward = forward;
                return Ok(());
            }
            StepCommandKind::QueueStep { interval, count, add } => (interval, count, add),
        };
        let index = motor.rows;
        if !self.queue.is_held && index >= base.done && motor.counted >= queue.received {
            return Err(differs(
                "its motors ran out of steps and stopped where they were, perhaps beside the path",
            ));
        }
        let mut row =
            Row { interval, count, add, forward: motor.forward, start: command.start, end: command.end };
        motor.rows += 1;
        if index < base.done {
            motor.made = motor.made.wrapping_add(row.counted(count));
            self.made_until = self.made_until.max(row.end);
            return Ok(());
        }
        if index == base.done && base.left > 0 {
            row = self.rest_of(at, row, base.left)?;
        }
        let motor = &mut self.motors[at];
        let counted = motor.counted;
        motor.counted += 1;
        if counted < queue.received {
            let dir = row.forward != inverted;
            motor.check.add(row.interval, row.count, row.add, dir);
            if motor.counted == queue.received && motor.check.value() != queue.crc {
                return Err(differs("the board has got other moves than the plan has"));
            }
            if counted == queue.done && queue.left > 0 && queue.dir != dir {
                return Err(differs("the board moves the other way than the plan does"));
            }
        }
        if counted < queue.done {
            motor.made = motor.made.wrapping_add(row.counted(row.count));
            self.made_until = self.made_until.max(row.end);
        } else {
            if counted == queue.done && queue.left > 0 {
                row = self.rest_of(at, row, queue.left)?;
            }
            let backlog = &mut self.motors[at].backlog;
            backlog.push_back(row);
            if backlog.len() > BACKLOG_MAX {
                return Err(differs("the board has got more moves than it can hold"));
            }
        }
        self.is_done = self.queue.is_held && self.has_all();
        Ok(())
    }

    /// The steps of a row that are left.
    fn rest_of(&mut self, at: usize, row: Row, left: u16) -> Result<Row, PrinterError> {
        if left > row.count {
            return Err(differs("the board has other rows of steps than the plan has"));
        }
        let rest = row.tail(left);
        self.motors[at].made = self.motors[at].made.wrapping_add(row.counted(row.count - left));
        self.made_until = self.made_until.max(rest.start);
        Ok(rest)
    }

    /// Whether the plan has everything that the board has.
    fn has_all(&self) -> bool {
        let has = |motor: usize| {
            let (made, base) = (&self.motors[motor], self.wanted.from[motor]);
            // A row of which some steps had been made before is only right without them.
            let first = base.done.saturating_add(u32::from(base.left > 0));
            made.rows >= first && made.counted >= self.queue.motors[motor].received
        };
        (0..MOTORS).all(has)
    }
}
