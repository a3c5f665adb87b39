//! Homing: an axis runs towards its endstop until the board itself sees it and stops the motor, backs off, and does it
//! again more slowly. The position comes from where the motor stopped, never from the plan. Motors that move an axis together
//! stop together; a delta's towers run upwards together, and each stops at its own endstop.
//!
//! The board's trigger fires by itself when the host falls silent, so a lost link stops the axis. Where that was but a
//! bad moment of the line, the axis goes on from where it stands, a few times: no further altogether than one approach goes.

use units::{Seconds, Ticks};
use wire::Command;

use super::board::Board;
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine::{self, MOTORS, Motors},
    reach::AXES,
};
pub(super) use parts::{HomingMove, Standing, Wish};
use parts::{Mover, Stage, Stop};

mod parts;

/// The reasons with which a trigger may fire.
const REASON_ENDSTOP: u8 = 1;
const REASON_HOST: u8 = 2;
const REASON_EXPIRED: u8 = 4;

/// Without word from the host for this long, the board stops the axis.
const EXPIRE: Seconds = Seconds(0.5);
/// How often the host says that it is there.
const KEEP_ALIVE: Seconds = Seconds(0.1);
/// How often the board reports the trigger's state.
const REPORT: Seconds = Seconds(0.1);
/// Without a report for this long, the host asks.
const REPORT_SILENCE: Seconds = Seconds(0.35);
/// Questions that are not answered are asked again after this long.
const ASK_AGAIN: Seconds = Seconds(0.15);
/// Without an answer for this long, homing fails.
const ANSWER_MAX: Seconds = Seconds(3.0);
/// The time between the samples that have to agree.
const SAMPLE: Seconds = Seconds(15e-6);
/// How many samples have to agree.
const SAMPLES: u8 = 4;
/// The axis is taken to be this many travels away from its endstop at most.
const TRAVEL_FACTOR: f64 = 1.5;
/// The second approach starts this many retractions away at most.
const SECOND_TRAVEL_FACTOR: f64 = 2.0;
/// How often an approach is begun at most: it goes on when the board stopped it for want of a word from the host.
const TRIES_MAX: u8 = 3;
/// But not where host and board were apart for this long: by then nobody expects that anything moves.
const APART_MAX: Seconds = Seconds(2.0);

/// Why the board stopped an axis by itself.
const NOT_HEARD: &str = "the board heard nothing from the host";

/// One axis on its way home, or all those that are homed together.
#[derive(Debug)]
pub(super) struct AxisHoming {
    pub(super) axis: usize,
    /// Those whose position is known once it is home, and where they are then, in mm.
    pub(super) axes: [bool; 3],
    pub(super) home_mm: [f64; 3],
    stops: Vec<Stop>,
    movers: Vec<Mover>,
    motors: Motors,
    standing: Standing,
    stage: Stage,
    second: bool,
    cancelled: bool,
    /// When the question of the present stage was first and last asked.
    asked: Option<(Seconds, Seconds)>,
    abandon: bool,
    /// The board stopped the approach because it heard nothing; to be told once it goes on.
    expired: bool,
    goes_on: bool,
    /// Host and board have been apart for long in the present approach.
    apart: bool,
    /// How often the present approach has been begun.
    tries: u8,
    retract_mm: f64,
    travel_mm: f64,
    /// +1 where the endstop is at the high end.
    sign: f64,
    speeds: [units::MmPerS; 2],
}

impl AxisHoming {
    pub(super) fn new(
        axis: usize,
        config: &PrinterConfig,
        board: &Board,
        standing: Standing,
    ) -> Option<Self> {
        let axes = machine::homed_together(config, core::array::from_fn(|it| it == axis));
        // Towers that are homed together all move as Z does.
        let axis = if axes == [true; 3] { 2 } else { axis };
        let (stops, movers) = parts::parts(axis, config, board)?;
        let stepper = &config.steppers[axis];
        Some(Self {
            axis,
            axes,
            home_mm: config.steppers.each_ref().map(|stepper| stepper.position_endstop.0),
            stops,
            movers,
            motors: Motors::new(config),
            standing,
            stage: Stage::PositionBefore,
            second: false,
            cancelled: false,
            asked: None,
            abandon: false,
            expired: false,
            goes_on: false,
            apart: false,
            tries: 0,
            retract_mm: stepper.homing_retract_dist.0,
            travel_mm: TRAVEL_FACTOR * parts::length_mm(axis, config),
            sign: if stepper.homing_positive_dir { 1.0 } else { -1.0 },
            speeds: [stepper.homing_speed, stepper.second_homing_speed],
        })
    }

    /// Where the axis is once it is home, in mm.
    pub(super) const fn position_mm(&self) -> f64 {
        self.home_mm[self.axis]
    }

    /// How far the other axes are from where the planner has them, in mm.
    pub(super) const fn off_mm(&self) -> [f64; 3] {
        self.standing.off_mm
    }

    /// Steps that each motor has made in both approaches, as the board counted them.
    pub(super) fn steps(&self) -> [u64; MOTORS] {
        let of = |motor: usize| self.movers.iter().find(|mover| mover.motor == motor);
        core::array::from_fn(|motor| of(motor).map_or(0, |mover| mover.steps))
    }

    /// The shortest step of any motor that moves.
    fn step_mm(&self) -> f64 {
        self.movers.iter().map(|mover| mover.step_mm).fold(f64::INFINITY, f64::min)
    }

    /// How far the present approach may still go, in mm: however often it is begun, no further than one approach goes.
    fn travel_left_mm(&self) -> f64 {
        let travel = if self.second { SECOND_TRAVEL_FACTOR * self.retract_mm } else { self.travel_mm };
        let made = self.movers.iter().map(|mover| mover.approach_steps as f64 * mover.step_mm);
        travel - made.fold(0.0, f64::max)
    }

    /// The axis is to stop.
    pub(super) fn cancel(&mut self) {
        self.cancelled = true;
        self.asked = None;
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.asked = None;
        self.movers.iter_mut().for_each(|mover| mover.has_answered = false);
    }

    fn fail(&self, code: ErrorCode, detail: &str) -> PrinterError {
        let axis = if self.axes == [true; 3] { "the towers" } else { AXES[self.axis] };
        PrinterError::new(code, if detail.is_empty() { axis.to_owned() } else { format!("{axis}, {detail}") })
    }

    /// Asks, and asks again; fails when nobody answers.
    fn ask(
        &mut self,
        questions: impl IntoIterator<Item = Command<'static>>,
        board: &mut Board,
        now: Seconds,
    ) -> Result<(), PrinterError> {
        let (first, last) = self.asked.unwrap_or((now, now));
        if self.asked.is_none() || now - last >= ASK_AGAIN {
            questions.into_iter().for_each(|question| board.control(&question));
            self.asked = Some((first, now));
        }
        if now - first > ANSWER_MAX {
            return Err(self.fail(ErrorCode::HomingTimeout, "the board does not answer"));
        }
        Ok(())
    }

    /// Does what is due. `run_end` is the end of the run of motion that is being made, `at_rest` that there is none.
    pub(super) fn poll(
        &mut self,
        board: &mut Board,
        now: Seconds,
        at_rest: bool,
    ) -> Result<Wish, PrinterError> {
        if core::mem::take(&mut self.abandon) {
            return Ok(Wish::Abandon);
        }
        if self.cancelled && self.stands(at_rest) {
            return Ok(Wish::Cancelled);
        }
        if core::mem::take(&mut self.goes_on) {
            return Ok(Wish::GoesOn);
        }
        match self.stage {
            Stage::PositionBefore | Stage::PositionAfter => {
                let unknown = self.movers.iter().filter(|mover| !mover.has_answered);
                let questions: Vec<_> =
                    unknown.map(|mover| Command::StepperGetPosition { oid: mover.oid }).collect();
                self.ask(questions, board, now)?;
                Ok(Wish::Wait)
            }
            Stage::Plan => {
                let from_mm = self.position_mm() - self.sign * self.travel_left_mm();
                let speed = self.speeds[usize::from(self.second)];
                Ok(Wish::Move(HomingMove { from_mm, to_mm: self.position_mm(), speed }))
            }
            Stage::Approach { .. } => self.watch(board, now),
            Stage::PlanRetract => {
                let to_mm = self.position_mm() - self.sign * self.retract_mm;
                let from_mm = self.position_mm();
                Ok(Wish::Move(HomingMove { from_mm, to_mm, speed: self.speeds[0] }))
            }
            Stage::Retract => {
                if at_rest {
                    self.enter(Stage::Released);
                }
                Ok(Wish::Wait)
            }
            Stage::Released => {
                let closed = self.stops.iter().filter(|stop| !stop.is_released);
                let questions: Vec<_> =
                    closed.map(|stop| Command::EndstopQueryState { oid: stop.oids.endstop.0 }).collect();
                self.ask(questions, board, now)?;
                Ok(Wish::Wait)
            }
            Stage::PlanStraight(missing) => Ok(Wish::Straighten(missing)),
            Stage::Straight => {
                if at_rest {
                    self.enter(Stage::Done);
                }
                Ok(Wish::Wait)
            }
            Stage::Done => Ok(Wish::Done),
        }
    }

    /// Whether nothing moves and nothing is about to.
    fn stands(&self, at_rest: bool) -> bool {
        match self.stage {
            Stage::PositionBefore | Stage::PositionAfter | Stage::Released => true,
            // Its move may be on the way to the stream.
            Stage::Plan | Stage::PlanRetract | Stage::Retract | Stage::PlanStraight(_) | Stage::Straight => {
                at_rest
            }
            Stage::Approach { .. } | Stage::Done => false,
        }
    }

    /// Its move has become a run that starts at this clock: the trigger is armed before the first step.
    pub(super) fn run_started(&mut self, start: Ticks, board: &mut Board, now: Seconds) {
        match self.stage {
            Stage::PlanRetract => return self.enter(Stage::Retract),
            Stage::PlanStraight(_) => return self.enter(Stage::Straight),
            _ => {}
        }
        // Between steps there is nothing new to see.
        let rest = Seconds(self.step_mm() / self.speeds[usize::from(self.second)].0);
        for index in 0..self.stops.len() {
            self.stops[index] =
                Stop { has_fired: false, heard: now, is_released: false, ..self.stops[index] };
            self.stops[index].arm(index, &self.movers, start, rest, board);
        }
        self.tries += 1;
        self.apart = false;
        self.enter(Stage::Approach { start, end: None, kept_alive: now });
    }

    /// The approach has been planned to its end.
    pub(super) fn run_planned(&mut self, at: Ticks) {
        if let Stage::Approach { end, .. } = &mut self.stage {
            *end = Some(at);
        }
    }

    /// The switches that have not closed yet.
    fn armed(&self) -> impl Iterator<Item = &Stop> {
        self.stops.iter().filter(|stop| !stop.has_fired)
    }

    /// Where they were apart for too long, an approach that the board has stopped does not go on.
    fn note_apart(&mut self, now: Seconds) {
        if let Stage::Approach { kept_alive, .. } = self.stage {
            let silent = self.armed().any(|stop| now - stop.heard > APART_MAX);
            self.apart |= now - kept_alive > APART_MAX || silent;
        }
    }

    fn watch(&mut self, board: &mut Board, now: Seconds) -> Result<Wish, PrinterError> {
        self.note_apart(now);
        let Stage::Approach { start, end, kept_alive } = &mut self.stage else {
            return Ok(Wish::Wait);
        };
        let clock_now = board.clock_at(now);
        let (start, end) = (*start, *end);
        if now - *kept_alive >= KEEP_ALIVE {
            *kept_alive = now;
            // Never before the axis moves: a stepper that is stopped first would start all the same.
            let clock = (clock_now.max(start) + board.ticks(EXPIRE)).low().0;
            for stop in self.armed() {
                board.control(&Command::TrsyncSetTimeout { oid: stop.oids.trsync.0, clock });
            }
        }
        let overdue = end.is_some_and(|end| clock_now > end + board.ticks(REPORT));
        // Where one motor has stopped for want of a word, the others do not go on alone. Not before the steps have begun: a stepper that is stopped first would start with them all the same.
        let stop_wanted = (self.cancelled || self.expired) && clock_now > start + board.ticks(REPORT);
        if overdue || stop_wanted {
            // Answered with the reason that it fired for first, should it have fired already.
            let stop = |stop: &Stop| Command::TrsyncTrigger { oid: stop.oids.trsync.0, reason: REASON_HOST };
            let questions: Vec<_> = self.armed().map(stop).collect();
            self.ask(questions, board, now)?;
        } else if self.armed().any(|stop| now - stop.heard > REPORT_SILENCE) {
            // Its answer says whether the approach is still on, without ending it.
            let silent = self.armed().filter(|stop| now - stop.heard > REPORT_SILENCE);
            let questions: Vec<_> =
                silent.map(|stop| Command::EndstopQueryState { oid: stop.oids.endstop.0 }).collect();
            self.ask(questions, board, now)?;
        }
        Ok(Wish::Wait)
    }

    /// The board reports the trigger.
    pub(super) fn on_trigger(
        &mut self,
        oid: u8,
        can_trigger: bool,
        reason: u8,
        now: Seconds,
        board: &mut Board,
    ) -> Result<(), PrinterError> {
        self.note_apart(now);
        if !matches!(self.stage, Stage::Approach { .. }) {
            return Ok(());
        }
        let Some(stop) = self.stops.iter_mut().find(|stop| stop.oids.trsync.0 == oid) else { return Ok(()) };
        if stop.has_fired {
            return Ok(());
        }
        if can_trigger {
            stop.heard = now;
            self.asked = self.asked.filter(|_| self.cancelled || self.expired);
            return Ok(());
        }
        match reason {
            REASON_ENDSTOP => {}
            _ if self.cancelled => {}
            REASON_EXPIRED if self.tries < TRIES_MAX && !self.apart => {
                self.expired = true;
                self.asked = None;
            }
            REASON_EXPIRED => return Err(self.fail(ErrorCode::HomingTimeout, NOT_HEARD)),
            // Told to stop, because another one has.
            _ if self.expired => {}
            _ => return Err(self.fail(ErrorCode::EndstopNotReached, "")),
        }
        stop.has_fired = true;
        if self.armed().next().is_none() {
            self.stopped(board);
        }
        Ok(())
    }

    /// It has failed: whatever still moves is stopped.
    pub(super) fn stop_all(&self, board: &mut Board) {
        if matches!(self.stage, Stage::Approach { .. }) {
            self.armed().for_each(|stop| stop.trigger(board));
        }
    }

    /// Every motor has been stopped.
    fn stopped(&mut self, board: &mut Board) {
        self.stops.iter().for_each(|stop| stop.disarm(board));
        self.abandon = true;
        self.enter(Stage::PositionAfter);
    }

    /// Begins an approach that the time-out has ended once more, from where the motors stand.
    fn go_on(&mut self, now: Seconds) -> Result<(), PrinterError> {
        if self.asked.is_some_and(|(first, _)| now - first > APART_MAX) {
            return Err(self.fail(ErrorCode::HomingTimeout, NOT_HEARD));
        }
        if self.travel_left_mm() < self.step_mm() {
            return Err(self.fail(ErrorCode::EndstopNotReached, ""));
        }
        self.goes_on = true;
        self.enter(Stage::Plan);
        Ok(())
    }

    /// The board reports the state of a switch.
    pub(super) fn on_endstop(
        &mut self,
        oid: u8,
        homing: bool,
        pin_value: bool,
        now: Seconds,
        board: &mut Board,
    ) -> Result<(), PrinterError> {
        let Some(index) = self.stops.iter().position(|stop| stop.oids.endstop.0 == oid) else {
            return Ok(());
        };
        let stop = &mut self.stops[index];
        match &self.stage {
            Stage::Approach { .. } if stop.has_fired => Ok(()),
            Stage::Approach { .. } => {
                if homing {
                    stop.heard = now;
                    self.asked = None;
                } else {
                    // The report that it fired was lost: have it repeated, with its reason.
                    stop.trigger(board);
                }
                Ok(())
            }
            Stage::Released if pin_value != stop.oids.inverted => {
                Err(self.fail(ErrorCode::EndstopStillTriggered, "after backing off"))
            }
            Stage::Released => {
                stop.is_released = true;
                if self.stops.iter().all(|stop| stop.is_released) {
                    self.second = true;
                    self.tries = 0;
                    self.movers.iter_mut().for_each(|mover| mover.approach_steps = 0);
                    self.enter(Stage::PositionBefore);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The board reports where a motor stands.
    pub(super) fn on_position(&mut self, oid: u8, position: i32, now: Seconds) -> Result<(), PrinterError> {
        let before = match self.stage {
            Stage::PositionBefore => true,
            Stage::PositionAfter => false,
            _ => return Ok(()),
        };
        let mover = self.movers.iter_mut().find(|mover| mover.oid == oid && !mover.has_answered);
        let Some(mover) = mover else { return Ok(()) };
        let made = u64::from(position.wrapping_sub(mover.position).unsigned_abs());
        (mover.position, mover.has_answered) = (position, true);
        mover.first.get_or_insert(position);
        if !before {
            mover.steps += made;
            mover.approach_steps += made;
        }
        if !self.movers.iter().all(|mover| mover.has_answered) {
            return Ok(());
        }
        if before {
            self.enter(Stage::Plan);
            return Ok(());
        }
        if core::mem::take(&mut self.expired) {
            return self.go_on(now);
        }
        let has_moved =
            |stop: usize| self.movers.iter().any(|mover| mover.stop == stop && mover.approach_steps > 0);
        if self.second && !(0..self.stops.len()).all(has_moved) {
            // It was open after backing off: closed without a step it is no switch at the axis' end.
            return Err(self.fail(ErrorCode::EndstopBeforeMove, "on its second approach"));
        }
        let again = !self.second && self.retract_mm > 0.0;
        if again {
            self.enter(Stage::PlanRetract);
            return Ok(());
        }
        let (missing, off_mm) =
            parts::missing(self.axis, self.position_mm(), &self.movers, &self.motors, &self.standing);
        self.standing.off_mm = off_mm;
        self.enter(match missing {
            [0, 0, 0, 0] => Stage::Done,
            missing => Stage::PlanStraight(missing),
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests;
