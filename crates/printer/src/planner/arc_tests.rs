//! Arcs of a file, as they are planned.

use super::tests::{feed, items, moves, plan, planner};
use super::*;
use proptest::prelude::*;

/// With the acceleration of the sample machine, whatever it is.
fn accel() -> f64 {
    planner().0.limits.max_accel.0
}

#[test]
fn a_line_into_an_arc_into_a_line_has_no_dip() {
    // In millimetres and in inches, in the plane that is usual and in another one.
    for text in [
        "G1 X10 Y10 Z50 F6000\nG1 X60 F2400\nG3 X60 Y30 I0 J10\nG1 X10\n",
        "G20\nG1 X0.5 Y0.5 Z2 F200\nG1 X2.5 F94.488\nG3 X2.5 Y1.5 J0.5\nG1 X0.5\n",
        "G1 X10 Y10 Z50 F6000\nG1 X60 F2400\nG3 X60 Y30 R10\nG1 X10\n",
    ] {
        let made = moves(&plan(text));
        let bent: Vec<&PlannedMove> = made.iter().filter(|one| one.bend.is_some()).collect();
        assert!(bent.len() > 30);
        for one in &bent {
            for speed in [one.start_velocity, one.cruise_velocity, one.end_velocity] {
                assert!((speed - 40.0).abs() < 1e-3, "{speed}");
            }
        }
        assert_eq!(bent[0].start_velocity, made[made.len() - bent.len() - 2].end_velocity);
        let length: f64 = bent.iter().map(|one| one.length).sum();
        let radius = if text.starts_with("G20") { 12.7 } else { 10.0 };
        assert!((length - core::f64::consts::PI * radius).abs() < 1e-9, "{length}");
    }
}

#[test]
fn the_speed_on_a_circle_is_what_turning_allows() {
    let made = moves(&plan("G1 X100 Y100 F6000\nG2 X100 Y100 I5 J0 P3 E9 F60000\n"));
    let top = (accel() * 5.0).sqrt();
    let steady =
        made.iter().filter(|one| one.bend.is_some() && (one.start_velocity / top - 1.0).abs() < 1e-9).count();
    assert!(steady > 100, "{steady}");
    assert!(
        made.iter().filter(|one| one.bend.is_some()).all(|one| one.cruise_velocity <= top * (1.0 + 1e-12))
    );
    // The filament is an even share of the length.
    let share = 9.0 / (3.0 * core::f64::consts::TAU * 5.0);
    for one in made.iter().filter(|one| one.bend.is_some()) {
        assert!((one.direction[EXTRUDER] - share).abs() < 1e-9);
    }
}

#[test]
fn an_arc_that_leads_out_of_the_machine_is_refused_before_it_begins() {
    for arc in ["G2 X20 Y20 I-30 J0", "G2 X1000 Y20 R1e9", "G3 X20 Y20 I900000"] {
        let (mut planner, mut source) = planner();
        feed(&mut source, &format!("G1 X20 Y20 F6000\n{arc}\nG1 X30\n"));
        let mut error = None;
        for _ in 0..10_000 {
            match planner.next(&mut source) {
                Ok(Planned::EndOfSource) => break,
                Ok(_) => {}
                Err(found) => {
                    error.get_or_insert(found);
                }
            }
        }
        // A radius beyond all measure is told by the reading, and the line passed over.
        if let Some(error) = error {
            assert_eq!((error.code, error.line), (ErrorCode::MoveOutOfRange, Some(2)), "{arc}");
        } else {
            assert!(arc.contains("1e9"), "{arc}");
        }
        assert_eq!(planner.position()[..2], [30.0, 20.0], "{arc}");
    }
}

#[test]
fn an_arc_that_is_cut_off_in_its_line_is_read_as_far_as_it_goes() {
    for (text, bends) in
        [("G1 X20 Y20 F6000\nG2 X20 Y20 I", false), ("G1 X20 Y20 F6000\nG2 X20 Y20 I1", true)]
    {
        let (mut planner, mut source) = planner();
        feed(&mut source, text);
        let made = moves(&items(&mut planner, &mut source));
        assert_eq!(made.iter().any(|one| one.bend.is_some()), bends, "{text}");
        assert_eq!(planner.position()[..2], [20.0, 20.0]);
    }
}

#[test]
fn an_arc_goes_on_after_it_has_been_brought_to_rest_in_its_middle() {
    let (mut planner, mut source) = planner();
    feed(&mut source, "G1 X100 Y100 F6000\nG2 X100 Y100 I30 J0 F3000\n");
    let mut made = Vec::new();
    let mut runs = 0;
    loop {
        match planner.next(&mut source).unwrap() {
            Planned::Move(one, _) => {
                made.push(one);
                if made.len() == 20 {
                    assert!(planner.finish_run());
                }
            }
            Planned::RunEnded(_) => runs += 1,
            Planned::EndOfSource => break,
            _ => {}
        }
    }
    assert_eq!(runs, 2);
    let bent = made.iter().filter(|one| one.bend.is_some());
    let length: f64 = bent.map(|one| one.length).sum();
    assert!((length - core::f64::consts::TAU * 30.0).abs() < 1e-9);
    assert_eq!(made.iter().filter(|one| one.start_velocity == 0.0).count(), 2);
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -30.0..120.0_f64,
        2 => -1.0..1.0_f64,
        1 => Just(0.0),
        1 => prop_oneof![Just(1e-9), Just(1e6), Just(-1e9), Just(1e300)],
    ]
}

/// Lines of arcs in all planes and units, with numbers that make sense and numbers that do not.
fn any_lines() -> impl Strategy<Value = String> {
    let word = (proptest::sample::select(vec!['X', 'Y', 'Z', 'I', 'J', 'K', 'R', 'P']), any_number());
    let words = proptest::collection::vec(word, 1..5);
    let arc = (any::<bool>(), words).prop_map(|(clockwise, words)| {
        let words = words.into_iter().map(|(letter, value)| format!(" {letter}{value}"));
        format!("G{}{}\n", if clockwise { 2 } else { 3 }, words.collect::<String>())
    });
    let mode = proptest::sample::select(vec![
        "G17\n",
        "G18\n",
        "G19\n",
        "G20\n",
        "G21\n",
        "G90\n",
        "G91\n",
        "G1 X90 Y90 Z90 F6000\n",
        "G1 F60000\n",
        "M82\n",
        "M83\n",
    ]);
    let line = prop_oneof![3 => arc, 1 => mode.prop_map(str::to_owned)];
    proptest::collection::vec(line, 1..12).prop_map(|lines| lines.concat())
}

/// Whatever the text says: its moves follow each other, and end where the planner says.
fn is_planned_or_refused(text: &str) -> Result<(), TestCaseError> {
    let (mut planner, mut source) = planner();
    feed(&mut source, &format!("G1 X90 Y90 Z90 F6000\n{text}"));
    let mut at = [0.0; 4];
    let limits = planner.limits;
    // Filament is left out: what is pulled back along a way is not bounded, and each of its steps is made.
    // A helix of a hundred turns as wide as the machine has fewer pieces.
    let mut moves = 0_u32;
    loop {
        match planner.next(&mut source) {
            Ok(Planned::EndOfSource) => break,
            Ok(Planned::RunStarted(position)) => at = position,
            Ok(Planned::Move(one, _)) => {
                prop_assert_eq!(one.from, at);
                prop_assert!(one.duration() > 0.0 && one.duration().is_finite());
                prop_assert!(
                    one.cruise_velocity <= limits.max_velocity.0 * (1.0 + 1e-9) || one.bend.is_none()
                );
                at = one.to;
                moves += 1;
                prop_assert!(moves < 300_000);
            }
            Ok(_) => {}
            Err(error) => {
                prop_assert!(!planner.is_broken(), "{}", error);
                planner.correct(&mut source);
            }
        }
    }
    prop_assert_eq!(at, planner.position());
    Ok(())
}

#[test]
fn a_move_without_length_leaves_the_machine_where_it_is() {
    is_planned_or_refused("G91\nG3 Y0.000000001 I-0.1615111262282972 J97.68053151885341\n").unwrap();
    is_planned_or_refused(&format!("G91\n{}", "G1 X0.0000000004\n".repeat(9))).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn any_arcs_are_planned_or_refused(text in any_lines()) {
        is_planned_or_refused(&text)?;
    }
}
