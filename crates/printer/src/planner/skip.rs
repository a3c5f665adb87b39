//! Reads a file up to a line without making any of it: what its lines have set by then holds, and the machine is to stand
//! where the line before has left it.
//!
//! Knows nothing of how it gets there, and of what became of the lines that are passed over.

use gcode::{Action, Heater, LineNumber};
use units::Celsius;

use super::{Planner, Source, source::Next};
use crate::{
    error::{ErrorCode, PrinterError},
    machine::EXTRUDER,
};

/// Things in the file that are read in one go.
const THINGS_MAX: usize = 65_536;

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Skipped {
    NeedsInput,
    /// There is more to do.
    Working,
    /// The line is the next.
    Done,
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct Skip {
    until: LineNumber,
    endstops: [f64; 3],
    /// What heaters and fan are to do at that line.
    pub(crate) targets: Vec<(Heater, Celsius)>,
    pub(crate) fan: f64,
    /// The highest Z at which anything has been extruded, in mm.
    pub(crate) top: f64,
}

impl Skip {
    /// Up to a line; `endstops` is where axes are once they are homed.
    pub(crate) const fn new(until: u32, endstops: [f64; 3]) -> Self {
        Self { until: LineNumber(until), endstops, targets: Vec::new(), fan: 0.0, top: 0.0 }
    }

    /// The line before which it ends.
    pub(crate) const fn line(&self) -> LineNumber {
        self.until
    }

    /// Reads a piece. At the end the planner stands where the job is to begin.
    pub(crate) fn advance(
        &mut self,
        planner: &mut Planner,
        source: &mut Source,
    ) -> Result<Skipped, PrinterError> {
        for _ in 0..THINGS_MAX {
            match source.next_before(self.until) {
                Some(Next::Action(action)) => self.pass(&action, planner, source)?,
                // Whoever begins behind a line has nothing to do with what is wrong in it.
                Some(Next::Diagnostic(_)) => {}
                Some(Next::NeedsInput) => return Ok(Skipped::NeedsInput),
                Some(Next::End) => {
                    let detail = format!("it has no line {}", self.until.0);
                    return Err(PrinterError::new(ErrorCode::InvalidGcode, detail));
                }
                None => {
                    let gcode::Position { x, y, z, e } = source.interpreter.position();
                    planner.stand_at([x, y, z, 0.0]);
                    (0..3).for_each(|axis| planner.guard.set_homed(axis, true));
                    source.e_offset = planner.position()[EXTRUDER] - e;
                    return Ok(Skipped::Done);
                }
            }
        }
        Ok(Skipped::Working)
    }

    fn pass(
        &mut self,
        action: &Action,
        planner: &mut Planner,
        source: &mut Source,
    ) -> Result<(), PrinterError> {
        match *action {
            Action::Move(mv) if mv.to.e > mv.from.e => self.top = self.top.max(mv.to.z),
            Action::Arc(ref arc) if arc.to.e > arc.from.e => self.top = self.top.max(arc.to.z),
            Action::SetTemperature { heater, target, .. } => {
                self.targets.retain(|(known, _)| *known != heater);
                self.targets.push((heater, target));
            }
            Action::TurnOffHeaters => self.targets.clear(),
            Action::Fan { index: 0, speed } => self.fan = speed,
            Action::VelocityLimit(limit) => planner.limit(limit),
            Action::Home { x, y, z } => {
                let home = |axis: usize, is: bool| is.then_some(self.endstops[axis]);
                source.interpreter.set_axes(home(0, x), home(1, y), home(2, z));
            }
            Action::Cancel | Action::EmergencyStop => {
                let detail = format!("the file ends the print before line {}", self.until.0);
                return Err(PrinterError::new(ErrorCode::InvalidGcode, detail).at_line(source.line().0));
            }
            _ => {}
        }
        Ok(())
    }
}
