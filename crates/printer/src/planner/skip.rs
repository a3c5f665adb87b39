//! Reads a file up to a line without making any of it: what its lines have set by then holds, and the machine is to stand
//! where the line before has left it.
//!
//! Knows nothing of how it gets there, and of what became of the lines that are passed over.

use gcode::{Action, Heater, LineNumber, Position};
use units::Celsius;

use super::{Planner, Source, source::Next};
use crate::{
    error::{ErrorCode, PrinterError},
    machine::EXTRUDER,
    transform::Transform,
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

/// Places of the machine that enclose whatever is between two of the G-code.
fn corners(ends: [[f64; 3]; 2], transform: &Transform) -> impl Iterator<Item = [f64; 3]> {
    let [_, most] = transform.added_to_z();
    (0..4).map(move |corner: usize| [ends[corner % 2][0], ends[corner / 2][1]]).flat_map(move |[x, y]| {
        ends.map(|[_, _, z]| {
            let [x, y, _] = transform.machine_from_gcode([x, y, z]);
            [x, y, z + most]
        })
    })
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct Skip {
    until: LineNumber,
    endstops: [f64; 3],
    /// What heaters and fan are to do at that line.
    pub(crate) targets: Vec<(Heater, Celsius)>,
    pub(crate) fan: f64,
    /// The highest Z at which anything has been extruded, in mm of the machine …
    pub(crate) top: f64,
    /// … and the lowest and highest X and Y.
    pub(crate) printed: Option<[[f64; 2]; 2]>,
    /// Filament that is pulled back at that line, in mm.
    pub(crate) retracted: f64,
    filament_max: f64,
}

impl Skip {
    /// Up to a line; `endstops` is where axes are once they are homed.
    pub(crate) const fn new(until: u32, endstops: [f64; 3]) -> Self {
        Self {
            until: LineNumber(until),
            endstops,
            targets: Vec::new(),
            fan: 0.0,
            top: 0.0,
            printed: None,
            retracted: 0.0,
            filament_max: 0.0,
        }
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
                    let Position { x, y, z, e } = source.interpreter.position();
                    let [x, y, z] = planner.transform().machine_from_gcode([x, y, z]);
                    planner.stand_at([x, y, z, 0.0]);
                    (0..3).for_each(|axis| planner.guard.set_homed(axis, true));
                    source.e_offset = planner.position()[EXTRUDER] - e;
                    self.retracted = (self.filament_max - e).max(0.0);
                    return Ok(Skipped::Done);
                }
            }
        }
        Ok(Skipped::Working)
    }

    /// Something has been extruded on the way between these ends, up to so much filament.
    fn print(&mut self, ends: [[f64; 3]; 2], filament: f64, transform: &Transform) {
        self.filament_max = self.filament_max.max(filament);
        for [x, y, z] in corners(ends, transform) {
            self.top = self.top.max(z);
            let [[low_x, low_y], [high_x, high_y]] = self.printed.unwrap_or([[x, y]; 2]);
            self.printed = Some([[low_x.min(x), low_y.min(y)], [high_x.max(x), high_y.max(y)]]);
        }
    }

    fn pass(
        &mut self,
        action: &Action,
        planner: &mut Planner,
        source: &mut Source,
    ) -> Result<(), PrinterError> {
        match *action {
            Action::Move(mv) if mv.to.e > mv.from.e => {
                let ends = [mv.from, mv.to].map(|at| [at.x, at.y, at.z]);
                self.print(ends, mv.to.e, planner.transform());
            }
            Action::Arc(ref arc) if arc.to.e > arc.from.e => {
                self.print(arc.bounds(), arc.to.e, planner.transform());
            }
            Action::Skew(_) | Action::BedMesh(_) => {
                planner.set_transform(action, source.line())?;
            }
            Action::SetTemperature { heater, target, .. } => {
                self.targets.retain(|(known, _)| *known != heater);
                self.targets.push((heater, target));
            }
            Action::TurnOffHeaters => self.targets.clear(),
            Action::Fan { index: 0, speed } => self.fan = speed,
            Action::VelocityLimit(limit) => planner.limit(limit),
            Action::PressureAdvance { .. } | Action::InputShaper(_) => planner.set_dynamics(action),
            Action::Home { x, y, z } => {
                let axes = planner.homed_together([x, y, z]);
                planner.transform().home(&mut source.interpreter, axes, self.endstops);
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
