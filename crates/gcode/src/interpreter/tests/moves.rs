use units::Mm;

use super::*;

#[test]
fn words_left_out_keep_their_values() {
    let read = clean("G1 X10 Y20 F6000\nG1 Z.3\nG0 X5 E1 F1200\nG1 F60\nG1 Y0");
    assert_eq!(
        read.moves(),
        [[10.0, 20.0, 0.0, 0.0], [10.0, 20.0, 0.3, 0.0], [5.0, 20.0, 0.3, 1.0], [5.0, 0.0, 0.3, 1.0]]
    );
    assert_eq!(read.feeds(), [100.0, 100.0, 20.0, 1.0]);
    let Action::Move(rapid) = &read.actions[2] else { panic!() };
    assert!(rapid.rapid && rapid.line == LineNumber(3) && rapid.from.to_array() == [10.0, 20.0, 0.3, 0.0]);
}

#[test]
fn relative_and_absolute_modes_follow_klipper() {
    let read = clean("G1 X10 E1\nG91\nG1 X1 E1\nG90\nG1 X1 E1\nM83\nG1 X2 E1\nG90\nG1 X3 E1\nM82\nG1 X4 E1");
    let e: Vec<f64> = read.moves().iter().map(|to| to[3]).collect();
    let x: Vec<f64> = read.moves().iter().map(|to| to[0]).collect();
    assert_eq!(e, [1.0, 2.0, 1.0, 2.0, 3.0, 1.0]);
    assert_eq!(x, [10.0, 11.0, 1.0, 2.0, 3.0, 4.0]);
}

#[test]
fn filament_is_a_running_total_however_often_the_file_starts_anew() {
    let read = clean(
        "M82\nG92 E0\nG1 X1 E2\nG92 E0\nG1 X2 E2\nG92 E-5\nG1 E-6 F2400\nM83\nG1 X3 E.5\nM82\nG92 E0\nG1 E1",
    );
    let e: Vec<f64> = read.moves().iter().map(|to| to[3]).collect();
    assert_eq!(e, [2.0, 4.0, 3.0, 3.5, 4.5]);
    let Action::Move(retract) = &read.actions[2] else { panic!() };
    assert_eq!((retract.from.x, retract.to.x, retract.feed), (2.0, 2.0, MmPerS(40.0)));
}

#[test]
fn g92_renames_positions_and_homing_takes_the_names_back() {
    let mut read = clean("G1 X10 Y10 Z10\nG92 X0 Z5\nG1 X1 Y1 Z6\nG92\nG1 X1");
    assert_eq!(read.moves(), [[10.0, 10.0, 10.0, 0.0], [11.0, 1.0, 11.0, 0.0], [12.0, 1.0, 11.0, 0.0]]);
    let it = &mut read.interpreter;
    it.set_axes(Some(0.0), None, None);
    assert_eq!(it.position().to_array(), [0.0, 1.0, 11.0, 0.0]);
    let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
    it.line(LineNumber(9), b"G1 X7 Y7", &mut actions, &mut diagnostics);
    // X is the machine's again; Y is still called 0 where the machine is at 1.
    assert_eq!(it.position().to_array(), [7.0, 8.0, 11.0, 0.0]);
    it.line(LineNumber(10), b"G92.1", &mut actions, &mut diagnostics);
    it.line(LineNumber(11), b"G1 Y7", &mut actions, &mut diagnostics);
    assert_eq!((it.position().y, diagnostics.len()), (7.0, 0));
}

#[test]
fn inches_count_for_lengths_feeds_and_filament() {
    let read = clean("G1 X25.4 E2\nG20\nG1 X2 E1 F60\nG92 X0\nG1 X1\nG21\nG1 X1 E1");
    let expected = [[25.4, 2.0], [50.8, 25.4], [76.2, 25.4], [51.8, 1.0]];
    for (to, expected) in read.moves().iter().zip(expected) {
        assert!((to[0] - expected[0]).abs() < 1e-12 && (to[3] - expected[1]).abs() < 1e-12, "{to:?}");
    }
    assert_eq!(read.feeds()[1], 25.4);
}

#[test]
fn speed_and_flow_factors_scale_what_follows_and_nothing_before() {
    let read = clean(
        "G1 X1 E1 F600\nM220 S50\nM221 S200\nG1 X2 E2\nM220 B\nM220 S100\nG1 X3\nM220 R\nM221 S100\nG1 X4 E3",
    );
    let e: Vec<f64> = read.moves().iter().map(|to| to[3]).collect();
    assert_eq!(e, [1.0, 3.0, 3.0, 4.0]);
    assert_eq!(read.feeds(), [10.0, 5.0, 10.0, 5.0]);
    assert!(
        read.actions.contains(&Action::FlowFactor(2.0)) && read.actions.contains(&Action::SpeedFactor(0.5))
    );
    let mut it = read.interpreter;
    it.set_speed_factor(f64::NAN);
    it.set_flow_factor(1e9);
    assert_eq!((it.speed_factor(), it.flow_factor(), it.position().e), (0.5, 10.0, 4.0));
}

#[test]
fn firmware_retraction_moves_behind_the_files_back() {
    let settings = Settings {
        retraction: Some(FirmwareRetraction {
            length: 2.0,
            speed: MmPerS(30.0),
            extra_length: 0.5,
            unretract_speed: MmPerS(20.0),
            z_hop: 0.4,
        }),
    };
    let read = read_with(settings, "G1 X1 Z1 E5\nG10\nG10\nG1 X2 Z2\nG11\nG11\nG1 X3 Z2 E6");
    assert_eq!(read.said(), [""; 0]);
    let expected = [
        [1.0, 0.0, 1.0, 5.0],
        [1.0, 0.0, 1.0, 3.0],
        [1.0, 0.0, 1.4, 3.0],
        [2.0, 0.0, 2.4, 3.0],
        [2.0, 0.0, 2.0, 3.0],
        [2.0, 0.0, 2.0, 5.5],
        [3.0, 0.0, 2.0, 6.5],
    ];
    for (to, expected) in read.moves().iter().zip(expected) {
        assert!(to.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{to:?} {expected:?}");
    }
    assert_eq!((read.moves().len(), read.feeds()[1], read.feeds()[5]), (7, 30.0, 20.0));
}

#[test]
fn retraction_is_said_where_its_length_is_a_guess() {
    assert_eq!(read("G10\nG11\nG10").said(), ["1:0-3 warning assumed-retraction"]);
    let set = clean("M207 S3 F1800 Z0.2\nM208 S0.1 F600\nG10\nG11");
    assert_eq!(set.moves().last().unwrap()[3], 0.1 + -3.0 + 3.0);
    assert_eq!(read("G10 P0 S200").said(), ["1:0-3 blocking unsupported-command"]);
    assert_eq!(read("M207 S1\nG10\nM207 S2").said(), ["3:0-4 error value-out-of-range"]);
}

#[test]
fn arcs_keep_their_geometry_and_carry_the_state_on() {
    let read = clean("G1 X10 Y0 F600\nG3 X0 Y10 I-10 J0 E2\nG2 X10 Y0 R10\nG18\nG2 X0 Z10 K10\nG1 X1");
    let arcs: Vec<&crate::Arc> =
        read.actions.iter().filter_map(|a| if let Action::Arc(arc) = a { Some(arc) } else { None }).collect();
    assert_eq!(
        (arcs[0].centre, arcs[0].to.to_array(), arcs[0].feed),
        ([0.0, 0.0], [0.0, 10.0, 0.0, 2.0], MmPerS(10.0))
    );
    assert!((arcs[0].angle - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!(arcs[1].centre.iter().all(|c| c.abs() < 1e-9), "{:?}", arcs[1].centre);
    assert_eq!((arcs[2].plane, arcs[2].centre), (Plane::Zx, [10.0, 10.0]));
    assert!(arcs[1].chords(Mm(0.01)).count() > 10);
    assert_eq!(read.moves().last(), Some(&[1.0, 0.0, 10.0, 2.0]));
}

#[test]
fn arcs_that_cannot_be_are_skipped_and_those_that_nearly_can_are_said() {
    for (line, said) in [
        ("G2 X10 Y10", "1:0-2 error impossible-arc"),
        ("G2 X10 I1 R3", "1:0-2 error impossible-arc"),
        ("G2 X10 R1", "1:0-2 error impossible-arc"),
        ("G2 R1", "1:0-2 error impossible-arc"),
        ("G2 I0 J0", "1:0-2 error impossible-arc"),
        ("G2 X10 I5 P0.5", "1:10-11 error value-out-of-range"),
        ("G2 X10 I5 P1000000", "1:10-11 error value-out-of-range"),
        ("G2 X10 I5 F0", "1:10-11 error value-out-of-range"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
        assert_eq!(read.interpreter.position(), Position::default());
    }
    let inaccurate = read("G2 X10.2 I5");
    assert_eq!(
        (inaccurate.said(), inaccurate.actions.len()),
        (vec!["1:0-2 warning inaccurate-arc".to_owned()], 1)
    );
}

#[test]
fn moves_that_make_no_sense_do_nothing() {
    for (line, said) in [
        ("G1 X1e300 Y2", "1:4-6 error ambiguous-exponent"),
        ("G1 X1000000000000", "1:3-17 error value-out-of-range"),
        ("G1 X5000000", "1:3-4 error value-out-of-range"),
        ("G1 XNaN", "1:6-7 error duplicate-word"),
        ("G1 Xinf", "1:3-4 error missing-value"),
        ("G1 X-", "1:4-5 error malformed-word"),
        ("G1 X1 F0", "1:6-7 error value-out-of-range"),
        ("G1 X1 F-100", "1:6-7 error value-out-of-range"),
        ("G1 X1 X2", "1:6-7 error duplicate-word"),
        ("G1 X1 Y", "1:6-7 error missing-value"),
        ("G1 X1 =3", "1:6-8 error malformed-word"),
        ("G1 X1\u{0}", "1:5-6 error not-text"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
        assert_eq!((read.interpreter.position(), read.interpreter.feed().0), (Position::default(), 25.0));
    }
    assert_eq!(read("G1 X1 Q3").said(), ["1:6-7 warning unused-word"]);
}

#[test]
fn relative_moves_cannot_run_away() {
    let read = read(&"G91\nG1 X1000000\n".repeat(3));
    assert_eq!((read.moves().len(), read.said().len()), (1, 2));
}

#[test]
fn a_move_that_was_not_made_leaves_the_offsets() {
    let mut read = clean("G1 X10 Y10\nG92 X0\nG1 X500");
    read.interpreter.stand_at(10.0, 10.0, 0.0);
    let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
    read.interpreter.line(LineNumber(4), b"G1 Y20", &mut actions, &mut diagnostics);
    read.interpreter.line(LineNumber(5), b"G1 X1", &mut actions, &mut diagnostics);
    let next = Read { actions, diagnostics, ..read };
    assert_eq!(next.moves(), [[10.0, 20.0, 0.0, 0.0], [11.0, 20.0, 0.0, 0.0]]);
}
