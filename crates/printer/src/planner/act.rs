//! What the lines of a source do to the plan, besides moves: what has to wait for the moves before it, and what the machine has
//! to be at rest for.

use gcode::{Action, LineNumber, Wait};
use units::Seconds;

use super::{Barrier, Deferred, Planned, Planner, Run, Source, TimedAction};
use crate::error::{ErrorCode, PrinterError};

/// The most timed actions that wait for their move at once: more end the run, so that memory stays bounded.
const DEFERRED_MAX: usize = 4096;
/// Longer dwells end the run of motion, so that a print can be paused or cancelled while it waits.
const DWELL_IN_RUN_MAX: Seconds = Seconds(2.0);

impl Planner {
    /// Takes what a line asks for.
    pub(super) fn act(&mut self, action: Action, source: &mut Source) -> Result<(), PrinterError> {
        let line = source.line();
        match action {
            Action::Move(mv) => self.judge_and_push(&mv, None, source)?,
            Action::Arc(arc) => {
                self.judge_arc(&arc, source)?;
                source.draw(&arc);
            }
            Action::VelocityLimit(limit) => self.limit(limit),
            Action::SetTemperature { heater, target, wait: Wait::No } => {
                self.defer(line, TimedAction::SetTemperature { heater, target });
            }
            Action::SetTemperature { heater, target, wait } => {
                self.barrier = Some((line, Barrier::WaitTemperature { heater, target, wait }));
            }
            Action::Fan { index, .. } if index > 0 => self.notice_fan(line),
            Action::Fan { index, speed } => self.defer(line, TimedAction::Fan { index, speed }),
            Action::Message(text) => self.defer(line, TimedAction::Message(text)),
            Action::Annotation(annotation) => self.defer(line, TimedAction::Annotation(annotation)),
            Action::Object(object) => self.defer(line, TimedAction::Object(object)),
            Action::ReportTemperatures => self.defer(line, TimedAction::ReportTemperatures),
            Action::ReportPosition => self.defer(line, TimedAction::ReportPosition),
            Action::Home { x, y, z } => {
                self.barrier = Some((line, Barrier::Home(self.homed_together([x, y, z]))));
            }
            Action::Dwell(pause) if self.run == Run::Active && pause <= DWELL_IN_RUN_MAX => {
                self.look_ahead.dwell(pause);
                self.bound.iter_mut().for_each(|bound| bound.dwell(pause));
                self.dwelt_until = self.look_ahead.print_time();
            }
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
            Action::PressureAdvance { .. } | Action::InputShaper(_) => self.set_dynamics(&action),
            Action::Skew(_) | Action::BedMesh(_) => {
                if let Some(text) = self.set_transform(&action, line)? {
                    self.defer(line, TimedAction::Message(text));
                }
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

    /// Attaches an action to the end of the moves read so far.
    pub(super) fn defer(&mut self, line: LineNumber, action: TimedAction) {
        if self.moves_planned == self.moves_pushed {
            let until = self.planned_until.max(self.dwelt_until);
            let at = if self.run == Run::None { Seconds::ZERO } else { until };
            self.ready.push_back(Planned::Timed { at, line, action });
            return;
        }
        let not_before = self.dwelt_until;
        self.deferred.push_back(Deferred { after: self.moves_pushed, not_before, line, action });
        if self.deferred.len() >= DEFERRED_MAX {
            self.finish_run();
        }
    }
}
