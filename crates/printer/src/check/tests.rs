//! What a file is told of before it is printed.

use super::*;

fn machine_file() -> PrinterConfig {
    crate::config::parse(include_str!("../../../../samples/printer.cfg")).0.expect("the sample machine")
}

fn check(text: &str) -> CheckReport {
    let mut checker = Checker::new(Some(&machine_file()));
    // In pieces, as files come.
    text.as_bytes().chunks(7).for_each(|piece| checker.feed(piece));
    checker.finish()
}

fn found(machine: &str, text: &str) -> Vec<(ErrorCode, Option<u32>)> {
    let mut checker = Checker::new(Some(&crate::config::parse(machine).0.expect("a machine")));
    checker.feed(text.as_bytes());
    checker.finish().errors.iter().map(|error| (error.code, error.line)).collect()
}

fn errors(text: &str) -> Vec<(ErrorCode, Option<u32>)> {
    check(text).errors.iter().map(|error| (error.code, error.line)).collect()
}

const WARM: &str = "G28\nM109 S200\nM83\n";

#[test]
fn a_sound_file_has_bounds_and_filament() {
    let report = check(&format!("{WARM}G1 X10 Y20 Z0.3 F6000\nG1 X30 Y25 E2\nG1 X200 Y200\nM104 S0\n"));
    assert!(report.is_printable() && report.blocking.is_empty());
    assert_eq!((report.lines, report.moves, report.filament_mm), (7, 3, 2.0));
    assert_eq!(report.bounds_mm, Some([[10.0, 20.0, 0.3], [30.0, 25.0, 0.3]]));
}

#[test]
fn each_fault_is_found_at_its_line() {
    use ErrorCode as C;
    for (text, expected) in [
        ("G1 X5\n", (C::NotHomed, Some(1))),
        ("G28\nG1 X301\n", (C::MoveOutOfRange, Some(2))),
        ("G28\nG1 X5\nM84\nG1 X6\n", (C::NotHomed, Some(4))),
        ("G28\nM83\nG1 X5 E1\n", (C::ColdExtrusion, Some(3))),
        ("G28\nM104 S169\nM83\nG1 X5 E1\nM104 S0\n", (C::ColdExtrusion, Some(4))),
        ("G28\nG1 X5\nM104 S261\nM104 S0\n", (C::TargetOutOfRange, Some(3))),
        ("G28\nG1 X5\nM141 S40\n", (C::NoSuchHeater, Some(3))),
        ("G28\nT1\nG1 X5\n", (C::NoSuchHeater, Some(2))),
        ("G28\nG1 X1.2.3\nG1 X5\n", (C::InvalidGcode, Some(2))),
        (
            "G28\nM104 S200\nTEMPERATURE_WAIT SENSOR=extruder1 MINIMUM=40\nG1 X5\nM104 S0\n",
            (C::NoSuchHeater, Some(3)),
        ),
        ("", (C::FileEmpty, None)),
    ] {
        assert_eq!(errors(text), [expected], "{text}");
    }
}

#[test]
fn motors_that_hang_together_are_off_together() {
    for (machine, off) in [
        (include_str!("../../../../samples/corexy.cfg"), "G28\nG1 Z5\nM84 X\nG1 Y5\n"),
        (include_str!("../../../../samples/delta.cfg"), "G28\nG1 Z5\nM84 X\nG1 Z6\n"),
    ] {
        assert_eq!(found(machine, off), [(ErrorCode::NotHomed, Some(4))], "{off}");
    }
}

#[test]
fn an_arc_that_bulges_out_of_a_round_bed_is_found() {
    // The ends of its only chord are within the bed's 110 mm, its middle is not.
    let arc = "G28\nG1 Z5\nG1 X78.13417 Y77.42706\nG3 X77.42706 Y78.13417 I-42.77996 J-42.07285\n";
    let delta = include_str!("../../../../samples/delta.cfg");
    assert_eq!(found(delta, arc), [(ErrorCode::MoveOutOfRange, Some(4))]);
}

#[test]
fn what_no_driver_can_step_is_found_at_its_line() {
    // 2560 steps/mm in X: with pulses of 2 µs 97 mm/s is the most.
    let usual = include_str!("../../../../samples/printer.cfg");
    let text = usual.replacen("rotation_distance: 40", "rotation_distance: 1.25", 1);
    let found = |file: &str| found(&text, file);
    let too_fast = |line| vec![(ErrorCode::StepRateTooHigh, Some(line))];
    assert_eq!(found("G28\nG1 X50 F5800\nG1 X5 Y100 F6500\n"), []);
    assert_eq!(found("G28\nG1 X50 F5800\nG1 X5 F6000\n"), too_fast(3));
    // A file that asks for less than its feed gets that.
    assert_eq!(found("G28\nSET_VELOCITY_LIMIT VELOCITY=90\nG1 X50 F9000\n"), []);
    assert_eq!(found("G28\nM220 S200\nG1 X50 F3000\n"), too_fast(3));
}

#[test]
fn arcs_are_judged_by_their_chords() {
    assert_eq!(errors("G28\nG1 X270 Y150\nG2 X270 Y150 I10\n"), []);
    let found = errors("G28\nG1 X270 Y150\nG2 X270 Y150 I40\n");
    assert_eq!(found, [(ErrorCode::MoveOutOfRange, Some(3))]);
}

#[test]
fn what_is_not_there_may_be_switched_off() {
    assert_eq!(errors("G28\nG1 X5\nM141 S0\nM104 T1 S0\n"), []);
}

#[test]
fn unknown_commands_and_a_hot_end_block() {
    let report = check(&format!("{WARM}PRIME_NOZZLE\nG1 X10 E1\n"));
    let lines: Vec<u32> = report.blocking.iter().map(|blocking| blocking.line).collect();
    assert_eq!(lines, [4, 5]);
    assert!(report.blocking[1].message.contains("cut off"));
}

#[test]
fn a_million_faults_take_the_room_of_a_thousand() {
    let mut checker = Checker::new(Some(&machine_file()));
    for _ in 0..1000 {
        checker.feed(&b"G1 X9999\nFOO\nG1 Xx\n".repeat(5));
    }
    let report = checker.finish();
    assert_eq!(report.errors.len(), FINDINGS_MAX);
    assert!(report.blocking.len() <= FINDINGS_MAX && report.diagnostics.len() <= FINDINGS_MAX);
    assert!(report.dropped > 10_000);
}
