//! Files and machines that are not in order.

use printer::{
    error::{Ended, ErrorCode},
    session::{JobOptions, JobStatus, PhaseName, Request},
};

use crate::{
    bench::{Bench, Setup},
    print::{END, START, squares},
};

/// Prints a file that fails by itself; the machine stays connected.
fn fails(file: &str, code: ErrorCode, line: Option<u32>) -> Bench {
    let mut bench = Setup::default().ready();
    bench.print(file);
    bench.failed(code, line);
    assert_eq!(bench.error().ended, Ended::Job);
    assert_eq!(bench.session.phase(), PhaseName::Ready);
    bench.assert_all_off();
    let state = bench.state();
    assert!(state.motors.iter().all(|motor| motor.lost.0 == 0));
    let (claimed, homed) = bench.session.position().unwrap();
    for axis in (0..3).filter(|&axis| homed[axis]) {
        assert!((state.motors[axis].position.0 - claimed[axis]).abs() < 0.1, "{axis}");
    }
    bench
}

#[test]
fn a_job_that_does_not_home() {
    let bench = fails("G1 X10 F600\n", ErrorCode::NotHomed, Some(1));
    assert_eq!(bench.pulses(), []);
}

#[test]
fn a_job_that_leaves_the_machine() {
    let mut bench = fails("G28\nG1 X20 F6000\nG1 X150.1\nG1 X10\n", ErrorCode::MoveOutOfRange, Some(3));
    bench.assert_position(20.0, 150.0, 0.5);
    let arcs = "G28\nG1 X75 Y75 F6000\nG2 X75 Y75 I30 F3000\nG3 X75 Y75 I60 F3000\n";
    fails(arcs, ErrorCode::MoveOutOfRange, Some(4));
}

#[test]
fn a_job_that_extrudes_cold() {
    fails("G28\nG1 X20 E1 F6000\n", ErrorCode::ColdExtrusion, Some(2));
    // Nearly hot enough is not hot enough, and what was switched on goes off.
    fails("G28\nM104 S200\nG1 X20 E1 F6000\nM106\n", ErrorCode::ColdExtrusion, Some(3));
}

#[test]
fn a_job_that_moves_filament_by_the_metre() {
    for line in ["G1 E60", "G1 E-60", "G1 X30 E-60", "G1 X30 E-999999999"] {
        let file = format!("{START}G1 X20 F6000\n{line}\n");
        fails(&file, ErrorCode::ExtrusionTooLong, Some(9));
    }
}

#[test]
fn filament_at_a_place_that_is_named_again_is_on_the_spot() {
    let file = format!(
        "{START}G20\nG1 X1.1 Y1.3 F200\nG92 X0.3 Y0.7\nG1 X0.3 Y0.7 E0.4\nG1 X0.7 Y0.3\nG1 X0.7 Y0.3 E0.4\n{END}"
    );
    let mut bench = Setup::default().ready();
    bench.start_with(&file, JobOptions::default()).unwrap();
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_job_with_a_line_that_cannot_be_read() {
    let file = squares(2).replacen("G1 Y90 E1", "G1 Y9O E1", 1);
    let line = file.lines().position(|line| line.contains("9O")).unwrap() as u32 + 1;
    fails(&file, ErrorCode::InvalidGcode, Some(line));
}

#[test]
fn a_job_with_a_macro_must_be_confirmed() {
    let file = format!("{START}G1 X20 F6000\nPURGE_LINE\nG1 X30 E1\n{END}");
    fails(&file, ErrorCode::UnknownCommand, Some(9));
    for options in [
        JobOptions { confirmed_lines: [9].into(), ..JobOptions::default() },
        JobOptions { confirm_all: true, ..JobOptions::default() },
    ] {
        let mut bench = Setup::default().ready();
        bench.start_with(&file, options).unwrap();
        bench.job_over();
        bench.job_done();
    }
    let mut bench = Setup::default().ready();
    let other = JobOptions { confirmed_lines: [8].into(), ..JobOptions::default() };
    bench.start_with(&file, other).unwrap();
    bench.job_over();
    bench.failed(ErrorCode::UnknownCommand, Some(9));
}

#[test]
fn a_job_without_a_move() {
    fails("", ErrorCode::FileEmpty, None);
    fails("; nothing\n\n", ErrorCode::FileEmpty, None);
    fails("M104 S70\n", ErrorCode::FileEmpty, None);
}

#[test]
fn a_job_that_was_cut_off() {
    let whole = squares(2);
    let middle = whole.match_indices("G1 X90").nth(1).unwrap().0;
    let lines = whole[..middle].lines().count() as u32;
    fails(&whole[..middle], ErrorCode::FileCutOff, Some(lines));
    // In the middle of a line: what can still be read, and what cannot.
    fails(&whole[..middle + 5], ErrorCode::FileCutOff, Some(lines + 1));
    fails(&whole[..middle + 4], ErrorCode::InvalidGcode, Some(lines + 1));
}

#[test]
fn a_job_that_heats_what_is_not_there_or_too_much() {
    fails("G28\nM141 S40\nG1 X5\n", ErrorCode::NoSuchHeater, Some(2));
    fails("G28\nM109 T1 S200\nG1 X5\n", ErrorCode::NoSuchHeater, Some(2));
    fails("G28\nM190 S121\nG1 X5\n", ErrorCode::TargetOutOfRange, Some(2));
    fails("G28\nG1 X5 F600\nM104 S261\nG1 X9\n", ErrorCode::TargetOutOfRange, Some(3));
    fails("G28\nT1\nG1 X5\n", ErrorCode::NoSuchHeater, Some(2));
}

#[test]
fn a_move_that_no_driver_can_step() {
    // 200 mm/s would take 320 thousand steps a second, and pulses of 2 µs allow 250 thousand.
    let fine = "rotation_distance: 40\nmicrosteps: 16\nendstop_pin: ^gpio20";
    let finer = "rotation_distance: 8\nmicrosteps: 64\nendstop_pin: ^gpio20";
    let mut bench = Setup::config(fine, finer).ready();
    bench.home();
    bench.gcode("G1 X5 F12000");
    bench.failed(ErrorCode::StepRateTooHigh, Some(1));
    assert!(bench.error().detail.contains("stepper_x at 200 mm/s"), "{}", bench.error());
    bench.gcode("G1 X5 F3000");
    bench.assert_position(5.0, 150.0, 0.5);
}

#[test]
fn more_of_a_file_than_was_asked_for_ends_the_job() {
    let mut bench = Setup::default().ready();
    bench.feed_max = 0;
    bench.start("");
    bench.session.job_feed(&vec![b'\n'; 100_000]);
    bench.job_over();
    bench.failed(ErrorCode::Internal, None);
    bench.assert_all_off();
}

/// Prints until a part fails and the board stops.
fn stops(faults: &str, code: &[ErrorCode]) -> Bench {
    let mut bench = Setup::faults(faults).ready();
    let body: String = (0..60).map(|_| "G1 X100 E2 F1200\nG1 X10 E2\n").collect();
    bench.start(&format!("{START}{body}{END}"));
    bench.until("the stop", 400.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    let error = bench.error();
    assert!(code.contains(&error.code), "{error}");
    bench.until("the board's stop", 0.1, |bench| bench.printer.state().shutdown.is_some());
    assert_eq!(bench.session.position(), None);
    assert_eq!(bench.session.job_status(), JobStatus::None);
    bench.assert_all_off();
    let refused = bench.request(Request::Gcode("G28".into())).unwrap_err();
    assert_eq!(refused.code, ErrorCode::NotConnected);
    bench
}

#[test]
fn a_sensor_that_comes_off() {
    let below = [ErrorCode::SensorBelowMin, ErrorCode::BoardSensorRange];
    let bench = stops("sensor-open=extruder@40", &below);
    assert!(bench.age() < 47.0, "{}", bench.age());
    assert!(bench.error().what_happened().contains("extruder"), "{}", bench.error());
    stops("sensor-open=heater_bed@40", &below);
}

#[test]
fn a_sensor_that_is_shorted() {
    let above = [ErrorCode::SensorAboveMax, ErrorCode::BoardSensorRange];
    let bench = stops("sensor-short=extruder@40", &above);
    assert!(bench.age() < 47.0, "{}", bench.age());
    stops("sensor-short=heater_bed@40", &above);
}

#[test]
fn a_sensor_that_was_never_there() {
    let mut bench = Setup::faults("sensor-open=extruder").bench();
    bench.until("the stop", 20.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    assert!([ErrorCode::SensorBelowMin, ErrorCode::BoardSensorRange].contains(&bench.error().code));
    bench.assert_all_off();
}

#[test]
fn a_heater_that_does_not_warm() {
    let bench = stops("heater-dead=extruder", &[ErrorCode::HeaterNotHeating]);
    assert!(bench.error().what_happened().contains("extruder"), "{}", bench.error());
}

#[test]
fn a_heater_that_dies_in_the_middle() {
    stops("heater-dead=extruder@45", &[ErrorCode::HeaterDrifted, ErrorCode::HeaterNotHeating]);
}

#[test]
fn a_heater_that_cannot_be_switched_off() {
    let mut bench = Setup::faults("heater-stuck-on=extruder@8").bench();
    bench.until("the stop", 400.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    assert!([ErrorCode::SensorAboveMax, ErrorCode::BoardSensorRange].contains(&bench.error().code));
    assert!(bench.error().what_to_do().contains("mains power"));
}

#[test]
fn an_endstop_that_is_stuck() {
    for (fault, code) in [
        ("endstop-stuck-on=x", ErrorCode::EndstopStillTriggered),
        ("endstop-stuck-off=x", ErrorCode::EndstopNotReached),
    ] {
        let mut bench = Setup::faults(fault).ready();
        bench.print(&format!("M104 S70\nM106\n{START}G1 X5\n"));
        bench.failed(code, Some(5));
        let error = bench.error();
        assert!(error.detail.starts_with('X') && error.ended == Ended::Job, "{error:?}");
        assert_eq!(bench.session.position().unwrap().1, [false; 3]);
        bench.assert_all_off();
        // The other axes can still be homed, this one not.
        bench.events.clear();
        bench.gcode("G28 Y");
        assert_eq!(bench.session.position().unwrap().1, [false, true, false]);
        bench.gcode("G28 X");
        assert_eq!(bench.error().code, code);
        assert_eq!(bench.session.position().unwrap().1, [false, true, false]);
    }
}

/// A long way at 20 mm/s in short pieces, and a line that leaves the machine.
fn long_way_out() -> String {
    let pieces = "G1 X21 E0.02\nG1 X20 E0.02\n".repeat(150);
    format!("{START}G1 X20 Y20 F6000\nG1 F1200\n{pieces}G1 X1000\n{END}")
}

/// Its line.
fn line_out() -> u32 {
    let before = long_way_out().lines().take_while(|line| *line != "G1 X1000").count();
    before as u32 + 1
}

#[test]
fn what_was_planned_before_a_bad_line_is_made_hot() {
    let mut bench = Setup::default().ready();
    bench.start(&long_way_out());
    bench.until("the bad line", 200.0, |bench| bench.session.job_status() == JobStatus::Ending);
    let before = bench.pulses().len();
    bench.run(2.0);
    assert!(bench.pulses().len() > before + 1000, "the way goes on");
    bench.job_over();
    bench.failed(ErrorCode::MoveOutOfRange, Some(line_out()));
    // Ten seconds without heat cost more.
    assert!(bench.celsius(0) > 67.0, "{}", bench.celsius(0));
    bench.assert_all_off();
}

#[test]
fn who_cancels_meanwhile_need_not_wait_for_it() {
    let mut bench = Setup::default().ready();
    bench.start(&long_way_out());
    bench.until("the bad line", 200.0, |bench| bench.session.job_status() == JobStatus::Ending);
    let since = bench.now();
    bench.ask(Request::Cancel);
    bench.job_over();
    assert!((bench.now() - since).0 < 2.0, "{:?}", bench.now() - since);
    bench.failed(ErrorCode::MoveOutOfRange, Some(line_out()));
    bench.assert_all_off();
}
