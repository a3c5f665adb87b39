//! What a plan takes, move by move and in sums: by the kind of extrusion, and by layer.
//!
//! Fed with planned moves and with the slicer's comments between them, in the order of the plan. Keeps sums only: bounded by
//! [`LAYERS_MAX`]. Knows no vertices and no steps. All sums of time together are the print time.

use gcode::Annotation;
use motion::PlannedMove;
use units::{Mm, MmPerS, MmPerS2, Seconds};

use crate::{
    machine::EXTRUDER,
    preview::{
        layers::{LAYERS_MAX, Layers},
        vertex::{FEATURE_UNNAMED, FEATURES, feature_number},
    },
};

/// The kinds of extrusion by their numbers (`docs/vertex.md`).
pub const FEATURE_NAMES: [&str; FEATURES] = [
    "inner_wall",
    "outer_wall",
    "overhang_wall",
    "infill",
    "solid_infill",
    "top_surface",
    "bottom_surface",
    "ironing",
    "bridge",
    "gap_fill",
    "skirt",
    "support",
    "support_interface",
    "prime_tower",
    "raft",
    "custom",
    "other",
];
/// Places nearer than this are the same.
const SAME_PLACE_MM: f64 = 1e-6;

/// What a move is counted under.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MoveKind {
    /// It lays filament for the feature of this number (`docs/vertex.md`).
    Extrusion(u8),
    /// It moves the head and lays none.
    Travel,
    /// It moves filament on the spot.
    Filament,
}

/// One planned move, as an onlooker sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveEstimate {
    /// The line of the file; of a move that no line asked for 0.
    pub line: u32,
    /// What it is counted under.
    pub kind: MoveKind,
    /// Its layer, counted from 0.
    pub layer: u32,
    /// How long it takes.
    pub time: Seconds,
    /// Its highest speed along the path.
    pub peak_speed: MmPerS,
    /// Its length over its time.
    pub mean_speed: MmPerS,
    /// Its strongest acceleration along the path, either way.
    pub accel: MmPerS2,
    /// What is laid, mm³ a second, on the whole; of a move that pulls filament back it is negative.
    pub flow_mm3_s: f64,
    /// Filament pushed, or pulled back.
    pub filament: Mm,
}

impl MoveEstimate {
    /// Of a planned move; `filament_area_mm2` is the section of the filament.
    pub fn new(planned: &PlannedMove, kind: MoveKind, layer: u32, filament_area_mm2: f64) -> Self {
        let time = planned.duration();
        let filament = planned.to[EXTRUDER] - planned.from[EXTRUDER];
        let over_time = |amount: f64| if time > 0.0 { amount / time } else { 0.0 };
        let accel = planned.phases().fold(0.0_f64, |most, phase| {
            let end = phase.accel + phase.jerk * phase.duration;
            most.max(phase.accel.abs()).max(end.abs())
        });
        Self {
            line: planned.tag,
            kind,
            layer,
            time: Seconds(time),
            peak_speed: MmPerS(planned.cruise_velocity),
            mean_speed: MmPerS(over_time(planned.length)),
            accel: MmPerS2(accel),
            flow_mm3_s: over_time(filament * filament_area_mm2),
            filament: Mm(filament),
        }
    }
}

/// Time and filament of moves that belong together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Total {
    /// Print time.
    pub time: Seconds,
    /// Filament laid; what is pulled back and pushed again on the spot does not count.
    pub filament: Mm,
}

impl Total {
    fn add(&mut self, time: Seconds, filament: Mm) {
        self.time += time;
        self.filament = Mm(self.filament.0 + filament.0);
    }
}

/// What a layer takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerTotal {
    /// Its first line.
    pub first_line: u32,
    /// The nozzle's height at its first extrusion.
    pub z: Mm,
    /// Time and filament.
    pub total: Total,
}

/// Adds up a plan.
#[derive(Debug)]
pub struct Estimates {
    filament_area_mm2: f64,
    layers: Layers,
    feature: u8,
    features: [Total; FEATURES],
    travel: Total,
    filament: Total,
    pauses: Seconds,
    by_layer: Vec<Total>,
}

impl Estimates {
    /// Of a machine whose filament has this section.
    pub fn new(filament_area_mm2: f64) -> Self {
        Self {
            filament_area_mm2,
            layers: Layers::new(),
            feature: FEATURE_UNNAMED,
            features: [Total::default(); FEATURES],
            travel: Total::default(),
            filament: Total::default(),
            pauses: Seconds::ZERO,
            by_layer: Vec::new(),
        }
    }

    /// A comment of the slicer's, before the moves that follow it.
    pub fn annotate(&mut self, line: u32, annotation: &Annotation) {
        match annotation {
            Annotation::Feature(feature) => self.feature = feature_number(*feature),
            Annotation::LayerChange | Annotation::Layer(_) => self.layers.announce(line),
            _ => {}
        }
    }

    /// The next move of the plan.
    pub fn take(&mut self, planned: &PlannedMove) -> MoveEstimate {
        let filament = planned.to[EXTRUDER] - planned.from[EXTRUDER];
        let travels =
            (0..EXTRUDER).any(|axis| (planned.to[axis] - planned.from[axis]).abs() >= SAME_PLACE_MM);
        let kind = match (travels, filament > 0.0) {
            (false, _) => MoveKind::Filament,
            (true, false) => MoveKind::Travel,
            (true, true) => MoveKind::Extrusion(self.feature),
        };
        if travels {
            self.layers.segment(0, planned.tag, filament > 0.0, planned.to[2]);
        }
        let layer = self.layers.number();
        let estimate = MoveEstimate::new(planned, kind, layer, self.filament_area_mm2);
        let laid = if matches!(kind, MoveKind::Extrusion(_)) { estimate.filament } else { Mm::ZERO };
        let sum = match kind {
            MoveKind::Extrusion(feature) => &mut self.features[usize::from(feature).min(FEATURES - 1)],
            MoveKind::Travel => &mut self.travel,
            MoveKind::Filament => &mut self.filament,
        };
        sum.add(estimate.time, laid);
        self.add_to_layer(estimate.time, laid);
        estimate
    }

    /// Time of the plan in which nothing moves.
    pub fn pause(&mut self, time: Seconds) {
        self.pauses += time;
        self.add_to_layer(time, Mm::ZERO);
    }

    fn add_to_layer(&mut self, time: Seconds, laid: Mm) {
        let layer = (self.layers.number() as usize).min(LAYERS_MAX - 1);
        if self.by_layer.len() <= layer {
            self.by_layer.resize(layer + 1, Total::default());
        }
        self.by_layer[layer].add(time, laid);
    }

    /// What each kind of extrusion takes that occurs, by its name ([`FEATURE_NAMES`]), and what is none: `travel`, moves of
    /// the filament on the spot (`retraction`), and `pause`, dwells and what filters add before and after a run of motion.
    pub fn features(&self) -> impl Iterator<Item = (&'static str, Total)> {
        let pause = Total { time: self.pauses, filament: Mm::ZERO };
        let others = [("travel", self.travel), ("retraction", self.filament), ("pause", pause)];
        let all = FEATURE_NAMES.into_iter().zip(self.features).chain(others);
        all.filter(|(_, total)| *total != Total::default())
    }

    /// What each layer takes, from the lowest; the last has all beyond [`LAYERS_MAX`].
    pub fn layers(&self) -> impl Iterator<Item = LayerTotal> {
        let of = |number: usize| self.by_layer.get(number).copied().unwrap_or_default();
        let all = self.layers.list().iter().enumerate();
        all.map(move |(number, layer)| LayerTotal {
            first_line: layer.first_line,
            z: layer.z,
            total: of(number),
        })
    }
}
