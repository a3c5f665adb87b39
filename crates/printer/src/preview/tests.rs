use super::vertex::{Flags, Vertex};
use super::*;
use crate::{
    config::{SMALL_MACHINE, parse},
    error::ErrorCode,
    planner::PlanStream,
};

/// With a slicer's comments on layers and features.
const TEST_PART: &str = include_str!("../../../../samples/test-part.gcode");
/// Without; with firmware retraction.
const SMALL_PART: &str = include_str!("../../../../samples/test-part-small.gcode");
const MACHINE: &str = include_str!("../../../../samples/printer.cfg");

/// Reads a text in pieces of this size.
fn read(gcode: &[u8], config: Option<&PrinterConfig>, piece: usize) -> (Vec<Vertex>, Vec<u32>, Preview) {
    through(Preview::new(config), gcode, piece)
}

fn through(mut preview: Preview, gcode: &[u8], piece: usize) -> (Vec<Vertex>, Vec<u32>, Preview) {
    let (mut words, mut marks) = (Vec::new(), Vec::new());
    let mut rest = gcode;
    loop {
        let count = rest.len().min(piece);
        let taken = preview.feed(&rest[..count]);
        rest = &rest[taken..];
        if rest.is_empty() {
            preview.end();
        }
        while preview.run(&mut words) {}
        marks.extend(preview.take_marks());
        if rest.is_empty() {
            break;
        }
    }
    let words: Vec<[u32; WORDS]> = words.as_chunks().0.to_vec();
    (words.into_iter().map(Vertex::unpack).collect(), marks, preview)
}

fn vertices(gcode: &str) -> Vec<Vertex> {
    read(gcode.as_bytes(), None, usize::MAX).0
}

fn places(vertices: &[Vertex], grid: &Grid) -> Vec<[f64; 3]> {
    vertices.iter().map(|vertex| grid.place(vertex.steps)).collect()
}

fn machine() -> PrinterConfig {
    parse(MACHINE).0.unwrap()
}

#[test]
fn box_and_filament_are_those_of_the_check() {
    let config = machine();
    let (vertices, _, preview) = read(TEST_PART.as_bytes(), Some(&config), 10_000);
    let grid = *preview.grid();
    let report = preview.finish();
    let mut checker = Checker::new(Some(&config));
    checker.feed(TEST_PART.as_bytes());
    let check = checker.finish();
    assert_eq!(report.check, check);
    assert_eq!(report.vertices as usize, vertices.len());
    assert_eq!((report.clamped, report.left_out), (0, 0));

    let places = places(&vertices, &grid);
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for (at, vertex) in vertices.iter().enumerate().filter(|(_, vertex)| !vertex.flags.has(Flags::TRAVEL)) {
        assert!(!vertex.flags.has(Flags::BREAK));
        for place in [places[at - 1], places[at]] {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(place[axis]);
                bounds[1][axis] = bounds[1][axis].max(place[axis]);
            }
        }
    }
    let expected = check.bounds_mm.unwrap();
    for (found, expected) in bounds.as_flattened().iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() <= 0.5 * grid.step_mm + 1e-9, "{found} {expected}");
    }

    // What is laid is all that is fed, but for what was pulled back in the end and pushed on the spot in the beginning.
    let laid: f64 = report.features.iter().map(|feature| feature.filament.0).sum();
    let beads: f64 = (1..vertices.len())
        .filter(|&at| !vertices[at].flags.has(Flags::TRAVEL))
        .map(|at| {
            let [x, y, z] = [0, 1, 2].map(|axis| places[at][axis] - places[at - 1][axis]);
            let (w, h) = (f64::from(vertices[at].width) * 0.004, f64::from(vertices[at].height) * 0.004);
            (x * x + y * y + z * z).sqrt() * (h * (w - h) + core::f64::consts::FRAC_PI_4 * h * h)
        })
        .sum();
    assert!((laid - check.filament_mm).abs() < 0.02 * laid, "{laid} {}", check.filament_mm);
    assert!((beads / FILAMENT_AREA_MM2 - laid).abs() < 0.03 * laid, "{} {laid}", beads / FILAMENT_AREA_MM2);
}

#[test]
fn a_slicer_without_comments_has_layers_too() {
    let config = machine();
    let (vertices, _, preview) = read(SMALL_PART.as_bytes(), Some(&config), 100_000);
    let report = preview.finish();
    assert!(report.layers.len() > 10, "{}", report.layers.len());
    assert!(report.layers.is_sorted_by(|below, above| below.z < above.z));
    assert!(vertices.iter().any(|vertex| vertex.flags.has(Flags::UNRETRACT)));
    assert!(report.print_time.is_some());
}

#[test]
fn the_time_is_the_plans() {
    let config = machine();
    // The machine's endstops are at 0, where a plan's axes are after homing.
    for file in [TEST_PART, SMALL_PART] {
        let (_, _, preview) = read(file.as_bytes(), Some(&config), 100_000);
        let report = preview.finish();
        let mut plan = PlanStream::new(&config).unwrap();
        let mut blocks = Vec::new();
        for piece in file.as_bytes().chunks(32 * 1024) {
            plan.feed(piece, &mut blocks, |_| {}).unwrap();
            blocks.clear();
        }
        let expected = plan.finish(&mut blocks, |_| {}).unwrap();
        let found = report.print_time.unwrap().0;
        let apart = (found - expected.print_time.0).abs();
        assert!(apart < 1e-6, "{found} {}", expected.print_time);
        assert!((report.check.filament_mm - expected.filament_mm).abs() < 1e-6);
        let features: f64 = report.features.iter().map(|feature| feature.time.0).sum();
        let layers: f64 = report.layers.iter().map(|layer| layer.time.0).sum();
        assert!((features + report.travel_time.0 - found).abs() < 1e-6);
        assert!((layers - found).abs() < 1e-6, "{layers} {found}");
    }
}

#[test]
fn a_slicers_name_and_estimate_are_told() {
    let report = read(TEST_PART.as_bytes(), None, 100_000).2.finish();
    assert!(report.slicer_time.is_some() && report.generator.is_some());
}

#[test]
fn however_it_is_fed_it_is_the_same() {
    let config = machine();
    let text = &TEST_PART.as_bytes()[..40_000];
    let (whole, marks, preview) = read(text, Some(&config), usize::MAX);
    let report = preview.finish();
    for piece in [1, 777, 65_537] {
        let (found, found_marks, preview) = read(text, Some(&config), piece);
        assert_eq!(found, whole, "{piece}");
        assert_eq!(found_marks, marks);
        assert_eq!(preview.finish(), report);
    }
}

#[test]
fn layers_of_a_slicer_are_numbered_from_the_first_and_in_order() {
    let config = machine();
    let (vertices, marks, preview) = read(TEST_PART.as_bytes(), Some(&config), 100_000);
    let report = preview.finish();
    let announced = TEST_PART.lines().filter(|line| *line == ";LAYER_CHANGE").count();
    assert_eq!(report.layers.len(), announced);
    assert!(vertices.is_sorted_by_key(|vertex| vertex.layer));
    assert_eq!(vertices.last().unwrap().layer as usize, announced - 1);
    for (number, layer) in report.layers.iter().enumerate().skip(1) {
        assert_eq!(vertices[layer.first_vertex as usize].layer as usize, number);
        assert_eq!(vertices[layer.first_vertex as usize - 1].layer as usize, number - 1);
        assert!(layer.z > report.layers[number - 1].z);
    }
    let (pairs, _) = marks.as_chunks::<2>();
    assert!(pairs.len() >= vertices.len() / 33 && pairs.len() <= vertices.len() / 32 + 1);
    assert!(pairs.is_sorted_by_key(|[line, vertex]| (*line, *vertex)));
    let kinds: Vec<u8> = report.features.iter().map(|feature| feature.feature).collect();
    assert!(kinds.contains(&0) && kinds.contains(&1) && kinds.is_sorted(), "{kinds:?}");
    assert!(vertices.iter().filter(|vertex| vertex.flags.has(Flags::SEAM)).count() >= announced);
    assert!(vertices.iter().all(|vertex| !vertex.flags.has(Flags::SEAM) || vertex.feature <= 2));
}

#[test]
fn places_and_flags() {
    let text =
        "G28\nG90\nM83\nG1 X10 Y10 Z0.2 F6000\nG1 E2\nG1 X20 E1\nG1 E-1\nG1 X30 E-0.5\nG0 X0\nG28 X\nG1 X5\n";
    let (found, _, preview) = read(text.as_bytes(), None, usize::MAX);
    let grid = *preview.grid();
    let expected = [
        ([0.0, 0.0, 0.0], Flags::BREAK.and(Flags::TRAVEL)),
        ([10.0, 10.0, 0.2], Flags::TRAVEL.and(Flags::UNRETRACT)),
        ([20.0, 10.0, 0.2], Flags::RETRACT),
        ([30.0, 10.0, 0.2], Flags::TRAVEL.and(Flags::RETRACT).and(Flags::WIPE)),
        ([0.0, 10.0, 0.2], Flags::TRAVEL),
        ([0.0, 10.0, 0.2], Flags::BREAK.and(Flags::TRAVEL)),
        ([5.0, 10.0, 0.2], Flags::TRAVEL),
    ];
    assert_eq!(found.len(), expected.len());
    for (vertex, (place, flags)) in found.iter().zip(expected) {
        let at = grid.place(vertex.steps);
        for axis in 0..3 {
            assert!((at[axis] - place[axis]).abs() <= 0.5 * grid.step_mm, "{at:?} {place:?}");
        }
        assert_eq!(vertex.flags, flags, "{place:?}");
    }
}

#[test]
fn a_closed_outer_wall_has_its_seam_and_an_open_one_none() {
    let walls = "G90\nM83\n;LAYER:0\n;TYPE:WALL-OUTER\nG0 X0 Y0 Z0.2 F6000\nG1 X10 E1\nG1 Y10 E1\nG1 X0 E1\nG1 Y0.1 E1\n\
                 G0 X50\nG1 X60 E1\nG1 Y10 E1\nG1 X50 E1\n;TYPE:FILL\nG1 Y0.2 E1\n";
    let found = vertices(walls);
    let seams: Vec<usize> = (0..found.len()).filter(|&at| found[at].flags.has(Flags::SEAM)).collect();
    assert_eq!(seams, [5]);
    assert_eq!(found.last().unwrap().feature, 3);
}

#[test]
fn arcs_are_flattened_and_bounded() {
    let found = vertices("G90\nG1 X10 F6000\nG3 X-10 I-10 E1\n");
    assert!(found.len() > 40, "{}", found.len());
    let grid = Grid::around(None);
    for vertex in &found[1..] {
        let [x, y, _] = grid.place(vertex.steps);
        assert!((libm::hypot(x, y) - 10.0).abs() < 2.0 * grid.step_mm);
    }
    // A hundred turns of a kilometre: far more than may be made at once.
    let mut preview = Preview::new(None);
    preview.feed(b"G90\nG1 X1000000 F6000\nG3 I-1000000 P100\n");
    let mut words = Vec::new();
    assert!(preview.run(&mut words));
    assert!(words.len() <= RUN_WORDS_MAX + 4 * WORDS);
    let mut second = Vec::new();
    assert!(preview.run(&mut second));
}

#[test]
fn large_beds_and_negative_places() {
    let config = parse(&wide(MACHINE)).0.unwrap();
    let reach = config.steppers[0].position_max.0;
    assert!(reach > 1024.0);
    let file = format!("G28\nG90\nM83\nG1 X{reach} Y0 Z0.2 F6000\nG1 X-3 Y-4 E1\n");
    let (found, _, preview) = read(file.as_bytes(), Some(&config), usize::MAX);
    let grid = *preview.grid();
    assert_eq!(grid.step_mm, 1.0 / 512.0);
    let at = |index: usize| grid.place(found[found.len() - index].steps);
    assert!((at(2)[0] - reach).abs() <= 0.5 * grid.step_mm);
    assert!((at(1)[0] + 3.0).abs() <= 0.5 * grid.step_mm && (at(1)[1] + 4.0).abs() <= 0.5 * grid.step_mm);
    assert_eq!(preview.finish().clamped, 0);

    let far = read(b"G90\nG1 X900000 F6000\nG1 X0\n", Some(&config), usize::MAX).2.finish();
    assert_eq!(far.clamped, 1);
}

/// The sample machine with a wider X axis.
fn wide(text: &str) -> String {
    let mut axis = "";
    let lines = text.lines().map(|line| {
        if line.starts_with('[') {
            axis = line.split(']').next().unwrap_or_default();
        }
        if axis == "[stepper_x" && line.starts_with("position_max") { "position_max: 1500" } else { line }
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn without_a_slicers_comments_height_tells_layers_and_width() {
    let layers: Vec<String> = (1..=5)
        .map(|layer| {
            let z = 0.2 * f64::from(layer);
            // A hop in between is no layer.
            let hop = z + 0.6;
            format!("G1 Z{hop:.2}\nG1 X0 Y0\nG1 Z{z:.2}\nG1 X100 E3.326\nG1 Y50 E1.663\n")
        })
        .collect();
    let text = format!("G90\nM83\nG1 Z0.2 F6000\n{}", layers.concat());
    let (found, _, preview) = read(text.as_bytes(), None, usize::MAX);
    let report = preview.finish();
    let heights: Vec<f64> = report.layers.iter().map(|layer| (layer.z.0 * 100.0).round() / 100.0).collect();
    assert_eq!(heights, [0.2, 0.4, 0.6, 0.8, 1.0]);
    assert_eq!(report.print_time, None);
    // 3.326 mm of filament over 100 mm, 0.2 mm high: 0.4 mm² of flat bead with round ends.
    for vertex in found.iter().filter(|vertex| !vertex.flags.has(Flags::TRAVEL)) {
        assert_eq!(vertex.height, 50);
        assert!((f64::from(vertex.width) * 0.004 - 0.443).abs() < 0.005, "{}", vertex.width);
    }
}

#[test]
fn a_small_machine_and_a_broken_file() {
    let config = parse(SMALL_MACHINE).0.unwrap();
    let (found, _, preview) = read(b"G28\nG1 X1e400\nFOO\n\xff\xfe\nG1 X5 F600\n", Some(&config), 3);
    let report = preview.finish();
    assert!(!report.check.is_printable());
    assert!(found.len() >= 2);
    assert_eq!(report.layers.len(), 1);
    let empty = Preview::new(None).finish();
    assert_eq!((empty.vertices, empty.layers.len()), (0, 1));
    assert!(!empty.check.is_printable());
}

#[test]
fn an_outline_is_the_same_geometry_and_what_is_left_is_the_same_plan() {
    let config = machine();
    for text in [TEST_PART, SMALL_PART] {
        let (found, marks, whole) = read(text.as_bytes(), Some(&config), usize::MAX);
        let whole = whole.finish();
        let (outlined, outlined_marks, outline) = through(Preview::outline(&config), text.as_bytes(), 10_000);
        let outline = outline.finish();
        assert!(outlined == found && outlined_marks == marks);
        assert_eq!(outline.print_time, None);
        assert_eq!(outline.check.bounds_mm, whole.check.bounds_mm);
        let places = |report: &PreviewReport| {
            report
                .layers
                .iter()
                .map(|layer| (layer.first_vertex, layer.first_line, layer.z))
                .collect::<Vec<_>>()
        };
        assert_eq!(places(&outline), places(&whole));

        let mut planned = Preview::new(Some(&config));
        planned.want_channels();
        let mut words = 0;
        for piece in text.as_bytes().chunks(INPUT_BYTES_MAX) {
            planned.feed(piece);
            while planned.run_on() {}
            words += planned.take_channels().len();
        }
        planned.end();
        while planned.run_on() {}
        words += planned.take_channels().len();
        assert_eq!(words, whole.vertices as usize * CHANNEL_WORDS);
        assert_eq!((planned.take_marks(), planned.take_line_steps()), (vec![], vec![]));
        assert_eq!(planned.finish(), whole);
    }
}

#[test]
fn it_takes_no_more_than_it_wants() {
    let mut preview = Preview::new(None);
    let line = b"G1 X1 F600 ; some comment\n".repeat(20_000);
    assert!(line.len() > INPUT_BYTES_MAX);
    assert_eq!(preview.feed(&line), INPUT_BYTES_MAX);
    assert_eq!((preview.wants(), preview.feed(&line)), (0, 0));
    let mut words = Vec::new();
    while preview.run(&mut words) {}
    assert_eq!(preview.wants(), INPUT_BYTES_MAX);
    assert_eq!(preview.read_bytes(), INPUT_BYTES_MAX as u64);
}

#[test]
fn an_extruder_that_would_step_too_fast_along_with_the_axes_is_found_at_its_line() {
    // 4515 steps/mm of filament: with pulses of 2 µs 55 mm/s are the most.
    let (usual, fine) = ("rotation_distance: 22.6789511", "rotation_distance: 0.70871722");
    let config = parse(&MACHINE.replacen(usual, fine, 1)).0.unwrap();
    let errors = |config: &PrinterConfig, gcode: &str| {
        let text = format!("G28\nM104 S200\nM83\nG1 X50 F6000\n{gcode}\nG1 X0\nM104 S0\n");
        let errors = read(text.as_bytes(), Some(config), usize::MAX).2.finish().check.errors;
        errors.iter().map(|error| (error.code, error.line)).collect::<Vec<_>>()
    };
    let too_fast = |line| vec![(ErrorCode::StepRateTooHigh, Some(line))];
    assert_eq!(errors(&config, "G1 X150 E75 F6000"), too_fast(5));
    assert_eq!(
        errors(&config, "G1 X150 E75 F6000\nG1 X999"),
        [(ErrorCode::StepRateTooHigh, Some(5)), (ErrorCode::MoveOutOfRange, Some(6))]
    );
    assert_eq!(
        errors(&config, "SET_VELOCITY_LIMIT ACCEL=500\nG1 X51 E0.75 F6000\nG1 X150 E75 F6000"),
        too_fast(7)
    );
    // It is the speed that is reached that counts, and the motor.
    assert_eq!(errors(&config, "G1 X50.5 E0.37 F6000"), []);
    assert_eq!(errors(&config, "G1 X150 E50 F6000"), []);
    assert_eq!(errors(&machine(), "G1 X150 E75 F6000"), []);
}
