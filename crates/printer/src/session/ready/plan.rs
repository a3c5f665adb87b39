//! From the planner to the board: items of the plan, one after the other, as far ahead as the stream wants them.

use gcode::{Heater as HeaterName, LineNumber, Severity};
use motion::PlannedMove;
use units::{Celsius, Seconds};

use super::{Failure, Ready, Wait};
use crate::{
    error::{ErrorCode, PrinterError},
    journal::{Input, MovedBy},
    planner::{Barrier, ExtrusionPermit, Pace, Planned, TimedAction},
    session::{
        event::{Event, ScheduledMove, SpeedProfile},
        job::{Job, JobState},
        stream::{Due, Run},
    },
};

/// The most items of the plan that are handled in one go, so that one call stays short.
const PLAN_ITEMS_MAX: usize = 4096;

impl Ready {
    /// Takes from the planner what is to be sent.
    pub(super) fn pump(&mut self, now: Seconds) -> Result<(), Failure> {
        if self.skips() {
            self.skip(now);
            return Ok(());
        }
        if self.plans_nothing() {
            return Ok(());
        }
        self.planner.guard.extrusion = self.extrusion_permit();
        for _ in 0..PLAN_ITEMS_MAX {
            let clock_now = self.board.motion_at(now);
            if !self.stream.wants_more(self.planner.generated_until(), clock_now, &self.board) {
                return Ok(());
            }
            // A run that has been planned is first made to its end.
            let run_planned = self.planner.is_at_rest() && self.stream.run().is_some();
            let homing = matches!(self.wait, Wait::Homing { .. });
            // Nor is there a place on the clock for a new one while motion is held.
            let may_start = self.stream.run().is_some() || self.board.motion.is_steady();
            if !may_start || run_planned || !(homing || matches!(self.wait, Wait::Nothing)) {
                return Ok(());
            }
            let stopping = self.job.as_ref().is_some_and(|job| {
                matches!(
                    job.state,
                    JobState::Pausing
                        | JobState::Parking
                        | JobState::Returning
                        | JobState::Cancelling
                        | JobState::Failing(_)
                )
            });
            if stopping && !homing {
                self.finish_run();
            }
            let is_jobs = !homing && self.plans_job();
            let fed = self.job.as_ref().map_or(0, |job| job.source.fed());
            let source = match &mut self.job {
                _ if homing || stopping => &mut self.silence,
                Some(job) if job.is_active() => &mut job.source,
                _ => &mut self.console.source,
            };
            let planned = match self.planner.next(source) {
                Ok(planned) => {
                    // What comes to rest reads nothing.
                    if is_jobs && !(stopping && planned == Planned::NeedsInput) {
                        self.diary.planned(&planned, fed);
                    }
                    planned
                }
                Err(error) if self.planner.is_broken() => return Err(Failure::Stop(error)),
                Err(error) => {
                    self.source_failed(error, now);
                    continue;
                }
            };
            if !self.take(planned, now)? {
                return Ok(());
            }
        }
        Ok(())
    }

    pub(super) fn extrusion_permit(&self) -> ExtrusionPermit {
        match self.thermal.heater(HeaterName::Tool(0)) {
            Some(heater) if !heater.can_extrude() => {
                ExtrusionPermit::TooCold { celsius: heater.temperature().unwrap_or_default().0 }
            }
            _ => ExtrusionPermit::Allowed,
        }
    }

    /// Handles one item of the plan; `false` when there is nothing more for now.
    pub(super) fn take(&mut self, planned: Planned, now: Seconds) -> Result<bool, Failure> {
        if planned != Planned::NeedsInput {
            self.last_active = now;
        }
        self.note(&planned);
        match planned {
            Planned::RunStarted(position) => {
                let homing = matches!(self.wait, Wait::Homing { .. });
                let run = self.stream.start_run(position, &self.board, now, homing);
                self.lease.forget();
                self.calls.run_planned();
                if !homing && self.plans_job() {
                    self.note_height(position[2], MovedBy::File);
                    self.diary.run(run.start, &mut self.board);
                } else if homing {
                    self.diary.lose_place(&mut self.board);
                } else {
                    self.note_height(position[2], MovedBy::Others);
                    self.diary.other_run(&mut self.board);
                }
                if let Wait::Homing { axis, .. } = &mut self.wait {
                    let start = self.board.hardware_of(run.start, now);
                    axis.run_started(start, &mut self.board, now);
                }
                self.events.push(Event::RunStarted { at: run.start, position });
            }
            Planned::Move(planned, pace) => {
                let Some(run) = self.stream.run() else { return Ok(true) };
                self.schedule_move(&planned, pace, run);
            }
            Planned::Steps(command) => self.stream.push(&command, &mut self.board, now),
            Planned::Timed { at, line, action } => self.on_timed(at, line, action, now),
            Planned::RunEnded(at) => {
                if let Some(run) = self.stream.run() {
                    let end = run.start + self.board.ticks(at);
                    self.stream.end_run(end);
                    if let Wait::Homing { axis, .. } = &mut self.wait {
                        axis.run_planned(self.board.hardware_of(end, now));
                    }
                    self.events.push(Event::RunEnded { at: end });
                }
            }
            Planned::Barrier { line, barrier } => return self.on_barrier(line, &barrier, now),
            Planned::Notice(diagnostic) => self.on_notice(diagnostic, now),
            Planned::NeedsInput => return Ok(self.on_drained(now)),
            Planned::EndOfSource if self.board.said_after < self.rested => {
                self.wait = Wait::Word(None);
                return Ok(false);
            }
            Planned::EndOfSource => self.finish_job(now),
        }
        Ok(true)
    }

    /// A move has its place on the motion clock.
    pub(super) fn schedule_move(&mut self, planned: &PlannedMove, pace: Pace, run: Run) {
        let scheduled = self.scheduled(planned, run);
        self.stream.schedule(scheduled.end, Due::MoveEnd(scheduled, pace));
        self.events.push(Event::Move(scheduled));
    }

    /// Where a move has its place.
    pub(super) fn scheduled(&self, planned: &PlannedMove, run: Run) -> ScheduledMove {
        let at = |time: f64| run.start + self.board.ticks(Seconds(time));
        ScheduledMove {
            line: planned.tag,
            start: at(planned.start_time),
            end: at(planned.end_time()),
            from: planned.from,
            to: planned.to,
            speed: SpeedProfile::new(planned, at),
            homing: run.homing,
        }
    }

    /// Has the journal know that Z stands there, and who moves it from here on.
    pub(in crate::session) fn note_height(&mut self, z: f64, by: MovedBy) {
        const Z: usize = 2;
        let is_inverted = self.board.layout.steppers[Z].is_some_and(|oids| oids.invert_dir);
        let count = self.stream.count(Z);
        let count = if is_inverted { count.wrapping_neg() } else { count };
        let step_mm = self.config.steppers[Z].step_distance().0;
        let by = if self.planner.guard.homed()[Z] { by } else { MovedBy::Others };
        self.diary.height(z, count, by, step_mm);
    }

    /// Notes what a job leaves behind.
    fn note(&mut self, planned: &Planned) {
        let Some(job) = self.active_job() else { return };
        let target = match planned {
            Planned::Move(planned, _) => {
                job.has_moved |= planned.tag > 0;
                return;
            }
            Planned::Timed { action: TimedAction::SetTemperature { heater, target }, .. }
            | Planned::Barrier { barrier: Barrier::WaitTemperature { heater, target, .. }, .. }
                if *heater == HeaterName::Tool(0) =>
            {
                *target
            }
            Planned::Timed { action: TimedAction::TurnOffHeaters, .. } => Celsius::ZERO,
            _ => return,
        };
        job.leaves_hot = target > Celsius::ZERO;
    }

    fn on_timed(&mut self, at: Seconds, line: LineNumber, action: TimedAction, now: Seconds) {
        let Some(run) = self.stream.run() else {
            self.act(line, action, now);
            return;
        };
        if !self.is_allowed(&action) {
            return;
        }
        let clock = run.start + self.board.ticks(at);
        match action {
            // The board itself does it at that clock, once it is near.
            TimedAction::Fan { speed, .. } => {
                self.stream.kept.push_fan(clock, speed);
                if !self.plans_job() {
                    self.diary.input(Input::Fan(speed));
                }
            }
            action => self.stream.schedule(clock, Due::Action(line, action)),
        }
    }

    pub(super) fn on_notice(&mut self, diagnostic: gcode::Diagnostic, now: Seconds) {
        let line = diagnostic.line.0;
        let confirmed = self.active_job().is_some_and(|job| job.is_confirmed(line));
        let code = match diagnostic.severity {
            Severity::Error => Some(ErrorCode::InvalidGcode),
            Severity::Blocking if !confirmed => Some(ErrorCode::UnknownCommand),
            Severity::Blocking | Severity::Warning | Severity::Info => None,
        };
        match code {
            Some(code) => self.source_failed(PrinterError::new(code, diagnostic.message).at_line(line), now),
            None => self.events.push(Event::Notice(diagnostic)),
        }
    }

    /// The source has nothing more at hand; `true` when the planner should be asked again all the same.
    pub(super) fn on_drained(&mut self, now: Seconds) -> bool {
        let clock_now = self.board.motion_at(now);
        let printing = self.job.as_ref().is_some_and(|job| job.state == JobState::Printing);
        let homing = matches!(self.wait, Wait::Homing { .. });
        let is_typed = !homing && !self.job.as_ref().is_some_and(Job::is_active);
        if is_typed && self.console.advance() {
            return true;
        }
        let planned_until = self.planner.planned_until();
        if self.planner.is_at_rest()
            || printing && !homing && !self.stream.is_starving(planned_until, clock_now, &self.board)
        {
            return false;
        }
        self.finish_run();
        true
    }

    /// Whether the planner plans the job, and nothing that is done meanwhile.
    pub(super) fn plans_job(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.paused.is_none())
    }

    /// Has the machine come to rest after what has been read.
    fn finish_run(&mut self) {
        let homing = matches!(self.wait, Wait::Homing { .. });
        if self.planner.finish_run() && !homing && self.plans_job() {
            self.diary.input(Input::FinishRun);
        }
    }
}
