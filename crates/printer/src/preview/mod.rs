//! A file as an onlooker sees it: geometry for a 3D view, what it holds, what is wrong with it, how long it takes.
//!
//! Reads a file once, in pieces, and makes vertices ([`vertex`]) as it goes. Bounded: it takes at most
//! [`Preview::wants`] bytes at a time and makes at most [`RUN_WORDS_MAX`] words at a time, however much an arc unfolds to.
//! Knows no screen and no session, and never touches a running print. Positions in mm, times in seconds.

mod channels;
mod encoder;
mod estimate;
#[cfg(test)]
mod geometry_tests;
pub(crate) mod layers;
mod objects;
mod pictures;
#[cfg(test)]
mod story_tests;
#[cfg(test)]
mod tests;
pub mod vertex;

use std::collections::VecDeque;

use gcode::{Action, Annotation, CHORD_TOLERANCE, Chords, LineNumber, Move, PauseReason};
use motion::Bend;
use units::{Mm, Seconds};

use self::{
    channels::Channels,
    encoder::Encoder,
    estimate::{Asking, Estimate},
    pictures::Pictures,
    vertex::{FEATURES, Flags, Grid, WORDS},
};
use crate::{
    arcs,
    check::{CheckReport, Checker},
    config::PrinterConfig,
};

pub use channels::CHANNEL_WORDS;
pub use encoder::VERTICES_MAX;
pub use layers::LAYERS_MAX;
pub use objects::{OBJECTS_MAX, ObjectReport};
pub use pictures::{PictureFormat, THUMBNAIL_BYTES_MAX, THUMBNAIL_SIDE_MAX, THUMBNAILS_MAX, Thumbnail};

/// The most bytes that wait to be read.
pub const INPUT_BYTES_MAX: usize = 256 * 1024;
/// After so many words a call of [`Preview::run`] returns: 4 MiB. It may be a few vertices more.
pub const RUN_WORDS_MAX: usize = 256 * 1024 * WORDS;
/// Bytes that are turned into actions at once: it bounds how many actions wait.
const PIECE_BYTES: usize = 4096;
/// The filament where no machine says: 1.75 mm.
const FILAMENT_AREA_MM2: f64 = core::f64::consts::PI * 1.75 * 1.75 / 4.0;

/// A layer of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerReport {
    /// Its first vertex.
    pub first_vertex: u32,
    /// Its first line: a print that begins there makes the whole layer and nothing of those before.
    pub first_line: u32,
    /// The nozzle's height at its first extrusion.
    pub z: Mm,
    /// Print time; 0 without a machine.
    pub time: Seconds,
}

/// What a kind of extrusion takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureReport {
    /// Its number in the vertices.
    pub feature: u8,
    /// Print time; 0 without a machine.
    pub time: Seconds,
    /// Filament laid.
    pub filament: Mm,
}

/// What is printed by one tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolReport {
    /// Its number in the vertices.
    pub tool: u8,
    /// Filament laid.
    pub filament: Mm,
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewReport {
    /// What is wrong with it.
    pub check: CheckReport,
    /// Vertices, all together.
    pub vertices: u32,
    /// Places outside the grid, moved to its edge.
    pub clamped: u64,
    /// Vertices beyond [`VERTICES_MAX`].
    pub left_out: u64,
    /// Layers, at least one.
    pub layers: Vec<LayerReport>,
    /// The kinds of extrusion that occur.
    pub features: Vec<FeatureReport>,
    /// The objects that the file names; the first has number 1 in the vertices.
    pub objects: Vec<ObjectReport>,
    /// The tools that lay filament.
    pub tools: Vec<ToolReport>,
    /// Print time of the whole; `None` without a machine, or where a move cannot be planned.
    pub print_time: Option<Seconds>,
    /// Of it, moving without extruding, and dwells.
    pub travel_time: Seconds,
    /// What the slicer thought.
    pub slicer_time: Option<Seconds>,
    /// The slicer.
    pub generator: Option<String>,
}

/// Reads a file.
#[derive(Debug)]
pub struct Preview {
    checker: Checker,
    encoder: Encoder,
    estimate: Option<Estimate>,
    input: Vec<u8>,
    /// How much of `input` has been read.
    taken: usize,
    actions: VecDeque<(Action, LineNumber)>,
    arc: Option<Chords>,
    read_bytes: u64,
    ended: bool,
    finished: bool,
    slicer_time: Option<Seconds>,
    generator: Option<String>,
    pictures: Pictures,
}

impl Preview {
    /// A preview for a machine, or of the G-code alone.
    pub fn new(config: Option<&PrinterConfig>) -> Self {
        Self::with(Checker::new(config), config.and_then(Estimate::new), config)
    }

    /// A preview that makes the vertices that [`Self::new`] makes for the machine, and nothing that takes longer: no
    /// times, and nothing of what the machine cannot do.
    pub fn outline(config: &PrinterConfig) -> Self {
        Self::with(Checker::reader(config), None, Some(config))
    }

    fn with(mut checker: Checker, estimate: Option<Estimate>, config: Option<&PrinterConfig>) -> Self {
        let machine = config.map(|config| {
            let [low, high] = [
                config.steppers.each_ref().map(|axis| axis.position_min.0),
                config.steppers.each_ref().map(|axis| axis.position_max.0),
            ];
            [low, high]
        });
        let extruder = config.and_then(|config| config.extruder.as_ref());
        let area = extruder.map_or(FILAMENT_AREA_MM2, crate::config::ExtruderConfig::filament_area_mm2);
        checker.show_pictures();
        Self {
            checker,
            encoder: Encoder::new(Grid::around(machine), area),
            estimate,
            input: Vec::new(),
            taken: 0,
            actions: VecDeque::new(),
            arc: None,
            read_bytes: 0,
            ended: false,
            finished: false,
            slicer_time: None,
            generator: None,
            pictures: Pictures::default(),
        }
    }

    /// The grid that the vertices lie on.
    pub const fn grid(&self) -> &Grid {
        self.encoder.grid()
    }

    /// How many bytes may be fed now.
    pub fn wants(&self) -> usize {
        if self.ended { 0 } else { INPUT_BYTES_MAX - (self.input.len() - self.taken) }
    }

    /// Takes the next bytes of the file. Those beyond [`Self::wants`] are not taken; returns how many were.
    pub fn feed(&mut self, bytes: &[u8]) -> usize {
        let count = bytes.len().min(self.wants());
        self.input.drain(..core::mem::take(&mut self.taken));
        self.input.extend_from_slice(&bytes[..count]);
        count
    }

    /// Says that the file has ended.
    pub fn end(&mut self) {
        self.ended = true;
    }

    /// How many bytes have been read.
    pub const fn read_bytes(&self) -> u64 {
        self.read_bytes
    }

    /// Works on what was fed, and appends vertices to `out`; returns whether there is more to do without more input.
    pub fn run(&mut self, out: &mut Vec<u32>) -> bool {
        let enough = out.len() + RUN_WORDS_MAX;
        loop {
            if out.len() >= enough {
                return true;
            }
            if let Some(piece) = self.arc.as_mut().and_then(Chords::next_piece) {
                self.mv(&piece.chord, Some(&arcs::bend(&piece)), out);
                continue;
            }
            self.arc = None;
            if let Some((action, line)) = self.actions.pop_front() {
                self.act(action, line, out);
            } else if self.taken < self.input.len() {
                self.read_piece();
            } else if self.ended && !self.finished {
                self.finished = true;
                self.checker.end_with(|action, line| self.actions.push_back((action, line)));
            } else {
                if self.finished {
                    self.encoder.finish(out);
                }
                return false;
            }
        }
    }

    fn read_piece(&mut self) {
        let end = self.input.len().min(self.taken + PIECE_BYTES);
        let piece = &self.input[self.taken..end];
        self.checker.feed_with(piece, |action, line| self.actions.push_back((action, line)));
        self.read_bytes += piece.len() as u64;
        self.taken = end;
    }

    fn act(&mut self, action: Action, line: LineNumber, out: &mut Vec<u32>) {
        if let Some(estimate) = &mut self.estimate {
            estimate.act(&action);
            self.checker.add(estimate.too_fast.take());
        }
        match action {
            Action::Move(mv) => self.mv(&mv, None, out),
            Action::Arc(arc) => self.arc = Some(arc.chords(CHORD_TOLERANCE)),
            Action::Home { .. } => self.encoder.lose_way(),
            Action::SelectTool(tool) => self.encoder.select_tool(tool),
            Action::Object(object) => self.encoder.objects.act(object),
            Action::Pause(PauseReason::Requested) => self.encoder.event(Flags::PAUSE),
            Action::Pause(PauseReason::FilamentChange) => {
                self.encoder.event(Flags::PAUSE.and(Flags::FILAMENT_CHANGE));
            }
            Action::Annotation(Annotation::Picture(line)) => self.pictures.read(&line),
            Action::Annotation(Annotation::EstimatedTime(time)) => self.slicer_time = Some(time),
            Action::Annotation(Annotation::Generator(name)) => self.generator = Some(name),
            Action::Annotation(annotation) => self.encoder.annotate(line.0, &annotation),
            _ => {}
        }
    }

    fn mv(&mut self, mv: &Move, bend: Option<&Bend>, out: &mut Vec<u32>) {
        let before = self.encoder.count;
        let segment = self.encoder.mv(mv, out);
        // The last of the vertices that it has made is its end; on the spot it makes none of its own.
        let has_end = self.encoder.count > before && !encoder::is_on_the_spot(mv);
        let vertex = has_end.then(|| self.encoder.count - 1);
        if let Some(estimate) = &mut self.estimate {
            estimate.mv(&Asking { mv, bend, segment, layer: self.encoder.layers.number(), vertex });
            self.checker.add(estimate.too_fast.take());
        }
    }

    /// Works on what was fed as [`Self::run`] does, but for what the planner knows alone: vertices, and what belongs to them,
    /// go to nobody.
    pub fn run_on(&mut self) -> bool {
        let mut vertices = Vec::new();
        let has_more = self.run(&mut vertices);
        self.encoder.marks.clear();
        self.encoder.line_steps.clear();
        self.pictures.take();
        has_more
    }

    /// Asks for the [planner channels](`Self::take_channels`), before the first byte. Without a machine there are none.
    pub fn want_channels(&mut self) {
        if let Some(estimate) = &mut self.estimate {
            estimate.channels = Some(Channels::default());
        }
    }

    /// What the planner knows of the vertices that it has planned since the last call: [`CHANNEL_WORDS`] for each, in their order
    /// (`docs/vertex.md`). Once [`Self::run`] has come to the file's end, the last of them.
    pub fn take_channels(&mut self) -> Vec<u32> {
        let Some(estimate) = &mut self.estimate else { return Vec::new() };
        if self.finished && self.actions.is_empty() && self.arc.is_none() {
            estimate.end_run();
            estimate.channels.iter_mut().for_each(|channels| channels.fill(self.encoder.count));
        }
        estimate.channels.as_mut().map(Channels::take).unwrap_or_default()
    }

    /// Pairs of a line of the file and the vertex where its segment ends, one for some dozens of vertices, in order:
    /// with them a print's line leads to a place in the view.
    pub fn take_marks(&mut self) -> Vec<u32> {
        core::mem::take(&mut self.encoder.marks)
    }

    /// How many lines further than the vertex before it each vertex comes from, new since the last call; 255 where that is
    /// more, which then has a mark.
    pub fn take_line_steps(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.encoder.line_steps)
    }

    /// The file's pictures of the print, new since the last call: at most [`THUMBNAILS_MAX`] all together.
    pub fn take_thumbnails(&mut self) -> Vec<Thumbnail> {
        self.pictures.take()
    }

    /// What the file holds. Works on what is left; its vertices go to nobody.
    pub fn finish(mut self) -> PreviewReport {
        self.end();
        while self.run_on() {}
        let print_time = self.estimate.as_mut().and_then(Estimate::finish);
        self.checker.add(self.estimate.as_mut().and_then(|estimate| estimate.too_fast.take()));
        let (features, layer_s) = self.totals();
        let in_features: f64 = features.iter().map(|feature| feature.time.0).sum();
        let layers = self.encoder.layers.list().iter().enumerate().map(|(number, layer)| LayerReport {
            first_vertex: layer.first_vertex,
            first_line: layer.first_line,
            z: layer.z,
            time: Seconds(layer_s.get(number).copied().unwrap_or(0.0)),
        });
        let tools = self.encoder.tool_filament_mm.into_iter().enumerate();
        PreviewReport {
            vertices: self.encoder.count,
            clamped: self.encoder.clamped,
            left_out: self.encoder.left_out,
            layers: layers.collect(),
            features,
            tools: tools
                .filter(|&(_, filament)| filament > 0.0)
                .map(|(tool, filament)| ToolReport { tool: tool as u8, filament: Mm(filament) })
                .collect(),
            objects: self.encoder.objects.into_list(),
            print_time,
            travel_time: Seconds(print_time.map_or(0.0, |time| (time.0 - in_features).max(0.0))),
            slicer_time: self.slicer_time,
            generator: self.generator,
            check: self.checker.finish(),
        }
    }

    /// What each kind of extrusion takes, and how long each layer.
    fn totals(&mut self) -> (Vec<FeatureReport>, Vec<f64>) {
        let (feature_s, layer_s) = match &mut self.estimate {
            Some(estimate) => (estimate.feature_s, core::mem::take(&mut estimate.layer_s)),
            None => ([0.0; FEATURES], Vec::new()),
        };
        let of = |feature: usize| FeatureReport {
            feature: feature as u8,
            time: Seconds(feature_s[feature]),
            filament: Mm(self.encoder.filament_mm[feature]),
        };
        let all = (0..FEATURES).map(of);
        (all.filter(|feature| feature.filament.0 > 0.0).collect(), layer_s)
    }
}
