//! What is drawn is what is planned: lengths and box, decoded from the vertices, against the planner's own moves and
//! against exact arcs.

use std::fmt::Write as _;

use super::vertex::{Flags, Vertex};
use super::*;
use crate::{config::parse, planner::PlanStream};

const MACHINE: &str = include_str!("../../../../samples/printer.cfg");
/// By `PrusaSlicer`, with relative extrusion; by Slic3r and by Cura, with absolute extrusion.
const SAMPLES: [(&str, &str); 3] = [
    ("PrusaSlicer", include_str!("../../../../samples/test-part.gcode")),
    ("Slic3r", include_str!("../../../../samples/test-part-small.gcode")),
    ("Cura", include_str!("../../../../samples/test-part-tiny.gcode")),
];
const BEGIN: &str = "G28\nG90\nM82\nM104 S200\n";
const INCH_MM: f64 = 25.4;

/// How far a file goes, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Way {
    extruding: f64,
    travelling: f64,
    low: [f64; 3],
    high: [f64; 3],
}

impl Way {
    const NONE: Self =
        Self { extruding: 0.0, travelling: 0.0, low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    fn add(&mut self, from: [f64; 3], to: [f64; 3], extrudes: bool) {
        let [x, y, z] = [0, 1, 2].map(|axis| to[axis] - from[axis]);
        let length = libm::sqrt(x * x + y * y + z * z);
        *(if extrudes { &mut self.extruding } else { &mut self.travelling }) += length;
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(from[axis]).min(to[axis]);
            self.high[axis] = self.high[axis].max(from[axis]).max(to[axis]);
        }
    }

    /// Lengths within this part of themselves; the box within this part of its size, or half a step of the grid.
    fn assert_near(&self, other: &Self, tolerance: f64, step_mm: f64, what: &str) {
        let near = |found: f64, expected: f64, slack: f64| (found - expected).abs() <= slack;
        assert!(other.extruding > 1.0 && other.travelling > 1.0, "{what}: {other:?}");
        assert!(
            near(self.extruding, other.extruding, tolerance * other.extruding)
                && near(self.travelling, other.travelling, tolerance * other.travelling),
            "{what}: {self:?} {other:?}"
        );
        for axis in 0..3 {
            let slack = (tolerance * (other.high[axis] - other.low[axis])).max(0.5 * step_mm) + 1e-9;
            assert!(
                near(self.low[axis], other.low[axis], slack)
                    && near(self.high[axis], other.high[axis], slack),
                "{what}, axis {axis}: {self:?} {other:?}"
            );
        }
    }
}

fn machine() -> PrinterConfig {
    parse(MACHINE).0.unwrap()
}

/// As a viewer has it, and its grid's step.
fn drawn(gcode: &str) -> (Way, f64) {
    let mut preview = Preview::new(Some(&machine()));
    let mut words = Vec::new();
    for piece in gcode.as_bytes().chunks(INPUT_BYTES_MAX) {
        assert_eq!(preview.feed(piece), piece.len());
        while preview.run(&mut words) {}
    }
    preview.end();
    while preview.run(&mut words) {}
    let grid = *preview.grid();
    let mut way = Way::NONE;
    let vertices: Vec<Vertex> = words.as_chunks().0.iter().map(|words| Vertex::unpack(*words)).collect();
    for pair in vertices.windows(2).filter(|pair| !pair[1].flags.has(Flags::BREAK)) {
        let [from, to] = [pair[0], pair[1]].map(|vertex| grid.place(vertex.steps));
        way.add(from, to, !pair[1].flags.has(Flags::TRAVEL));
    }
    assert_eq!(preview.finish().clamped, 0);
    (way, grid.step_mm)
}

/// As the planner makes it.
fn planned(gcode: &str) -> (Way, Vec<[[f64; 4]; 2]>) {
    let mut plan = PlanStream::new(&machine()).unwrap();
    let mut blocks = Vec::new();
    let (mut way, mut moves) = (Way::NONE, Vec::new());
    let mut each = |mv: &motion::PlannedMove| {
        let [from, to] = [mv.from, mv.to].map(|[x, y, z, _]| [x, y, z]);
        if from != to {
            way.add(from, to, mv.to[3] > mv.from[3]);
        }
        moves.push([mv.from, mv.to]);
    };
    for piece in gcode.as_bytes().chunks(32 * 1024) {
        plan.feed(piece, &mut blocks, &mut each).unwrap();
        blocks.clear();
    }
    plan.finish(&mut blocks, &mut each).unwrap();
    (way, moves)
}

fn assert_drawn_as_planned(gcode: &str, what: &str) -> Way {
    let (found, step_mm) = drawn(gcode);
    found.assert_near(&planned(gcode).0, 1e-5, step_mm, what);
    found
}

#[test]
fn files_of_three_slicers_are_drawn_as_they_are_planned() {
    for (slicer, text) in SAMPLES {
        let way = assert_drawn_as_planned(text, slicer);
        assert!(way.extruding > 2000.0, "{slicer}: {way:?}");
    }
}

/// How a file writes places and filament.
#[derive(Clone, Copy, Debug)]
struct Dialect {
    relative: bool,
    relative_e: bool,
    inches: bool,
    /// The axes are renamed by `G92` every so many moves.
    renamed_every: usize,
}

/// The same moves, as another slicer would write them.
fn written(moves: &[[[f64; 4]; 2]], dialect: Dialect) -> String {
    let Dialect { relative, relative_e, inches, renamed_every } = dialect;
    let mut text = BEGIN.to_owned();
    let begin = moves[0][0];
    writeln!(text, "G1 X{:.5} Y{:.5} Z{:.5} F6000\nG92 E{:.5}", begin[0], begin[1], begin[2], begin[3])
        .unwrap();
    writeln!(
        text,
        "{}\n{}\n{}",
        if inches { "G20" } else { "G21" },
        if relative { "G91" } else { "G90" },
        if relative_e { "M83" } else { "M82" }
    )
    .unwrap();
    let unit = if inches { INCH_MM } else { 1.0 };
    // Where the file thinks to be, in its own digits, so that nothing adds up; and what it calls that.
    let (mut at, mut offset) = (begin.map(|value| value / unit), [0.0; 4]);
    for (number, [start, to]) in moves.iter().enumerate() {
        if number % renamed_every == renamed_every - 1 {
            let name = [10.0, -20.0, 3.0, 0.0];
            offset = [0, 1, 2, 3].map(|axis| at[axis] - name[axis]);
            writeln!(text, "G92 X{} Y{} Z{} E{}", name[0], name[1], name[2], name[3]).unwrap();
        }
        text.push_str("G1");
        // As slicers do: what stays is not written.
        for axis in (0..4).filter(|&axis| start[axis] != to[axis]) {
            // Where places are relative, filament is too, as Klipper has it.
            let is_relative = relative || axis == 3 && relative_e;
            let from = if is_relative { at[axis] } else { offset[axis] };
            let value = format!("{:.6}", to[axis] / unit - from);
            let digits: f64 = value.parse().unwrap();
            write!(text, " {}{value}", ["X", "Y", "Z", "E"][axis]).unwrap();
            at[axis] = from + digits;
        }
        text.push('\n');
    }
    text
}

#[test]
fn relative_and_absolute_places_and_filament_renamed_axes_and_inches_are_one_geometry() {
    let (whole, moves) = planned(SAMPLES[2].1);
    for number in 0..16 {
        let dialect = Dialect {
            relative: number & 1 != 0,
            relative_e: number & 2 != 0,
            inches: number & 4 != 0,
            renamed_every: if number & 8 != 0 { 7 } else { usize::MAX },
        };
        let text = written(&moves, dialect);
        let (found, step_mm) = drawn(&text);
        // The start's way is not part of the original.
        let start = drawn(text.split("\nG2").next().unwrap()).0.travelling;
        let found = Way { travelling: found.travelling - start, low: whole.low, ..found };
        let tolerance = if dialect.inches { 1e-3 } else { 1e-5 };
        found.assert_near(&whole, tolerance, step_mm, &format!("{dialect:?}"));
        assert_drawn_as_planned(&text, &format!("{dialect:?}"));
    }
}

#[test]
fn arcs_are_drawn_as_planned_and_as_long_as_they_are() {
    use core::f64::consts::PI;
    let begin = format!("{BEGIN}G1 X150 Y100 Z0.2 F6000\n");
    let rise = libm::hypot(20.0 * PI, 5.0);
    // A text, and how long its arcs are. They begin at 150, 100.
    let arcs = [
        ("G3 X150 Y100 I-10 J0 E0.3", 20.0 * PI),
        ("G2 X130 Y100 I-10 J0 E0.3", 10.0 * PI),
        ("G2 X130 Y100 R10 E0.3", 10.0 * PI),
        ("G3 X140 Y110 R-10 E0.3", 15.0 * PI),
        ("G91\nM83\nG3 X-10 Y10 I-10 J0 E0.3", 5.0 * PI),
        ("G3 X150 Y100 Z5.2 I-10 J0 E0.3", rise),
        ("G18\nG3 X150 Z0.2 I0 K10 E0.3", 20.0 * PI),
        ("G19\nG2 Y100 Z20.2 J0 K10 E0.3", 10.0 * PI),
        ("G3 X150 Y100 I-10 J0 P3 E0.3", 60.0 * PI),
        ("G92 X0 Y0\nG2 X0 Y0 I-25 J-25 E0.3", 2.0 * PI * libm::hypot(25.0, 25.0)),
        ("G20\nG3 X5.905511811 Y3.937007874 I-0.1 J0 E0.3", 0.2 * PI * INCH_MM),
    ];
    for (arc, length_mm) in arcs {
        let way = assert_drawn_as_planned(&format!("{begin}{arc}\n"), arc);
        assert!((way.extruding - length_mm).abs() < 1e-3 * length_mm, "{arc}: {way:?} {length_mm}");
    }
    // A full circle reaches as far as it should in all four directions, but for the chords' error.
    let (way, step_mm) = drawn(&format!("{begin}G3 X150 Y100 I-40 J0 E0.3\n"));
    let slack = gcode::CHORD_TOLERANCE.0 + step_mm;
    for (found, expected) in [(way.high[0], 150.0), (way.high[1], 140.0)] {
        assert!((found - expected).abs() <= slack, "{found} {expected}");
    }
}
