//! From moves to vertices.
//!
//! Knows what moves, comments and filament mean to an onlooker; knows no limits and no speeds. One vertex is held back,
//! because what happens on the spot is said of the vertex already there. Lengths in mm.

use gcode::{Annotation, Move};

use super::layers::Layers;
use super::objects::Objects;
use super::vertex::{
    FEATURE_UNNAMED, FEATURES, Flags, Grid, TOOLS, Vertex, feature_number, height_units, width_units,
};

/// The most vertices of a file: 4 GiB of them.
pub const VERTICES_MAX: u32 = 1 << 28;
/// A line's number is told for one vertex in so many at least.
const MARK_INTERVAL: u32 = 32;
/// A vertex that comes so many lines behind the one before has a mark of its own.
const LINE_STEP_MAX: u32 = 255;
/// Places nearer than this are the same.
const SAME_PLACE_MM: f64 = 1e-6;
/// A loop has at least so many segments.
const LOOP_SEGMENTS_MIN: u32 = 3;
/// A loop's ends are this near each other where its width is not known.
const LOOP_GAP_MM: f64 = 0.5;
const OUTER_WALL: u8 = 1;
const OVERHANG_WALL: u8 = 2;

/// What a segment is counted under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Segment {
    /// It lays no filament, or goes nowhere.
    Travel,
    /// It lays filament for this feature.
    Extrusion(u8),
}

/// An outer wall that is being laid.
#[derive(Clone, Copy, Debug)]
struct Loop {
    start_mm: [f64; 3],
    segments: u32,
}

/// Makes vertices.
#[derive(Debug)]
pub(super) struct Encoder {
    grid: Grid,
    filament_area_mm2: f64,
    held: Option<Vertex>,
    /// Where the held vertex is.
    at_mm: [f64; 3],
    /// The way to the next place is not known.
    broken: bool,
    feature: u8,
    /// As the file's comments say.
    width_mm: Option<f64>,
    height_mm: Option<f64>,
    tool: u32,
    wall: Option<Loop>,
    /// What happened where no vertex is yet.
    pending: Flags,
    next_mark: u32,
    last_line: u32,
    /// Vertices, the held one among them.
    pub(super) count: u32,
    pub(super) clamped: u64,
    pub(super) left_out: u64,
    pub(super) layers: Layers,
    pub(super) filament_mm: [f64; FEATURES],
    /// What each tool lays; those beyond the last count as that.
    pub(super) tool_filament_mm: [f64; TOOLS],
    /// Pairs of a line and the vertex at which its segment ends.
    pub(super) marks: Vec<u32>,
    /// How many lines further each vertex comes from than the one before it.
    pub(super) line_steps: Vec<u8>,
    pub(super) objects: Objects,
}

const fn place(position: gcode::Position) -> [f64; 3] {
    [position.x, position.y, position.z]
}

/// Whether a move leads nowhere.
pub(super) fn is_on_the_spot(mv: &Move) -> bool {
    distance(place(mv.from), place(mv.to)) < SAME_PLACE_MM
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|axis| a[axis] - b[axis]);
    libm::sqrt(x * x + y * y + z * z)
}

impl Encoder {
    pub(super) fn new(grid: Grid, filament_area_mm2: f64) -> Self {
        Self {
            grid,
            filament_area_mm2,
            held: None,
            at_mm: [0.0; 3],
            broken: false,
            feature: FEATURE_UNNAMED,
            width_mm: None,
            height_mm: None,
            tool: 0,
            wall: None,
            pending: Flags::default(),
            next_mark: 0,
            last_line: 0,
            count: 0,
            clamped: 0,
            left_out: 0,
            layers: Layers::new(),
            filament_mm: [0.0; FEATURES],
            tool_filament_mm: [0.0; TOOLS],
            marks: Vec::new(),
            line_steps: Vec::new(),
            objects: Objects::default(),
        }
    }

    pub(super) const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The head goes somewhere by a way that no move describes.
    pub(super) fn lose_way(&mut self) {
        self.broken = true;
    }

    pub(super) fn select_tool(&mut self, tool: u32) {
        // The first one is not changed to.
        if tool != self.tool && self.count > 0 {
            self.event(Flags::TOOL_CHANGE);
        }
        self.tool = tool;
    }

    /// Something happens where the nozzle is.
    pub(super) fn event(&mut self, event: Flags) {
        match &mut self.held {
            Some(held) if !self.broken => held.flags = held.flags.and(event),
            _ => self.pending = self.pending.and(event),
        }
    }

    pub(super) fn annotate(&mut self, line: u32, annotation: &Annotation) {
        match annotation {
            Annotation::Feature(feature) => self.feature = feature_number(*feature),
            Annotation::LayerChange | Annotation::Layer(_) => self.layers.announce(line),
            Annotation::Width(width) => self.width_mm = Some(width.0),
            Annotation::Height(height) => self.height_mm = Some(height.0),
            _ => {}
        }
    }

    /// Takes a move, appends vertices to `out`, and says what the move is.
    pub(super) fn mv(&mut self, mv: &Move, out: &mut Vec<u32>) -> Segment {
        let (from, to) = (place(mv.from), place(mv.to));
        let filament = mv.to.e - mv.from.e;
        let length = distance(from, to);
        if length < SAME_PLACE_MM {
            if filament != 0.0 {
                self.end_wall();
                let flag = if filament < 0.0 { Flags::RETRACT } else { Flags::UNRETRACT };
                self.start_from(from, mv.line.0, out);
                if let Some(held) = &mut self.held {
                    held.flags = held.flags.and(flag);
                }
            }
            return Segment::Travel;
        }
        let extrudes = filament > 0.0;
        self.follow_wall(extrudes, from);
        self.start_from(from, mv.line.0, out);
        let layer = self.layers.segment(self.count, mv.line.0, extrudes, to[2]);
        let mut flags = Flags::default();
        if !extrudes {
            flags = Flags::TRAVEL;
        }
        if filament < 0.0 {
            flags = flags.and(Flags::RETRACT).and(Flags::WIPE);
        }
        let (width, height) = if extrudes { self.bead(filament, length) } else { (0.0, 0.0) };
        let vertex = Vertex {
            width: width_units(width),
            height: height_units(height),
            feature: self.feature,
            flags,
            layer,
            tool: self.tool,
            object: self.objects.current,
            ..Vertex::default()
        };
        self.hold(vertex, to, mv.line.0, out);
        if !extrudes {
            return Segment::Travel;
        }
        self.filament_mm[usize::from(self.feature).min(FEATURES - 1)] += filament;
        self.tool_filament_mm[(self.tool as usize).min(TOOLS - 1)] += filament;
        self.objects.lay(filament);
        Segment::Extrusion(self.feature)
    }

    /// The bead's width and height; 0 where they are not known.
    fn bead(&self, filament: f64, length: f64) -> (f64, f64) {
        let Some(height) = self.height_mm.or_else(|| self.layers.height_mm()) else {
            return (self.width_mm.unwrap_or(0.0), 0.0);
        };
        // A bead has the section of a rectangle with half circles at its ends.
        let section = filament * self.filament_area_mm2 / length;
        let by_volume = section / height + height * (1.0 - core::f64::consts::FRAC_PI_4);
        (self.width_mm.unwrap_or(by_volume), height)
    }

    /// Makes sure that the held vertex is where the next segment starts.
    fn start_from(&mut self, from: [f64; 3], line: u32, out: &mut Vec<u32>) {
        let is_near = self.at_mm == from || distance(self.at_mm, from) < SAME_PLACE_MM;
        let is_there = self.held.is_some() && !self.broken && is_near;
        if !is_there {
            let layer = self.layers.number();
            let vertex = Vertex {
                flags: Flags::BREAK.and(Flags::TRAVEL).and(core::mem::take(&mut self.pending)),
                feature: self.feature,
                layer,
                tool: self.tool,
                object: self.objects.current,
                ..Vertex::default()
            };
            self.hold(vertex, from, line, out);
            self.broken = false;
        }
    }

    fn hold(&mut self, vertex: Vertex, place_mm: [f64; 3], line: u32, out: &mut Vec<u32>) {
        if self.count >= VERTICES_MAX {
            self.left_out += 1;
            return;
        }
        self.release(out);
        let (steps, inside) = self.grid.steps(place_mm);
        self.clamped += u64::from(!inside);
        self.held = Some(Vertex { steps, ..vertex });
        self.at_mm = place_mm;
        self.mark(line);
        self.count += 1;
    }

    fn release(&mut self, out: &mut Vec<u32>) {
        if let Some(vertex) = self.held.take() {
            out.extend_from_slice(&vertex.pack());
        }
    }

    /// The next vertex comes from this line.
    fn mark(&mut self, line: u32) {
        let step = line.saturating_sub(self.last_line).min(LINE_STEP_MAX);
        self.line_steps.push(step as u8);
        self.last_line = line;
        if step == LINE_STEP_MAX || self.count >= self.next_mark {
            self.marks.extend_from_slice(&[line, self.count]);
            self.next_mark = self.count + MARK_INTERVAL;
        }
    }

    fn follow_wall(&mut self, extrudes: bool, from: [f64; 3]) {
        let is_wall =
            extrudes && (self.feature == OUTER_WALL || self.feature == OVERHANG_WALL && self.wall.is_some());
        if !is_wall {
            self.end_wall();
            return;
        }
        self.wall.get_or_insert(Loop { start_mm: from, segments: 0 }).segments += 1;
    }

    /// A wall has ended at the held vertex. Where it ends at its start, that is its seam.
    fn end_wall(&mut self) {
        let Some(wall) = self.wall.take() else { return };
        let gap = self.width_mm.unwrap_or(LOOP_GAP_MM);
        if wall.segments >= LOOP_SEGMENTS_MIN
            && distance(self.at_mm, wall.start_mm) <= gap
            && let Some(held) = &mut self.held
        {
            held.flags = held.flags.and(Flags::SEAM);
        }
    }

    /// No more moves come.
    pub(super) fn finish(&mut self, out: &mut Vec<u32>) {
        self.end_wall();
        if let Some(held) = &mut self.held {
            held.flags = held.flags.and(core::mem::take(&mut self.pending));
        }
        self.release(out);
    }
}
