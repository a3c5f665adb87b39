//! Homing: an axis runs towards its endstop until the board itself sees it and stops the motor, backs off, and does it
//! again more slowly. The position comes from where the motor stopped, never from the plan.
//!
//! The board's trigger fires by itself when the host falls silent, so a lost link stops the axis. Where that was but a
//! bad moment of the line, the axis goes on from where it stands, a few times: no further altogether than one approach goes.

use units::{Seconds, Ticks};
use wire::Command;

use super::{board::Board, layout::EndstopOids};
use crate::{
    config::StepperConfig,
    error::{ErrorCode, PrinterError},
};

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

/// A straight move that homing wants made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HomingMove {
    /// Where the axis is taken to be, in mm.
    pub(super) from_mm: f64,
    /// Where it goes, in mm.
    pub(super) to_mm: f64,
    /// How fast, in mm/s.
    pub(super) speed: units::MmPerS,
}

/// What homing wants next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wish {
    /// Nothing but time.
    Wait,
    /// Plan this move and make a run of it; then call [`AxisHoming::run_started`].
    Move(HomingMove),
    /// The motor has been stopped by the trigger: forget what was planned.
    Abandon,
    /// The board stopped the motor because it had heard nothing; it now goes on. The user should know of it.
    GoesOn,
    /// The axis is home.
    Done,
    /// The axis stands still because it was told to; where, nobody knows.
    Cancelled,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Ask where the motor stands.
    PositionBefore,
    /// Have the approach planned.
    Plan,
    /// On the way; `end` is when the move would end without an endstop.
    Approach {
        start: Ticks,
        end: Option<Ticks>,
        kept_alive: Seconds,
        heard: Seconds,
    },
    /// The trigger has fired: ask where the motor stopped.
    PositionAfter,
    /// Have the way back planned.
    PlanRetract,
    /// On the way back.
    Retract,
    /// Ask whether the endstop has been let go.
    Released,
    Done,
}

/// One axis on its way home.
#[derive(Debug)]
pub(super) struct AxisHoming {
    pub(super) axis: usize,
    oids: EndstopOids,
    stepper: u8,
    stage: Stage,
    second: bool,
    cancelled: bool,
    /// When the question of the present stage was first and last asked.
    asked: Option<(Seconds, Seconds)>,
    position_before: i32,
    abandon: bool,
    /// The board stopped the approach because it heard nothing; to be told once it goes on.
    expired: bool,
    goes_on: bool,
    /// Host and board have been apart for long in the present approach.
    apart: bool,
    /// How often the present approach has been begun, and the steps that it has made.
    tries: u8,
    approach_steps: u64,
    /// Steps made in both approaches, as the board counted them.
    pub(super) steps: u64,
    endstop_mm: f64,
    retract_mm: f64,
    travel_mm: f64,
    /// +1 where the endstop is at the high end.
    sign: f64,
    speeds: [units::MmPerS; 2],
    step_mm: f64,
}

impl AxisHoming {
    pub(super) fn new(axis: usize, config: &StepperConfig, board: &Board) -> Option<Self> {
        Some(Self {
            axis,
            oids: board.layout.endstops[axis],
            stepper: board.layout.steppers[axis]?.stepper.0,
            stage: Stage::PositionBefore,
            second: false,
            cancelled: false,
            asked: None,
            position_before: 0,
            abandon: false,
            expired: false,
            goes_on: false,
            apart: false,
            tries: 0,
            approach_steps: 0,
            steps: 0,
            endstop_mm: config.position_endstop.0,
            retract_mm: config.homing_retract_dist.0,
            travel_mm: TRAVEL_FACTOR * (config.position_max - config.position_min).0,
            sign: if config.homing_positive_dir { 1.0 } else { -1.0 },
            speeds: [config.homing_speed, config.second_homing_speed],
            step_mm: config.motor.step_distance().0,
        })
    }

    /// Where the axis is once it is home, in mm.
    pub(super) const fn position_mm(&self) -> f64 {
        self.endstop_mm
    }

    /// How far the present approach may still go, in mm: however often it is begun, no further than one approach goes.
    fn travel_left_mm(&self) -> f64 {
        let travel = if self.second { SECOND_TRAVEL_FACTOR * self.retract_mm } else { self.travel_mm };
        travel - self.approach_steps as f64 * self.step_mm
    }

    /// The axis is to stop.
    pub(super) fn cancel(&mut self) {
        self.cancelled = true;
        self.asked = None;
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.asked = None;
    }

    fn fail(&self, code: ErrorCode, detail: &str) -> PrinterError {
        let axis = ["X", "Y", "Z"][self.axis];
        PrinterError::new(code, if detail.is_empty() { axis.to_owned() } else { format!("{axis}, {detail}") })
    }

    /// Asks, and asks again; fails when nobody answers.
    fn ask(&mut self, question: &Command<'_>, board: &mut Board, now: Seconds) -> Result<(), PrinterError> {
        let (first, last) = self.asked.unwrap_or((now, now));
        if self.asked.is_none() || now - last >= ASK_AGAIN {
            board.control(question);
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
                self.ask(&Command::StepperGetPosition { oid: self.stepper }, board, now)?;
                Ok(Wish::Wait)
            }
            Stage::Plan => {
                let from_mm = self.endstop_mm - self.sign * self.travel_left_mm();
                let speed = self.speeds[usize::from(self.second)];
                Ok(Wish::Move(HomingMove { from_mm, to_mm: self.endstop_mm, speed }))
            }
            Stage::Approach { .. } => self.watch(board, now),
            Stage::PlanRetract => {
                let to_mm = self.endstop_mm - self.sign * self.retract_mm;
                Ok(Wish::Move(HomingMove { from_mm: self.endstop_mm, to_mm, speed: self.speeds[0] }))
            }
            Stage::Retract => {
                if at_rest {
                    self.enter(Stage::Released);
                }
                Ok(Wish::Wait)
            }
            Stage::Released => {
                self.ask(&Command::EndstopQueryState { oid: self.oids.endstop.0 }, board, now)?;
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
            Stage::Plan | Stage::PlanRetract | Stage::Retract => at_rest,
            Stage::Approach { .. } | Stage::Done => false,
        }
    }

    /// Its move has become a run that starts at this clock: the trigger is armed before the first step.
    pub(super) fn run_started(&mut self, start: Ticks, board: &mut Board, now: Seconds) {
        if self.stage == Stage::PlanRetract {
            self.enter(Stage::Retract);
            return;
        }
        let (trsync, clock) = (self.oids.trsync.0, start.low().0);
        let speed = self.speeds[usize::from(self.second)];
        board.control(&Command::TrsyncStart {
            oid: trsync,
            report_clock: clock,
            report_ticks: board.ticks(REPORT).0 as u32,
            expire_reason: REASON_EXPIRED,
        });
        board.control(&Command::StepperStopOnTrigger { oid: self.stepper, trsync_oid: trsync });
        board.control(&Command::TrsyncSetTimeout {
            oid: trsync,
            clock: (start + board.ticks(EXPIRE)).low().0,
        });
        board.control(&Command::EndstopHome {
            oid: self.oids.endstop.0,
            clock,
            sample_ticks: board.ticks(SAMPLE).0 as u32,
            sample_count: SAMPLES,
            // Between steps there is nothing new to see.
            rest_ticks: board.ticks(Seconds(self.step_mm / speed.0)).0 as u32,
            pin_value: u8::from(!self.oids.inverted),
            trsync_oid: trsync,
            trigger_reason: REASON_ENDSTOP,
        });
        self.tries += 1;
        self.apart = false;
        self.enter(Stage::Approach { start, end: None, kept_alive: now, heard: now });
    }

    /// The approach has been planned to its end.
    pub(super) fn run_planned(&mut self, at: Ticks) {
        if let Stage::Approach { end, .. } = &mut self.stage {
            *end = Some(at);
        }
    }

    /// Where they were apart for too long, an approach that the board has stopped does not go on.
    fn note_apart(&mut self, now: Seconds) {
        if let Stage::Approach { kept_alive, heard, .. } = self.stage {
            self.apart |= now - kept_alive > APART_MAX || now - heard > APART_MAX;
        }
    }

    fn watch(&mut self, board: &mut Board, now: Seconds) -> Result<Wish, PrinterError> {
        self.note_apart(now);
        let Stage::Approach { start, end, kept_alive, heard } = &mut self.stage else {
            return Ok(Wish::Wait);
        };
        let clock_now = board.clock_at(now);
        if now - *kept_alive >= KEEP_ALIVE {
            *kept_alive = now;
            // Never before the axis moves: a stepper that is stopped first would start all the same.
            let clock = (clock_now.max(*start) + board.ticks(EXPIRE)).low().0;
            board.control(&Command::TrsyncSetTimeout { oid: self.oids.trsync.0, clock });
        }
        let overdue = end.is_some_and(|end| clock_now > end + board.ticks(REPORT));
        let silent = now - *heard > REPORT_SILENCE;
        // Not before the steps have begun: a stepper that is stopped first would start with them all the same.
        let stop_wanted = self.cancelled && clock_now > *start + board.ticks(REPORT);
        let overdue = overdue || stop_wanted;
        if overdue || silent {
            // Answered with the reason that it fired for first, should it have fired already.
            let stop = Command::TrsyncTrigger { oid: self.oids.trsync.0, reason: REASON_HOST };
            if overdue {
                self.ask(&stop, board, now)?;
            } else {
                // Its answer says whether the approach is still on, without ending it.
                self.ask(&Command::EndstopQueryState { oid: self.oids.endstop.0 }, board, now)?;
            }
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
        let Stage::Approach { heard, .. } = &mut self.stage else { return Ok(()) };
        if oid != self.oids.trsync.0 {
            return Ok(());
        }
        if can_trigger {
            *heard = now;
            self.asked = self.asked.filter(|_| self.cancelled);
            return Ok(());
        }
        match reason {
            REASON_ENDSTOP => {
                self.stopped(board);
                Ok(())
            }
            _ if self.cancelled => {
                self.stopped(board);
                Ok(())
            }
            REASON_EXPIRED if self.tries < TRIES_MAX && !self.apart => {
                self.expired = true;
                self.stopped(board);
                Ok(())
            }
            REASON_EXPIRED => Err(self.fail(ErrorCode::HomingTimeout, NOT_HEARD)),
            _ => Err(self.fail(ErrorCode::EndstopNotReached, "")),
        }
    }

    fn stopped(&mut self, board: &mut Board) {
        board.control(&Command::EndstopHome {
            oid: self.oids.endstop.0,
            clock: 0,
            sample_ticks: 0,
            sample_count: 0,
            rest_ticks: 0,
            pin_value: 0,
            trsync_oid: 0,
            trigger_reason: 0,
        });
        // Armed anew without reports: it has nothing more to say.
        board.control(&Command::TrsyncStart {
            oid: self.oids.trsync.0,
            report_clock: 0,
            report_ticks: 0,
            expire_reason: 0,
        });
        self.abandon = true;
        self.enter(Stage::PositionAfter);
    }

    /// Begins an approach that the time-out has ended once more, from where the motor stands.
    fn go_on(&mut self, position: i32, now: Seconds) -> Result<(), PrinterError> {
        if self.asked.is_some_and(|(first, _)| now - first > APART_MAX) {
            return Err(self.fail(ErrorCode::HomingTimeout, NOT_HEARD));
        }
        if self.travel_left_mm() < self.step_mm {
            return Err(self.fail(ErrorCode::EndstopNotReached, ""));
        }
        self.position_before = position;
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
        if oid != self.oids.endstop.0 {
            return Ok(());
        }
        match &mut self.stage {
            Stage::Approach { heard, .. } => {
                if homing {
                    *heard = now;
                    self.asked = None;
                } else {
                    // The report that it fired was lost: have it repeated, with its reason.
                    board.control(&Command::TrsyncTrigger { oid: self.oids.trsync.0, reason: REASON_HOST });
                }
                Ok(())
            }
            Stage::Released if pin_value != self.oids.inverted => {
                Err(self.fail(ErrorCode::EndstopStillTriggered, "after backing off"))
            }
            Stage::Released => {
                self.second = true;
                (self.tries, self.approach_steps) = (0, 0);
                self.enter(Stage::PositionBefore);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The board reports where a motor stands.
    pub(super) fn on_position(&mut self, oid: u8, position: i32, now: Seconds) -> Result<(), PrinterError> {
        if oid != self.stepper {
            return Ok(());
        }
        match self.stage {
            Stage::PositionBefore => {
                self.position_before = position;
                self.enter(Stage::Plan);
            }
            Stage::PositionAfter => {
                let made = u64::from(position.wrapping_sub(self.position_before).unsigned_abs());
                self.steps += made;
                self.approach_steps += made;
                if core::mem::take(&mut self.expired) {
                    return self.go_on(position, now);
                }
                if self.second && self.approach_steps == 0 {
                    // It was open after backing off: closed without a step it is no switch at the axis' end.
                    return Err(self.fail(ErrorCode::EndstopBeforeMove, "on its second approach"));
                }
                let again = !self.second && self.retract_mm > 0.0;
                self.enter(if again { Stage::PlanRetract } else { Stage::Done });
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
