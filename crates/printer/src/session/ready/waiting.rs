//! What the G-code has to wait for: heaters, dwells, homing.

use std::collections::VecDeque;

use gcode::{Heater as HeaterName, LineNumber, Wait as HeatWait};
use units::{Celsius, MmPerS, Seconds};

use super::{Failure, Ready};
use crate::{
    error::{ErrorCode, PrinterError},
    journal::MovedBy,
    machine::{self, EXTRUDER, MOTORS, Motors},
    planner::{Barrier, ExtrusionPermit},
    session::{
        event::Event,
        homing::{AxisHoming, Standing, Wish},
    },
};

/// A step or two, to put axes right that homing has moved.
const STRAIGHTEN_SPEED: MmPerS = MmPerS(5.0);

/// Something that has to be over before the G-code goes on.
#[derive(Debug)]
pub(super) enum Wait {
    Nothing,
    /// For a word of the board's that it has lived to make everything: by this host's clock it has.
    Word(Option<Box<(LineNumber, Barrier)>>),
    /// Until a nozzle that may stick to the part comes free.
    Free,
    /// For all heaters, before a paused job goes back to where it was.
    Heat,
    Heater {
        heater: HeaterName,
        until: HeaterGoal,
    },
    Dwell {
        until: Seconds,
    },
    Homing {
        axis: Box<AxisHoming>,
        remaining: VecDeque<usize>,
        axes: [bool; 3],
        line: LineNumber,
    },
}

/// What a job was waiting for, or was about to, when it was paused.
#[derive(Debug, Default)]
pub(super) struct Held {
    pub(super) wait: HeldWait,
    pub(super) barrier: Option<(LineNumber, Barrier)>,
}

/// A wait that is broken off and taken up again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum HeldWait {
    #[default]
    Nothing,
    Heater {
        heater: HeaterName,
        until: HeaterGoal,
    },
    Dwell {
        rest: Seconds,
    },
}

impl Wait {
    /// Breaks the wait off. Homing cannot be: it is done to its end.
    pub(super) fn hold(&mut self, now: Seconds) -> HeldWait {
        let held = match *self {
            Self::Heater { heater, until } => HeldWait::Heater { heater, until },
            Self::Dwell { until } => HeldWait::Dwell { rest: until - now },
            Self::Nothing | Self::Word(_) | Self::Free | Self::Heat | Self::Homing { .. } => {
                return HeldWait::Nothing;
            }
        };
        *self = Self::Nothing;
        held
    }
}

impl HeldWait {
    /// Takes the wait up again.
    pub(super) fn go_on(self, now: Seconds) -> Wait {
        match self {
            Self::Nothing => Wait::Nothing,
            Self::Heater { heater, until } => Wait::Heater { heater, until },
            Self::Dwell { rest } => Wait::Dwell { until: now + rest },
        }
    }
}

/// When a wait for a heater is over.
#[derive(Clone, Copy, Debug)]
pub(super) enum HeaterGoal {
    Heated,
    Settled,
    Between(Option<Celsius>, Option<Celsius>),
}

impl Ready {
    /// Goes on with what is being waited for.
    pub(super) fn advance_wait(&mut self, now: Seconds) {
        match &mut self.wait {
            Wait::Nothing => {}
            Wait::Word(barrier) => {
                if self.board.said_after >= self.rested {
                    let barrier = barrier.take();
                    self.wait = Wait::Nothing;
                    if let Some(barrier) = barrier {
                        // It can end nothing: see where it is put there.
                        drop(self.on_barrier(barrier.0, &barrier.1, now));
                    }
                }
            }
            Wait::Free => {
                if self.thermal.is_heated() || self.extrusion_permit() == ExtrusionPermit::Allowed {
                    self.wait = Wait::Nothing;
                }
            }
            Wait::Heat => {
                if self.thermal.is_heated() && self.is_nozzle_read() {
                    self.wait = Wait::Nothing;
                    if self.is_too_cold_to_go_on(now) {
                        return;
                    }
                    let is_start = self
                        .job
                        .as_ref()
                        .and_then(|job| job.paused.as_ref())
                        .is_some_and(|it| it.start.is_some());
                    if !is_start && let Err(error) = self.go_back() {
                        self.source_failed(error, now);
                    }
                }
            }
            Wait::Dwell { until } => {
                if now >= *until {
                    self.wait = Wait::Nothing;
                }
            }
            Wait::Heater { heater, until } => {
                let Some(loop_) = self.thermal.heater(*heater) else {
                    self.wait = Wait::Nothing;
                    return;
                };
                let reached = match *until {
                    HeaterGoal::Heated => loop_.is_heated(),
                    HeaterGoal::Settled => loop_.is_settled(),
                    HeaterGoal::Between(min, max) => loop_.smoothed_temperature().is_some_and(|celsius| {
                        min.is_none_or(|min| celsius >= min) && max.is_none_or(|max| celsius <= max)
                    }),
                };
                if reached {
                    self.wait = Wait::Nothing;
                }
            }
            Wait::Homing { .. } => self.advance_homing(now),
        }
    }

    pub(super) fn advance_homing(&mut self, now: Seconds) {
        let at_rest = self.is_at_rest();
        let Wait::Homing { axis: homing, .. } = &mut self.wait else { return };
        let axis = homing.axis;
        match homing.poll(&mut self.board, now, at_rest) {
            Ok(Wish::Wait) => {}
            Ok(Wish::Move(wanted)) => {
                if at_rest {
                    // A stand-in: where it is shows only at the endstop.
                    let (axes, home_mm) = (homing.axes, homing.home_mm);
                    for axis in (0..3).filter(|&axis| axes[axis]) {
                        self.planner.set_axis(axis, home_mm[axis], false);
                    }
                    self.planner.set_axis(axis, wanted.from_mm, false);
                    let mut to = self.planner.position();
                    to[axis] = wanted.to_mm;
                    if let Err(error) = self.planner.push_raw_move(to, wanted.speed, LineNumber(0)) {
                        self.homing_failed(error, now);
                        return;
                    }
                    self.planner.finish_run();
                }
            }
            Ok(Wish::Abandon) => {
                let (axes, home_mm) = (homing.axes, homing.home_mm);
                self.break_run(now);
                for axis in (0..3).filter(|&axis| axes[axis]) {
                    self.planner.set_axis(axis, home_mm[axis], false);
                }
            }
            Ok(Wish::Straighten(missing)) => {
                if at_rest {
                    self.straighten(missing, now);
                }
            }
            Ok(Wish::GoesOn) => {
                let text = "homing was stopped by the board, which heard nothing for a moment: it goes on from there";
                self.events.push(Event::Message(text.into()));
            }
            Ok(Wish::Done) => {
                let (axes, home_mm, steps) = (homing.axes, homing.home_mm, homing.steps());
                self.off_mm = homing.off_mm();
                for at in (0..3).filter(|&at| axes[at]) {
                    let position_mm = home_mm[at];
                    self.planner.set_axis(at, position_mm, true);
                    self.off_mm[at] = 0.0;
                    // Of towers each tells of its own.
                    let own = |motor: usize| if axes == [true; 3] && motor != at { 0 } else { steps[motor] };
                    let steps = core::array::from_fn(own);
                    self.events.push(Event::Homed { axis: at, position_mm, steps });
                }
                self.diary.off(self.off_mm);
                self.home_next();
            }
            Ok(Wish::Cancelled) => {
                // Motors that move another axis as well may have left it a step or two off.
                let lost = self.coupled(core::array::from_fn(|it| it == axis));
                (0..3).filter(|&axis| lost[axis]).for_each(|axis| self.planner.guard.set_homed(axis, false));
                self.wait = Wait::Nothing;
                self.planner.correct(&mut self.console.source);
            }
            Err(error) => self.homing_failed(error, now),
        }
    }

    /// Homing has left motors so many steps short of where other axes are where they were: they make them.
    fn straighten(&mut self, missing: [i32; MOTORS], now: Seconds) {
        let to = self.planner.position();
        let short = missing.map(i32::saturating_neg);
        let Some(mut from) = Motors::new(&self.config).moved(&to, short) else {
            let detail = "the motors' counts belong to no place of the head";
            return self.homing_failed(PrinterError::new(ErrorCode::Internal, detail), now);
        };
        from[EXTRUDER] = to[EXTRUDER];
        self.planner.stand_at(from);
        match self.planner.push_raw_move(to, STRAIGHTEN_SPEED, LineNumber(0)) {
            Ok(()) => drop(self.planner.finish_run()),
            Err(error) => self.homing_failed(error, now),
        }
    }

    /// An axis, about to be homed.
    fn homing(&self, axis: usize) -> Option<AxisHoming> {
        let (position, homed) = (self.planner.position(), self.planner.guard.homed());
        let standing = Standing { position, homed, off_mm: self.off_mm };
        AxisHoming::new(axis, &self.config, &self.board, standing)
    }

    /// The motors have been stopped by something else: what was planned for them is forgotten.
    fn break_run(&mut self, now: Seconds) {
        self.planner.abandon_run();
        if self.stream.abandon(&mut self.board) {
            self.events.push(Event::RunBroken { at: self.board.motion_at(now) });
        }
    }

    /// The next axis of a homing, or its end.
    pub(super) fn home_next(&mut self) {
        let Wait::Homing { remaining, axes, line, .. } = &mut self.wait else { return };
        let (mut remaining, axes, line) = (core::mem::take(remaining), *axes, *line);
        self.wait = Wait::Nothing;
        while let Some(axis) = remaining.pop_front() {
            if let Some(homing) = self.homing(axis) {
                self.wait = Wait::Homing { axis: Box::new(homing), remaining, axes, line };
                return;
            }
        }
        // A job that is paused, or on its way to its first line, has nothing to do with it.
        let plans_job = self.plans_job();
        let source = self.job.as_mut().filter(|_| plans_job).map(|job| &mut job.source);
        self.planner.tell_homed(axes, source.unwrap_or(&mut self.console.source));
    }

    /// Has axes homed, one after the other, or all together.
    pub(super) fn begin_homing(&mut self, axes: [bool; 3], line: LineNumber) {
        let axes = machine::homed_together(&self.config, axes);
        let mut remaining: VecDeque<usize> = (0..3).filter(|&axis| axes[axis]).collect();
        if machine::homed_together(&self.config, [true, false, false]) == [true; 3] {
            remaining.truncate(1);
        }
        if let Some(axis) = remaining.pop_front()
            && let Some(homing) = self.homing(axis)
        {
            self.wait = Wait::Homing { axis: Box::new(homing), remaining, axes, line };
        }
    }

    /// These axes, and all that motors of theirs move as well. Those motors have the same numbers.
    fn coupled(&self, axes: [bool; MOTORS]) -> [bool; MOTORS] {
        machine::geometry(&self.config).coupled(axes)
    }

    pub(super) fn homing_failed(&mut self, mut error: PrinterError, now: Seconds) {
        if let Wait::Homing { axis, line, .. } = &self.wait {
            axis.stop_all(&mut self.board);
            let axis = axis.axis;
            error = error.at_line(line.0);
            self.break_run(now);
            // Motors that move another axis as well have left nobody knows where.
            let lost = self.coupled(core::array::from_fn(|it| it == axis));
            let position = self.planner.position();
            for axis in (0..3).filter(|&axis| lost[axis]) {
                self.planner.set_axis(axis, position[axis], false);
            }
        }
        self.wait = Wait::Nothing;
        self.source_failed(error, now);
    }

    /// Deals with a barrier; `false` when it takes time.
    pub(super) fn on_barrier(
        &mut self,
        line: LineNumber,
        barrier: &Barrier,
        now: Seconds,
    ) -> Result<bool, Failure> {
        match *barrier {
            Barrier::Home(axes) => self.begin_homing(axes, line),
            Barrier::WaitTemperature { heater, target, wait } => {
                match self.thermal.set_target(heater, target, &mut self.board, now) {
                    Ok(()) => {
                        let until = match wait {
                            HeatWait::UntilReached => HeaterGoal::Settled,
                            HeatWait::UntilHeated | HeatWait::No => HeaterGoal::Heated,
                        };
                        self.wait = Wait::Heater { heater, until };
                    }
                    Err(error) => self.source_failed(error.at_line(line.0), now),
                }
            }
            Barrier::WaitForTemperature { heater, .. } if self.thermal.heater(heater).is_none() => {
                let detail = format!("{} is not in the machine file", machine::heater_name(heater));
                self.source_failed(PrinterError::new(ErrorCode::NoSuchHeater, detail).at_line(line.0), now);
            }
            Barrier::WaitForTemperature { heater, minimum, maximum } => {
                self.wait = Wait::Heater { heater, until: HeaterGoal::Between(minimum, maximum) };
            }
            Barrier::Dwell(pause) => self.wait = Wait::Dwell { until: now + pause },
            Barrier::MotorsOff(_) if self.plans_job() && self.board.said_after < self.rested => {
                // Where Z stands then is known only if the board has lived to make what comes before.
                self.wait = Wait::Word(Some(Box::new((line, barrier.clone()))));
            }
            Barrier::MotorsOff(motors) => {
                if !self.plans_job() {
                    self.diary.lose_place(&mut self.board);
                }
                if motors[2] {
                    // Without current it moves as it does without power, and its driver keeps its place.
                    self.note_height(self.planner.position()[2], MovedBy::Nobody);
                }
                let motors = self.coupled(motors);
                self.stream.disable(motors, &mut self.board, now);
                for axis in (0..3).filter(|&axis| motors[axis]) {
                    self.planner.guard.set_homed(axis, false);
                }
            }
            Barrier::WaitForMoves => {}
            // Typed where there is no job, they mean nothing.
            Barrier::Pause(_) => drop(self.pause(now)),
            Barrier::Cancel => drop(self.cancel(now)),
            Barrier::EmergencyStop => {
                let detail = "M112 was carried out";
                let error = PrinterError::new(ErrorCode::EmergencyStop, detail).at_line(line.0);
                return Err(Failure::Stop(error));
            }
        }
        Ok(matches!(self.wait, Wait::Nothing))
    }
}
