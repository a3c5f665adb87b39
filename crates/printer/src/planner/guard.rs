//! What the machine file allows: nothing reaches a motor that has not passed here.
//!
//! Knows positions and limits, not speeds (the look-ahead keeps those) and not temperatures (it is told whether the
//! nozzle may extrude). Positions are machine coordinates in mm, the extruder in mm of filament.

use gcode::{LineNumber, Move};
use motion::Bend;

use super::Position;
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    reach::{AXES, Reach},
};

/// Whether the nozzle may push filament.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExtrusionPermit {
    /// It is hot enough (or cold extrusion is allowed by `min_extrude_temp: 0`).
    Allowed,
    /// It is colder than `min_extrude_temp`.
    TooCold {
        /// Its temperature, °C.
        celsius: f64,
    },
}

/// Judges moves before they are planned.
#[derive(Clone, Debug)]
pub struct Guard {
    reach: Reach,
    homed: [bool; 3],
    extruder: Option<ExtruderGuard>,
    /// Kept up to date by the owner.
    pub extrusion: ExtrusionPermit,
}

#[derive(Clone, Debug)]
struct ExtruderGuard {
    filament_area_mm2: f64,
    cross_section_max_mm2: f64,
    extrude_only_max_mm: f64,
    min_extrude_celsius: f64,
}

impl Guard {
    /// The limits of a machine file; no axis is homed yet.
    pub fn new(config: &PrinterConfig) -> Self {
        let extruder = config.extruder.as_ref().map(|extruder| ExtruderGuard {
            filament_area_mm2: extruder.filament_area_mm2(),
            cross_section_max_mm2: extruder.max_extrude_cross_section,
            extrude_only_max_mm: extruder.max_extrude_only_distance.0,
            min_extrude_celsius: extruder.heater.min_extrude_temp.0,
        });
        let cold_allowed =
            extruder.as_ref().is_none_or(|extruder: &ExtruderGuard| extruder.min_extrude_celsius <= 0.0);
        let extrusion =
            if cold_allowed { ExtrusionPermit::Allowed } else { ExtrusionPermit::TooCold { celsius: 0.0 } };
        Self { reach: Reach::new(config), homed: [false; 3], extruder, extrusion }
    }

    /// Which axes have a known position.
    pub const fn homed(&self) -> [bool; 3] {
        self.homed
    }

    /// Sets whether an axis' position is known.
    pub fn set_homed(&mut self, axis: usize, homed: bool) {
        self.homed[axis] = homed;
    }

    /// Why this move may not be made, if so.
    pub fn judge(&self, mv: &Move) -> Result<(), PrinterError> {
        let [from, to] = [mv.from, mv.to].map(|at| [at.x, at.y, at.z]);
        self.judge_travel(from, to, mv.line)?;
        self.judge_extrusion(mv)
    }

    /// Why the head may not go there, if so.
    pub(crate) fn judge_travel(
        &self,
        from: [f64; 3],
        to: [f64; 3],
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        let out_of_range = |detail| PrinterError::new(ErrorCode::MoveOutOfRange, detail).at_line(line.0);
        for axis in 0..3 {
            if from[axis] == to[axis] {
                continue;
            }
            if !self.homed[axis] {
                let detail = format!("axis {} has not been homed", AXES[axis]);
                return Err(PrinterError::new(ErrorCode::NotHomed, detail).at_line(line.0));
            }
            self.reach.judge_axis(axis, to[axis]).map_err(out_of_range)?;
        }
        if from != to {
            self.reach.judge_way(from, to).map_err(out_of_range)?;
        }
        Ok(())
    }

    /// Why this piece of an arc may not be made, where its straight one may: it bulges.
    pub(crate) fn judge_bend(
        &self,
        bend: &Bend,
        from: [f64; 4],
        to: [f64; 4],
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        self.reach
            .judge_bend(bend, [from[0], from[1], from[2]], [to[0], to[1], to[2]])
            .map_err(|detail| PrinterError::new(ErrorCode::MoveOutOfRange, detail).at_line(line.0))
    }

    /// Why it may not push so much filament, if so.
    pub(crate) fn judge_extrusion(&self, mv: &Move) -> Result<(), PrinterError> {
        let filament = mv.to.e - mv.from.e;
        if filament == 0.0 {
            return Ok(());
        }
        let fail = |code, detail: String| Err(PrinterError::new(code, detail).at_line(mv.line.0));
        let Some(extruder) = &self.extruder else {
            return fail(ErrorCode::NoSuchHeater, "the machine file has no [extruder]".into());
        };
        if let ExtrusionPermit::TooCold { celsius } = self.extrusion {
            let wanted = extruder.min_extrude_celsius;
            return fail(
                ErrorCode::ColdExtrusion,
                format!("the nozzle is at {celsius:.0} °C, below min_extrude_temp ({wanted:.0} °C)"),
            );
        }
        let travel = [mv.to.x - mv.from.x, mv.to.y - mv.from.y, mv.to.z - mv.from.z];
        let length = libm::sqrt(travel.iter().map(|d| d * d).sum());
        let is_on_the_spot = length < ON_THE_SPOT_MM;
        // Filament that is pulled back while the head travels is not laid along the way either.
        if is_on_the_spot || filament < 0.0 {
            if filament.abs() > extruder.extrude_only_max_mm {
                let how = if is_on_the_spot { "without travel" } else { "pulled back" };
                return fail(
                    ErrorCode::ExtrusionTooLong,
                    format!(
                        "{filament:.1} mm of filament {how}, max_extrude_only_distance is {:.1} mm",
                        extruder.extrude_only_max_mm
                    ),
                );
            }
        } else {
            let area = filament / length * extruder.filament_area_mm2;
            // Dabs shorter than a nozzle's bore are how slicers prime and wipe: their ratio means nothing.
            let dab = filament * extruder.filament_area_mm2 <= extruder.cross_section_max_mm2 * DAB_MM;
            if area > extruder.cross_section_max_mm2 && !dab {
                return fail(
                    ErrorCode::ExtrusionTooThick,
                    format!(
                        "{area:.2} mm² of plastic along the path, max_extrude_cross_section is {:.2} mm²",
                        extruder.cross_section_max_mm2
                    ),
                );
            }
        }
        Ok(())
    }
}

/// Where a move really ends: filament that is pushed or pulled with next to no travel leaves the head where it is, and so
/// little of both leaves everything.
pub(crate) fn settled(from: Position, to: Position) -> Position {
    let [x, y, z, filament] = core::array::from_fn(|axis| to[axis] - from[axis]);
    let (travel, filament) = (libm::sqrt(x * x + y * y + z * z), filament.abs());
    if travel.max(filament) < NOTHING_MM {
        from
    } else if travel < ON_THE_SPOT_MM && filament > travel {
        [from[0], from[1], from[2], to[3]]
    } else {
        to
    }
}

/// What offsets and inches leave of a place that is named again is no way, in mm.
const ON_THE_SPOT_MM: f64 = 1e-6;
/// A move without length, in mm: the look-ahead drops it.
const NOTHING_MM: f64 = 1e-9;
/// See [`Guard::judge`]: extrusion over less than this travel is not judged by its ratio, in mm.
const DAB_MM: f64 = 0.4;
