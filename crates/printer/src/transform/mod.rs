//! From the G-code's coordinates to those of the machine: first what makes up for axes that are not square, then what
//! makes up for a bed that is not flat.
//!
//! Both have an exact inverse. Positions in mm, the filament is not touched. Knows no motion: whoever plans a move takes it
//! apart with [`Transform::pieces`].

mod mesh;
mod pieces;
mod saved;
mod skew;
mod surface;
#[cfg(test)]
mod tests;

use core::fmt::Write as _;
use std::{collections::BTreeMap, sync::Arc};

use gcode::{Action, Interpreter, MeshChange, SkewChange};
use serde::{Deserialize, Serialize};

pub use mesh::{Fade, Mesh, MeshError, Z_ERROR_MAX_MM};
pub use pieces::{PIECE_MIN_MM, Pieces};
pub use saved::{MeshSettings, SavedMesh};
pub use skew::{SKEW_MAX, Skew};
pub use surface::{Cell, GridAxis, Interpolation, LAGRANGE_POINTS_MAX, Surface};

/// A mesh with more points than this along an axis is not written out.
const WRITTEN_POINTS_MAX: usize = 32;
/// So often a motor's place is bettered: each time what is missing becomes a tenth or less.
const MOTORS_PLACE_ROUNDS: u32 = 12;

/// What the machine file has that can be loaded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profiles {
    /// `[skew_correction NAME]`.
    pub skews: BTreeMap<String, Skew>,
    /// `[bed_mesh NAME]`.
    pub meshes: BTreeMap<String, SavedMesh>,
}

/// What is in force.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transform {
    skew: Skew,
    mesh: Option<Arc<Mesh>>,
}

/// What is in force, for a journal: with the machine file it says everything.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformRecord {
    /// What makes up for axes that are not square.
    pub skew: Skew,
    /// The name of the mesh.
    pub mesh: Option<String>,
}

impl TransformRecord {
    /// Whether nothing is in force.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl Transform {
    /// What a record tells of.
    pub fn recorded(record: &TransformRecord, profiles: &Profiles) -> Result<Self, String> {
        if !record.skew.is_possible() {
            return Err("the skew is none that an axis can have".to_owned());
        }
        let mesh = record.mesh.as_deref().map(|name| known_mesh(name, profiles)).transpose()?;
        Ok(Self { skew: record.skew, mesh })
    }

    /// For a journal.
    pub fn record(&self) -> TransformRecord {
        TransformRecord { skew: self.skew, mesh: self.mesh.as_ref().map(|mesh| mesh.name.clone()) }
    }

    /// Whether the machine goes where the G-code says.
    pub fn is_identity(&self) -> bool {
        self.mesh.is_none() && self.skew == Skew::default()
    }

    /// Whether axes that are not square are made up for.
    pub fn has_skew(&self) -> bool {
        self.skew != Skew::default()
    }

    /// The bed, where it is made up for.
    pub fn mesh(&self) -> Option<&Mesh> {
        self.mesh.as_deref()
    }

    /// What a line that changes it says; what there is to say to that. One that is wrong changes nothing.
    pub fn set(&mut self, action: &Action, profiles: &Profiles) -> Result<Option<String>, String> {
        match action {
            Action::Skew(change) => self.set_skew(change, profiles),
            Action::BedMesh(change) => self.set_mesh(change, profiles),
            _ => Ok(None),
        }
    }

    /// A line changes the skew; what there is to say to that. What is wrong with it is an error, and changes nothing.
    fn set_skew(&mut self, change: &SkewChange, profiles: &Profiles) -> Result<Option<String>, String> {
        match change {
            SkewChange::Clear => self.skew = Skew::default(),
            SkewChange::Load(name) => {
                let skew = profiles.skews.get(name);
                self.skew =
                    *skew.ok_or_else(|| format!("the machine file has no [skew_correction {name}]"))?;
            }
            SkewChange::Measured { xy, xz, yz } => {
                let factor = |lengths: &Option<[f64; 3]>, now: f64| match lengths {
                    None => Ok(now),
                    Some(lengths) => Skew::measured(*lengths).ok_or_else(|| no_parallelogram(*lengths)),
                };
                let Skew { xy: now_xy, xz: now_xz, yz: now_yz } = self.skew;
                self.skew =
                    Skew { xy: factor(xy, now_xy)?, xz: factor(xz, now_xz)?, yz: factor(yz, now_yz)? };
            }
            SkewChange::Report => {
                let Skew { xy, xz, yz } = self.skew;
                return Ok(Some(format!("skew: XY {xy:.6}, XZ {xz:.6}, YZ {yz:.6}")));
            }
            SkewChange::Calculate(lengths) => {
                let factor = Skew::measured(*lengths).ok_or_else(|| no_parallelogram(*lengths))?;
                let degrees = libm::atan(factor).to_degrees();
                return Ok(Some(format!("measured skew: {factor:.6}, which is {degrees:.2}°")));
            }
        }
        Ok(None)
    }

    /// The same of the bed's mesh.
    fn set_mesh(&mut self, change: &MeshChange, profiles: &Profiles) -> Result<Option<String>, String> {
        match change {
            MeshChange::Clear => self.mesh = None,
            MeshChange::Load(name) => self.mesh = Some(known_mesh(name, profiles)?),
            MeshChange::Report => {
                let text = self.mesh().map_or_else(|| "no mesh is in force".to_owned(), described);
                return Ok(Some(text));
            }
        }
        Ok(None)
    }

    /// Where a place is on the bed: not lifted yet.
    fn flat(&self, place: [f64; 3]) -> [f64; 3] {
        self.skew.machine_from_gcode(place)
    }

    /// Where the machine has to be for the head to be at a place of the G-code.
    pub fn machine_from_gcode(&self, place: [f64; 3]) -> [f64; 3] {
        if self.is_identity() {
            return place;
        }
        let flat = self.flat(place);
        self.mesh().map_or(flat, |mesh| mesh.machine_from_gcode(flat))
    }

    /// The place of the G-code at which the machine is.
    pub fn gcode_from_machine(&self, place: [f64; 3]) -> [f64; 3] {
        if self.is_identity() {
            return place;
        }
        self.skew.gcode_from_machine(self.mesh().map_or(place, |mesh| mesh.gcode_from_machine(place)))
    }

    /// Where one motor has to stand, while the others stay at `motors`, for the head to be at `wanted` on that axis in the
    /// G-code's coordinates.
    pub fn motors_place(&self, mut motors: [f64; 3], axis: usize, wanted: f64) -> f64 {
        if self.is_identity() {
            return wanted;
        }
        if axis == 2 {
            // A skew leaves Z as it is.
            let [x, y, _] = motors;
            return self.mesh().map_or(wanted, |mesh| mesh.machine_from_gcode([x, y, wanted])[2]);
        }
        // X and Y depend on the bed's height, and that on them, by a share of a share.
        for _ in 0..MOTORS_PLACE_ROUNDS {
            motors[axis] += wanted - self.gcode_from_machine(motors)[axis];
        }
        motors[axis]
    }

    /// Tells who reads G-code that these axes have been homed, and that the motors stand there: X and Y are where the
    /// skew has them for it, all those that lean with what was homed. Z counts as the endstop says, with a mesh too: the
    /// next move makes up for it.
    pub fn set_homed(&self, interpreter: &mut Interpreter, axes: [bool; 3], motors: [f64; 3]) {
        let [x, y, z] = motors;
        let z = if axes[2] { z } else { interpreter.position().z };
        let at = self.skew.gcode_from_machine([x, y, z]);
        if self.skew != Skew::default() {
            interpreter.stand_at(at[0], at[1], at[2]);
        }
        let [x, y, z] = core::array::from_fn(|axis| axes[axis].then_some(at[axis]));
        interpreter.set_axes(x, y, z);
    }

    /// The same where of the other axes nothing is known but what has been read.
    pub fn home(&self, interpreter: &mut Interpreter, axes: [bool; 3], endstops: [f64; 3]) {
        let gcode::Position { x, y, z, .. } = interpreter.position();
        let before = self.machine_from_gcode([x, y, z]);
        let motors = core::array::from_fn(|axis| if axes[axis] { endstops[axis] } else { before[axis] });
        self.set_homed(interpreter, axes, motors);
    }

    /// The least and the most that is ever added to Z.
    pub fn added_to_z(&self) -> [f64; 2] {
        self.mesh().map_or([0.0; 2], Mesh::added)
    }

    /// A straight move of the G-code (X, Y, Z, and the filament), as the machine has to make it.
    pub fn pieces(&self, from: [f64; 4], to: [f64; 4]) -> Pieces {
        Pieces::new(self, from, to)
    }
}

fn known_mesh(name: &str, profiles: &Profiles) -> Result<Arc<Mesh>, String> {
    let saved = profiles.meshes.get(name);
    let saved = saved.ok_or_else(|| format!("the machine file has no [bed_mesh {name}] that can be used"))?;
    saved.mesh().map_err(|problem| format!("[bed_mesh {name}] cannot be used: {problem}"))
}

fn no_parallelogram([ac, bd, ad]: [f64; 3]) -> String {
    format!("AC {ac}, BD {bd} and AD {ad} are not the lengths of a square that is a little skewed")
}

/// A mesh as text: its heights, the row of the greatest Y first, as one looks at the bed.
fn described(mesh: &Mesh) -> String {
    let surface = mesh.surface();
    let [x, y] = surface.axes;
    let heights = || surface.rows().flatten().copied();
    let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
    let mut text = format!(
        "mesh {}: X {:.1} to {:.1} mm, Y {:.1} to {:.1} mm, {} by {} points, {low:.3} to {high:.3} mm",
        mesh.name, x.min, x.max, y.min, y.max, x.count, y.count
    );
    if x.count <= WRITTEN_POINTS_MAX && y.count <= WRITTEN_POINTS_MAX {
        let rows: Vec<&[f64]> = surface.rows().collect();
        for row in rows.into_iter().rev() {
            text.push('\n');
            for height in row {
                // Writing to a string does not fail.
                let _ = write!(text, " {height:7.4}");
            }
        }
    }
    text
}
