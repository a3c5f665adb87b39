//! What the G-code has to wait for: heaters, dwells, homing.

use std::collections::VecDeque;

use gcode::{Heater as HeaterName, LineNumber, Wait as HeatWait};
use units::{Celsius, Seconds};

use super::{Failure, Ready};
use crate::{
    error::{ErrorCode, PrinterError},
    planner::Barrier,
    session::{
        event::Event,
        homing::{AxisHoming, Wish},
    },
};

/// Something that has to be over before the G-code goes on.
#[derive(Debug)]
pub(super) enum Wait {
    Nothing,
    Heater { heater: HeaterName, until: HeaterGoal },
    Dwell { until: Seconds },
    Homing { axis: Box<AxisHoming>, remaining: VecDeque<usize> },
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
                    let homed = self.planner.guard.homed()[axis];
                    self.planner.set_axis(axis, wanted.from_mm, homed);
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
                let position_mm = homing.position_mm();
                self.planner.abandon_run();
                self.stream.abandon(&mut self.board);
                self.planner.set_axis(axis, position_mm, false);
            }
            Ok(Wish::Done) => {
                let (position_mm, steps) = (homing.position_mm(), homing.steps);
                self.planner.set_axis(axis, position_mm, true);
                self.events.push_back(Event::Homed { axis, position_mm, steps });
                self.home_next();
            }
            Err(error) => self.homing_failed(error, now),
        }
    }

    /// The next axis of a homing, or its end.
    pub(super) fn home_next(&mut self) {
        let Wait::Homing { remaining, .. } = &mut self.wait else { return };
        let mut remaining = core::mem::take(remaining);
        self.wait = Wait::Nothing;
        while let Some(axis) = remaining.pop_front() {
            if let Some(homing) = AxisHoming::new(axis, &self.config.steppers[axis], &self.board) {
                self.wait = Wait::Homing { axis: Box::new(homing), remaining };
                return;
            }
        }
        let [x, y, z, _] = self.planner.position();
        self.source_mut().interpreter.set_axes(Some(x), Some(y), Some(z));
    }

    pub(super) fn homing_failed(&mut self, error: PrinterError, now: Seconds) {
        if let Wait::Homing { axis, .. } = &self.wait {
            let axis = axis.axis;
            self.planner.abandon_run();
            self.stream.abandon(&mut self.board);
            let position = self.planner.position()[axis];
            self.planner.set_axis(axis, position, false);
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
            Barrier::Home(axes) => {
                let remaining: VecDeque<usize> = (0..3).filter(|&axis| axes[axis]).collect();
                if let Some(&axis) = remaining.front()
                    && let Some(homing) = AxisHoming::new(axis, &self.config.steppers[axis], &self.board)
                {
                    self.wait = Wait::Homing { axis: Box::new(homing), remaining };
                    if let Wait::Homing { remaining, .. } = &mut self.wait {
                        remaining.pop_front();
                    }
                }
            }
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
            Barrier::WaitForTemperature { heater, minimum, maximum } => {
                self.wait = Wait::Heater { heater, until: HeaterGoal::Between(minimum, maximum) };
            }
            Barrier::Dwell(pause) => self.wait = Wait::Dwell { until: now + pause },
            Barrier::MotorsOff(motors) => {
                self.stream.disable(motors, &mut self.board, now);
                for axis in (0..3).filter(|&axis| motors[axis]) {
                    self.planner.guard.set_homed(axis, false);
                }
            }
            Barrier::WaitForMoves => {}
            Barrier::Pause(_) => self.pause(),
            Barrier::Cancel => self.cancel(now),
            Barrier::EmergencyStop => return Err(Failure::Stop(ErrorCode::EmergencyStop.into())),
        }
        Ok(matches!(self.wait, Wait::Nothing))
    }
}
