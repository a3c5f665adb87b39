//! What becomes of moves where axes are not square and the bed is not flat.

use super::*;
use crate::config;

const CLOCK: Hertz = Hertz(12_000_000);
/// Between the points the bed is 0.1 mm high, but 0.5 mm at one corner.
const BED: &str = "
[skew_correction lean]
xy_skew: 0.02
[bed_mesh flat]
points:
  0.1, 0.1, 0.1
  0.1, 0.1, 0.1
  0.1, 0.1, 0.5
x_count: 3
y_count: 3
min_x: 0
max_x: 200
min_y: 0
max_y: 200
algo: direct
[bed_mesh hole]
points:
  0, 0, 0
  0, -0.4, 0
  0, 0, 0
x_count: 3
y_count: 3
min_x: 0
max_x: 200
min_y: 0
max_y: 200
";

/// A planner that is homed and hot.
fn planner() -> (Planner, Source) {
    let text = format!("{}{BED}", include_str!("../../../../samples/printer.cfg"));
    let config = config::parse(&text).0.expect("a machine");
    let mut planner = Planner::new(&config, CLOCK).unwrap();
    (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
    planner.guard.extrusion = ExtrusionPermit::Allowed;
    let mut source = Source::default();
    planner.begin_job(&mut source);
    (planner, source)
}

/// The moves that come of a text, up to the first error.
fn made(planner: &mut Planner, source: &mut Source, text: &str) -> (Vec<PlannedMove>, Option<PrinterError>) {
    source.feed(text.as_bytes());
    let mut moves = Vec::new();
    loop {
        match planner.next(source) {
            Ok(Planned::Move(planned, _)) => moves.push(planned),
            Ok(Planned::NeedsInput) if planner.is_at_rest() => return (moves, None),
            Ok(Planned::NeedsInput) => _ = planner.finish_run(),
            Ok(_) => {}
            Err(error) => return (moves, Some(error)),
        }
    }
}

#[track_caller]
fn assert_at(place: Position, wanted: [f64; 3]) {
    assert!(place.iter().zip(wanted).all(|(is, wanted)| (is - wanted).abs() < 1e-9), "{place:?} {wanted:?}");
}

#[test]
fn loading_moves_nothing_and_the_next_move_leads_to_the_right_place() {
    let (mut planner, mut source) = planner();
    let (moves, error) = made(&mut planner, &mut source, "G1 X10 Y10 Z1 F6000\nBED_MESH_PROFILE LOAD=flat\n");
    assert_eq!((moves.len(), error), (1, None));
    assert_at(planner.position(), [10.0, 10.0, 1.0]);
    assert_at(planner.gcode_position(), [10.0, 10.0, 0.9]);
    // Filament alone moves nothing else.
    let (moves, error) = made(&mut planner, &mut source, "G1 E1 F600\n");
    assert_eq!((moves.len(), error), (1, None));
    assert_at(planner.position(), [10.0, 10.0, 1.0]);
    // From where the head stands to where the line leads.
    let (moves, error) = made(&mut planner, &mut source, "G1 X60 E2 F6000\n");
    assert_eq!(error, None);
    assert_at(moves[0].from, [10.0, 10.0, 1.0]);
    assert_at(planner.position(), [60.0, 10.0, 1.1]);
    assert!((planner.position()[3] - 2.0).abs() < 1e-12);
    made(&mut planner, &mut source, "BED_MESH_CLEAR\nSKEW_PROFILE LOAD=lean\nG1 X60 Y50\n");
    assert_at(planner.position(), [59.0, 50.0, 1.0]);
    made(&mut planner, &mut source, "SET_SKEW CLEAR=1\nG1 Y50\nG1 X60 Y50 Z2\n");
    assert!(planner.transform().is_identity());
    assert_at(planner.position(), [60.0, 50.0, 2.0]);
}

#[test]
fn offsets_and_jobs_outlive_what_is_loaded() {
    let (mut planner, mut source) = planner();
    let text = "G1 Z1 F600\nBED_MESH_PROFILE LOAD=flat\nSKEW_PROFILE LOAD=lean\nG92 X5\nG1 X15 Y50 F6000\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    assert_at(planner.position(), [10.0 - 0.02 * 50.0, 50.0, 1.1]);
    let mut next = Source::default();
    planner.begin_job(&mut next);
    // To the G-code the head is where the last line has it.
    let at = next.interpreter.position();
    assert_at([at.x, at.y, at.z, at.e], [10.0, 50.0, 1.0]);
    assert_eq!(made(&mut planner, &mut next, "G91\nG1 X1 F6000\n").1, None);
    assert_at(planner.position(), [11.0 - 0.02 * 50.0, 50.0, 1.1]);
}

#[test]
fn limits_are_those_of_the_motors() {
    let (mut planner, mut source) = planner();
    made(&mut planner, &mut source, "G1 X10 Y100 Z0.2 F6000\nBED_MESH_PROFILE LOAD=hole\n");
    // In the middle of its way Z would be below 0: none of it is made.
    let (moves, error) = made(&mut planner, &mut source, "G1 X190 E5\n");
    let error = error.expect("it is refused");
    assert_eq!((moves.len(), error.code, error.line), (0, ErrorCode::MoveOutOfRange, Some(3)));
    // X leaves the range by what makes up for the skew.
    planner.correct(&mut source);
    let (_, error) = made(&mut planner, &mut source, "BED_MESH_CLEAR\nSKEW_PROFILE LOAD=lean\nG1 X1 Y150\n");
    assert_eq!(error.map(|error| (error.code, error.line)), Some((ErrorCode::MoveOutOfRange, Some(6))));
    planner.correct(&mut source);
    assert_eq!(made(&mut planner, &mut source, "G1 X5 Y150\n").1, None);
    assert_at(planner.position(), [2.0, 150.0, 0.2]);
}

#[test]
fn a_move_in_pieces_is_as_fast_as_a_straight_one() {
    let time = |load: &str| {
        let (mut planner, mut source) = planner();
        let text = format!("{load}\nG1 X10 Y10 Z5 F6000\n");
        assert_eq!(made(&mut planner, &mut source, &text).1, None);
        let (moves, error) = made(&mut planner, &mut source, "G1 X190 Y190 E9 F18000\n");
        assert_eq!(error, None);
        (moves.last().unwrap().end_time(), moves)
    };
    let (plain, straight) = time("");
    let (levelled, moves) = time("BED_MESH_PROFILE LOAD=hole");
    assert_eq!(straight.len(), 1);
    assert!((20..200).contains(&moves.len()), "{}", moves.len());
    assert!((levelled / plain - 1.0).abs() < 1e-4, "{levelled} {plain}");
    // The filament is shared out by length.
    for planned in &moves {
        let way = [0, 1].map(|axis: usize| planned.to[axis] - planned.from[axis]);
        let share = (planned.to[3] - planned.from[3]) / libm::hypot(way[0], way[1]);
        assert!((share - 9.0 / libm::hypot(180.0, 180.0)).abs() < 1e-6, "{share}");
    }
}

#[test]
fn what_is_not_there_cannot_be_loaded() {
    let (mut planner, mut source) = planner();
    for text in ["BED_MESH_PROFILE LOAD=warm\n", "SKEW_PROFILE LOAD=flat\n", "SET_SKEW XY=1,99,3\n"] {
        let error = made(&mut planner, &mut source, text).1.expect("it is refused");
        assert_eq!(error.code, ErrorCode::NoSuchProfile, "{text}");
        assert!(planner.transform().is_identity());
    }
}

#[test]
fn what_was_fed_and_not_made_is_forgotten_with_its_pieces() {
    let (mut planner, mut source) = planner();
    source.feed(b"BED_MESH_PROFILE LOAD=hole\nG1 Z5 F600\nG1 X190 Y190 F18000\n");
    let mut moves = 0;
    while moves < 2 {
        moves += u32::from(matches!(planner.next(&mut source).unwrap(), Planned::RunStarted(_)));
        if source.line() == LineNumber(3) {
            break;
        }
    }
    assert!(!source.is_drained());
    source.clear();
    assert!(source.is_drained());
    planner.correct(&mut source);
    // The G-code goes on from where the pieces that were made lead.
    let at = source.interpreter.position();
    let here = planner.gcode_position();
    assert_eq!([at.x, at.y, at.z], [here[0], here[1], here[2]]);
    assert_eq!(made(&mut planner, &mut source, "G1 X100 Y100 Z5\n").1, None);
    assert_at(planner.position(), [100.0, 100.0, 4.6]);
}

#[test]
fn filament_alone_leaves_the_head_where_what_was_cleared_had_it() {
    let (mut planner, mut source) = planner();
    let text = "G1 X10 Y10 Z0.3 F6000\nBED_MESH_PROFILE LOAD=flat\nG1 X60\nBED_MESH_CLEAR\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    for (text, filament) in [("G1 E-2 F600\n", -2.0), ("G1 E5\n", 5.0)] {
        let (moves, error) = made(&mut planner, &mut source, text);
        assert_eq!((moves.len(), error), (1, None), "{text}");
        assert_at(planner.position(), [60.0, 10.0, 0.4]);
        assert!((planner.position()[3] - filament).abs() < 1e-12, "{text}");
    }
    let text = "SKEW_PROFILE LOAD=lean\nG1 Y50 F6000\nSET_SKEW CLEAR=1\nG1 E3\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    assert_at(planner.position(), [59.0, 50.0, 0.3]);
}

#[test]
fn after_homing_the_g_code_stands_where_the_skew_has_it() {
    let (mut planner, mut source) = planner();
    let text = "SKEW_PROFILE LOAD=lean\nG1 X60 Y50 Z5 F6000\nG92 X0\nG28 Y\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    planner.set_axis(1, 200.0, true);
    planner.tell_homed([false, true, false], &mut source);
    let here = planner.position();
    assert_at(here, [59.0, 200.0, 5.0]);
    let [x, y, z, _] = planner.gcode_position();
    let at = source.interpreter.position();
    assert_at([at.x, at.y, at.z, 0.0], [x, y, z]);
    // Moves of one axis are moves of one axis, and the offset of the axis that was not homed holds.
    assert_eq!(made(&mut planner, &mut source, "G1 Z6\n").1, None);
    assert_at(planner.position(), [59.0, 200.0, 6.0]);
    assert_eq!(made(&mut planner, &mut source, "G1 X0 Y100\n").1, None);
    assert_at(planner.position(), [58.0, 100.0, 6.0]);
    // Without a skew the endstop's place is told as it is, on a bed that is not flat too.
    let text = "SET_SKEW CLEAR=1\nBED_MESH_PROFILE LOAD=flat\nG1 X40 Y40 Z3\nG28 Z\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    planner.set_axis(2, 0.0, true);
    planner.tell_homed([false, false, true], &mut source);
    assert_eq!(source.interpreter.position().z, 0.0);
}

#[test]
fn a_factor_that_is_lowered_in_the_middle_of_a_line_holds_from_the_next() {
    // 2257 steps/mm of filament: with pulses of 2 µs 110 mm/s are the most.
    let text = include_str!("../../../../samples/printer.cfg");
    let fine = text.replacen("rotation_distance: 22.6789511", "rotation_distance: 1.41743444", 1);
    let config = config::parse(&format!("{fine}{BED}")).0.expect("a machine");
    let load = "BED_MESH_PROFILE LOAD=hole\n";
    for (load, way) in [(load, "G1 X150"), ("", "G3 X150 I50 J0"), (load, "G3 X150 I50 J0")] {
        let mut planner = Planner::new(&config, CLOCK).unwrap();
        (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
        planner.guard.extrusion = ExtrusionPermit::Allowed;
        let mut source = Source::default();
        planner.begin_job(&mut source);
        let text = format!("{load}G1 X50 Y50 Z10 F6000\nM83\n");
        assert_eq!(made(&mut planner, &mut source, &text).1, None);
        source.set_speed_factor(3.0);
        let filament = if way.starts_with("G1") { 75.0 } else { 118.0 };
        source.feed(format!("{way} E{filament} F7200\n").as_bytes());
        while planner.position()[3] == 0.0 {
            planner.next(&mut source).unwrap();
        }
        assert!(planner.position()[3] < 0.9 * filament, "{way}: the factor changes in its middle");
        source.set_speed_factor(1.0);
        assert_eq!(made(&mut planner, &mut source, "").1, None, "{load}{way}");
        assert!((planner.position()[3] - filament).abs() < 1e-9, "{way}");
        // The next line is as the file has it: too fast is refused.
        let error = made(&mut planner, &mut source, "G1 X50 E75 F12000\n").1.map(|error| error.code);
        assert_eq!(error, Some(ErrorCode::StepRateTooHigh), "{load}{way}");
    }
}

#[test]
fn an_arc_over_the_bed_is_refused_before_it_starts() {
    let (mut planner, mut source) = planner();
    let text = "G1 X116.57 Y60 Z5 F6000\nBED_MESH_PROFILE LOAD=hole\nG1 Z0.35\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    // Only between its ends, over the deepest place, Z would be below 0.
    let (moves, error) = made(&mut planner, &mut source, "G3 X60 Y116.57 I-56.57 J0\n");
    assert_eq!((moves.len(), error.map(|error| error.code)), (0, Some(ErrorCode::MoveOutOfRange)));
    planner.correct(&mut source);
    // Where the bed is deep, but nowhere too deep, nothing is refused.
    assert_eq!(made(&mut planner, &mut source, "G1 X116.57 Y60 Z0.41\nG3 X60 Y116.57 I-56.57 J0\n").1, None);
}

#[test]
fn what_the_torque_does_not_last_for_is_refused_before_it_starts() {
    let text = include_str!("../../../../samples/printer.cfg")
        .replace("[printer]", "[printer]\nunreachable_speed: reject");
    let torque = "\n[motor_torque stepper_x]\npull_out_torque: 0: 0.4, 1000: 0.2\ninertia: 100\n";
    let config = config::parse(&format!("{text}{torque}{BED}")).0.expect("a machine");
    let mut planner = Planner::new(&config, CLOCK).unwrap();
    (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
    let mut source = Source::default();
    planner.begin_job(&mut source);
    let text = "G1 X150 Y100 Z5 F3000\nBED_MESH_PROFILE LOAD=hole\nG1 Z6\n";
    assert_eq!(made(&mut planner, &mut source, text).1, None);
    // It begins along Y, and is along X a quarter later.
    let (moves, error) = made(&mut planner, &mut source, "G3 X50 I-50 J0 F18000\n");
    let error = error.expect("it is refused");
    assert_eq!((moves.len(), error.code, error.line), (0, ErrorCode::StepRateTooHigh, Some(4)));
    assert_at(planner.gcode_position(), [150.0, 100.0, 6.0]);
}
