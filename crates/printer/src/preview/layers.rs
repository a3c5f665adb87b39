//! Where layers begin.
//!
//! A file with a slicer's comments says it; in one without, extrusion at another height begins a layer. A layer without
//! extrusion is none: it is joined to the one after it. Heights in mm.

use units::Mm;

use super::vertex::LAYER_MAX;

/// The most layers that are told apart: what follows belongs to the last.
pub const LAYERS_MAX: usize = 65_536;
/// Without comments, extrusion must be this much higher or lower to be of another layer: spirals rise all the time.
const LAYER_STEP_MIN_MM: f64 = 0.04;
/// A thicker layer is none: the difference of heights means something else.
const HEIGHT_MAX_MM: f64 = 2.0;

/// A layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Layer {
    /// Its first vertex.
    pub(crate) first_vertex: u32,
    /// Whoever begins with this line makes the whole layer and nothing of those before.
    pub(crate) first_line: u32,
    /// The nozzle's height at its first extrusion.
    pub(crate) z: Mm,
}

/// Tells layers apart.
#[derive(Debug)]
pub(crate) struct Layers {
    list: Vec<Layer>,
    /// The present one's height is known.
    z_known: bool,
    /// The file has comments on layers.
    commented: bool,
    /// A comment in this line has announced a layer.
    announced: Option<u32>,
    /// The present one has extrusion in it.
    extruded: bool,
    /// The line behind the last that extruded.
    behind_extrusion: u32,
    below_mm: f64,
}

impl Layers {
    pub(crate) fn new() -> Self {
        Self {
            list: vec![Layer { first_vertex: 0, first_line: 1, z: Mm::ZERO }],
            z_known: false,
            commented: false,
            announced: None,
            extruded: false,
            behind_extrusion: 1,
            below_mm: 0.0,
        }
    }

    /// A comment in this line says that a layer begins.
    pub(crate) fn announce(&mut self, line: u32) {
        if self.commented {
            self.announced = Some(line);
        } else {
            // What came before is the start G-code: it belongs to the first layer, whatever its height.
            self.commented = true;
            self.z_known = false;
            self.extruded = false;
            self.below_mm = 0.0;
        }
    }

    /// A line's segment is about to end in the vertex of this number. Says which layer it is in.
    pub(crate) fn segment(&mut self, next_vertex: u32, line: u32, extrudes: bool, z_mm: f64) -> u32 {
        let rises = !self.commented
            && extrudes
            && self.z_known
            && (z_mm - self.current().z.0).abs() >= LAYER_STEP_MIN_MM;
        if let Some(announced) = self.announced.take() {
            if self.extruded {
                self.begin(next_vertex, announced);
            }
        } else if rises {
            self.begin(next_vertex, self.behind_extrusion);
        }
        if extrudes {
            self.behind_extrusion = line.saturating_add(1);
            self.extruded = true;
            if !self.z_known {
                self.z_known = true;
                if let Some(layer) = self.list.last_mut() {
                    layer.z = Mm(z_mm);
                }
            }
        }
        self.number()
    }

    fn begin(&mut self, next_vertex: u32, first_line: u32) {
        if self.list.len() < LAYERS_MAX {
            self.below_mm = self.current().z.0;
            self.list.push(Layer { first_vertex: next_vertex, first_line, z: self.current().z });
            self.z_known = false;
            self.extruded = false;
        }
    }

    pub(crate) fn current(&self) -> Layer {
        self.list.last().copied().unwrap_or(Layer { first_vertex: 0, first_line: 1, z: Mm::ZERO })
    }

    /// The present layer.
    pub(crate) fn number(&self) -> u32 {
        (self.list.len() as u32).saturating_sub(1).min(LAYER_MAX)
    }

    /// How thick the present layer is, by its height above the one below; `None` where that cannot be.
    pub(super) fn height_mm(&self) -> Option<f64> {
        let height = self.current().z.0 - self.below_mm;
        (self.z_known && height > 0.0 && height <= HEIGHT_MAX_MM).then_some(height)
    }

    /// All of them.
    pub(crate) fn list(&self) -> &[Layer] {
        &self.list
    }
}
