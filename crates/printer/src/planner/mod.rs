//! From G-code to step commands, with everything that happens between them at its print time.
//!
//! This is the deterministic heart of the product: the same file and machine give the same output natively and in a
//! browser. It pulls from a [`Source`], holds a bounded window, and hands out one [`Planned`] item at a time. It
//! knows no host time and no board clock: times are seconds, and step commands are ticks, from the start of a **run of
//! motion**, which is a stretch that begins and ends at rest.

mod act;
#[cfg(test)]
mod arc_tests;
#[cfg(test)]
mod bound_tests;
mod dynamics;
#[cfg(test)]
mod estimate_tests;
mod estimates;
#[cfg(test)]
mod extrusion_tests;
mod guard;
mod item;
mod judge;
mod level;
#[cfg(test)]
mod level_tests;
mod paces;
mod report;
mod skip;
mod source;
#[cfg(test)]
mod tests;
mod trace;

use std::{collections::VecDeque, sync::Arc};

use gcode::LineNumber;
use motion::{Bend, Bound, Limits, LookAhead, MoveRequest, PlannedMove};
use steps::{Geometry, PushError, StepGenerator};
use units::{Hertz, MmPerS, Seconds, Ticks};

use dynamics::Course;
pub use estimates::{Estimates, FEATURE_NAMES, LayerTotal, MoveEstimate, MoveKind, Total};
pub(crate) use guard::settled;
pub use guard::{ExtrusionPermit, Guard};
pub use item::{Barrier, Planned, Position, TimedAction};
use paces::Paces;
pub use report::{MotorReport, PLAN_CLOCK, PlanOptions, PlanReport, PlanSink, PlanStream, Ramps};
pub(crate) use skip::{Skip, Skipped};
pub(crate) use source::Next;
pub use source::{SOURCE_BYTES_MAX, Source};
use trace::Trace;
pub use trace::TraceSample;

pub use crate::pace::Pace;

use crate::{
    arcs,
    config::{PrinterConfig, UnreachableSpeed},
    error::{ErrorCode, PrinterError},
    machine::{self, EXTRUDER},
    step_rate::StepRates,
    transform::{Profiles, Transform},
};

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
    /// How many moves come before it …
    after: u64,
    /// … and the dwell, if there is one, until this print time.
    not_before: Seconds,
    line: LineNumber,
    action: TimedAction,
}

/// What is said of a source once, however often it asks for it.
#[derive(Clone, Copy, Debug, Default)]
struct Said {
    other_fans: bool,
    slowed: bool,
    clamped: bool,
}

/// Turns G-code into step commands.
#[derive(Debug)]
pub struct Planner {
    /// What the machine allows.
    pub guard: Guard,
    machine_limits: Limits,
    limits: Limits,
    look_ahead: LookAhead,
    generator: StepGenerator<Geometry>,
    position: Position,
    clock: Hertz,
    run: Run,
    moves_pushed: u64,
    moves_planned: u64,
    paces: Paces,
    /// Print time at which the last planned move ends.
    planned_until: Seconds,
    /// Print time at which the last dwell of this run ends.
    dwelt_until: Seconds,
    deferred: VecDeque<Deferred>,
    ready: VecDeque<Planned>,
    barrier: Option<(LineNumber, Barrier)>,
    said: Said,
    course: Course,
    /// From the G-code's coordinates to the machine's, for the moves that are read from now on …
    transform: Transform,
    /// … and what can be loaded.
    profiles: Arc<Profiles>,
    step_rates: StepRates,
    unreachable_speed: UnreachableSpeed,
    is_broken: bool,
    /// All axes are homed together.
    homes_together: bool,
    /// What the plan is held against, where somebody wants to know.
    bound: Option<Box<Bound>>,
    /// Where somebody wants to see the axes' paths.
    trace: Option<Box<Trace>>,
}

impl Planner {
    /// A planner for a machine and a board's clock. No axis is homed, and the machine stands at 0, 0, 0.
    pub fn new(config: &PrinterConfig, clock: Hertz) -> Result<Self, PrinterError> {
        let limits = machine::limits(config);
        let look_ahead = LookAhead::with_profile(limits, machine::profile(config))
            .map_err(|error| PrinterError::new(ErrorCode::ConfigInvalid, error.to_string()))?;
        Ok(Self {
            guard: Guard::new(config),
            machine_limits: limits,
            look_ahead,
            limits,
            generator: machine::step_generator(config, clock, machine::STEP_ERROR_MAX)?,
            position: [0.0; 4],
            clock,
            run: Run::None,
            moves_pushed: 0,
            moves_planned: 0,
            paces: Paces::default(),
            planned_until: Seconds::ZERO,
            dwelt_until: Seconds::ZERO,
            deferred: VecDeque::new(),
            ready: VecDeque::new(),
            barrier: None,
            said: Said::default(),
            course: Course::new(config),
            transform: Transform::default(),
            profiles: Arc::clone(&config.profiles),
            step_rates: StepRates::new(config, clock),
            unreachable_speed: config.printer.unreachable_speed,
            is_broken: false,
            homes_together: machine::homed_together(config, [true, false, false]) == [true; 3],
            bound: None,
            trace: None,
        })
    }

    /// Works out the least time that the motion could take, beside the plan.
    fn bound(&mut self, config: &PrinterConfig) {
        self.bound = Some(Box::new(Bound::new(config.abilities.to_vec())));
    }

    /// Where the last accepted move ends, in machine coordinates.
    pub const fn position(&self) -> Position {
        self.position
    }

    /// The clock in whose ticks step commands are.
    pub const fn clock(&self) -> Hertz {
        self.clock
    }

    /// Whether there is no run of motion.
    pub fn is_at_rest(&self) -> bool {
        self.run == Run::None
    }

    /// Print time up to which moves have been planned in this run.
    pub const fn planned_until(&self) -> Seconds {
        self.planned_until
    }

    /// Run clock up to which step commands have been handed out; `None` once all of the run's have been.
    pub fn generated_until(&self) -> Option<Ticks> {
        Some(self.generator.settled()).filter(|&settled| settled != Ticks(u64::MAX))
    }

    /// What the step generator counted so far.
    pub fn generator(&self) -> &StepGenerator<Geometry> {
        &self.generator
    }

    /// Says where an axis is, at rest.
    pub fn set_axis(&mut self, axis: usize, position_mm: f64, homed: bool) {
        debug_assert!(self.is_at_rest(), "an axis is only set at rest");
        self.position[axis] = position_mm;
        self.guard.set_homed(axis, homed);
    }

    /// Says where the machine stands, at rest. What is homed stays so.
    pub fn stand_at(&mut self, position: Position) {
        debug_assert!(self.is_at_rest(), "a position is only set at rest");
        self.position = position;
    }

    /// As [`Self::adopt`], for a job, whose plan is to depend on nothing that was done before: the machine file's limits
    /// hold again, and the filament counts from 0. What makes up for skew and bed stays in force. At rest.
    pub fn begin_job(&mut self, source: &mut Source) {
        debug_assert!(self.is_at_rest(), "a job begins at rest");
        self.position[EXTRUDER] = 0.0;
        self.limits = self.machine_limits;
        self.course.begin_job();
        self.step_rates.set_advance(self.course.read().effective_advance().slope_max());
        // They have been checked when the planner was made.
        let _ = self.look_ahead.set_limits(self.limits);
        self.adopt(source);
    }

    /// A move could not be turned into steps, so that the run cannot be brought to rest: everything has to stop.
    pub const fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// The axes that are homed where a line wants these to be.
    pub(crate) fn homed_together(&self, axes: [bool; 3]) -> [bool; 3] {
        if self.homes_together && axes.contains(&true) { [true; 3] } else { axes }
    }

    /// Lets the machine come to rest after the moves that were read; [`Planned::RunEnded`] tells when. Whether that
    /// changed anything.
    pub fn finish_run(&mut self) -> bool {
        let is_active = self.run == Run::Active;
        if is_active {
            self.look_ahead.flush();
            self.bound.iter_mut().for_each(|bound| bound.stop());
            self.run = Run::Ending;
        }
        is_active
    }

    /// Forgets a barrier that has been read and not been reached.
    pub fn drop_barrier(&mut self) {
        self.barrier = None;
    }

    /// Takes a barrier that has been read and not been reached, to be [put back](Self::put_barrier).
    pub fn take_barrier(&mut self) -> Option<(LineNumber, Barrier)> {
        self.barrier.take()
    }

    /// Puts a barrier back, before anything else is read.
    pub fn put_barrier(&mut self, barrier: Option<(LineNumber, Barrier)>) {
        self.barrier = barrier;
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
        self.paces.clear();
        self.run = Run::None;
    }

    /// A single straight move outside any source, not judged by the guard: homing, and going back after a pause.
    pub fn push_raw_move(
        &mut self,
        to: Position,
        feed: MmPerS,
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        self.push(to, None, feed, line, Pace::default())
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
            let Some(item) = self.go_on(source)? else { continue };
            return Ok(item);
        }
    }

    /// What comes before there can be more steps, or the next item. Out of the way of steps, which most items are.
    #[inline(never)]
    fn go_on(&mut self, source: &mut Source) -> Result<Option<Planned>, PrinterError> {
        if let Some(planned) = self.look_ahead.pop() {
            return self.take_planned(planned).map(|()| None);
        }
        match self.run {
            Run::Ending => {
                self.generator.end_run().map_err(|error| self.unsteppable(error, None))?;
                self.trace_paths();
                self.run = Run::Draining;
                return Ok(None);
            }
            Run::Draining => {
                let still = self.planned_until + self.generator.tail();
                (self.planned_until, self.run) = (self.look_ahead.print_time().max(still), Run::None);
                return Ok(Some(Planned::RunEnded(self.planned_until)));
            }
            Run::Active | Run::None => {}
        }
        if let Some((line, barrier)) = self.barrier.take() {
            if self.run == Run::None {
                return Ok(Some(Planned::Barrier { line, barrier }));
            }
            self.barrier = Some((line, barrier));
            self.finish_run();
        } else if let Some(piece) = source.next_piece() {
            self.push_piece(&piece, source)?;
        } else if let Some(piece) = source.next_arc_piece() {
            self.judge_and_push(&piece.chord, Some(&arcs::bend(&piece)), source)?;
        } else {
            match source.next() {
                source::Next::Action(action) => self.act(action, source)?,
                source::Next::Diagnostic(diagnostic) => return Ok(Some(Planned::Notice(diagnostic))),
                source::Next::NeedsInput => return Ok(Some(Planned::NeedsInput)),
                source::Next::End if self.run == Run::None => return Ok(Some(Planned::EndOfSource)),
                source::Next::End => drop(self.finish_run()),
            }
        }
        Ok(None)
    }

    fn push(
        &mut self,
        to: Position,
        bend: Option<&Bend>,
        feed: MmPerS,
        line: LineNumber,
        pace: Pace,
    ) -> Result<(), PrinterError> {
        let to = settled(self.position, to);
        if to == self.position {
            return Ok(());
        }
        let bend = bend.filter(|_| to[..EXTRUDER] != self.position[..EXTRUDER]);
        for end in arcs::straight_ends(self.position, to, bend) {
            self.step_rates.judge_request(self.position, end, feed, &self.limits, line)?;
        }
        if self.run == Run::None {
            self.look_ahead.begin_run();
            self.course.begin_run(&mut self.generator);
            self.generator.begin_run(self.position).map_err(|error| wrong(&error).at_line(line.0))?;
            // Filters move an axis before its move.
            self.look_ahead.dwell(self.generator.lead());
            self.planned_until = Seconds::ZERO;
            self.dwelt_until = Seconds::ZERO;
            self.run = Run::Active;
            self.ready.push_back(Planned::RunStarted(self.position));
        }
        let before = self.look_ahead.len();
        let request = MoveRequest { from: self.position, to, feed, tag: line.0 };
        self.look_ahead.push_along(&request, bend).map_err(|error| wrong(&error).at_line(line.0))?;
        // The look-ahead drops moves without length: the machine is where its plan ends.
        let pushed = (self.look_ahead.len() - before) as u64;
        if pushed > 0 {
            self.paces.push(self.moves_pushed, pace);
            self.position = to;
        }
        self.moves_pushed += pushed;
        if let Some(bound) = &mut self.bound {
            bound.push_along(&request, bend, &self.limits);
        }
        Ok(())
    }

    /// A planned move has no steps: everything has to stop.
    fn unsteppable(&mut self, error: PushError, line: Option<u32>) -> PrinterError {
        self.is_broken = true;
        let code = match error {
            PushError::StepRate { .. } => ErrorCode::StepRateTooHigh,
            _ => ErrorCode::Internal,
        };
        let error = PrinterError::new(code, error.to_string());
        if let Some(line) = line { error.at_line(line) } else { error }
    }

    fn take_planned(&mut self, planned: PlannedMove) -> Result<(), PrinterError> {
        if let Err(error) = self.step_rates.judge_planned(&planned) {
            self.is_broken = true;
            return Err(error);
        }
        self.generator.push(&planned).map_err(|error| self.unsteppable(error, Some(planned.tag)))?;
        self.trace_paths();
        self.planned_until = Seconds(planned.end_time());
        let pace = self.paces.take(self.moves_planned);
        self.moves_planned += 1;
        self.course.planned(self.moves_planned, &mut self.generator);
        self.ready.push_back(Planned::Move(planned, pace));
        while let Some(deferred) = self.deferred.pop_front_if(|deferred| deferred.after <= self.moves_planned)
        {
            let Deferred { line, action, not_before, .. } = deferred;
            let at = self.planned_until.max(not_before);
            self.ready.push_back(Planned::Timed { at, line, action });
        }
        Ok(())
    }
}

/// A move that cannot be planned: without a usable speed, or too far to be counted.
fn wrong(error: &dyn core::error::Error) -> PrinterError {
    PrinterError::new(ErrorCode::InvalidGcode, error.to_string())
}
