//! Typed G-code: homing, moves, and what is refused.

use printer::{
    error::ErrorCode,
    session::{Event, PhaseName, Request},
};

use crate::bench::Setup;

#[test]
fn homing_finds_the_endstops_and_claims_positions_only_then() {
    let mut bench = Setup::default().ready();
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    bench.home();
    bench.assert_position(0.0, 150.0, 0.5);
    let homed: Vec<usize> = bench
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Homed { axis, steps, .. } => {
                assert!(*steps > 100);
                Some(*axis)
            }
            _ => None,
        })
        .collect();
    assert_eq!(homed, [0, 1, 2]);
    bench.gcode("G1 X100 Y20 Z5 F6000");
    bench.assert_position(100.0, 20.0, 5.0);
    bench.assert_safe();
}

#[test]
fn a_homed_axis_that_is_homed_again_claims_nothing_meanwhile() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("G1 X50 F6000");
    bench.ask(Request::Gcode("G28 X".into()));
    bench.run(0.6);
    assert_eq!(bench.session.position().unwrap().1, [false, true, true]);
    bench.settle();
    bench.assert_position(0.0, 150.0, 0.5);
}

#[test]
fn an_axis_without_a_way_back_homes_once_and_again_where_it_stands() {
    let mut bench = Setup::config("homing_speed: 40", "homing_retract_dist: 0\nhoming_speed: 40").ready();
    bench.home();
    bench.home();
    bench.assert_position(0.0, 150.0, 0.5);
}

#[test]
fn a_move_before_homing_is_refused_and_nothing_moves() {
    let mut bench = Setup::default().ready();
    bench.gcode("G91\nG1 X1 F600");
    bench.failed(ErrorCode::NotHomed, Some(2));
    assert_eq!(bench.pulses(), []);
    bench.assert_all_off();
}

#[test]
fn a_move_out_of_range_is_refused_and_the_next_one_starts_where_the_machine_is() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("G1 X100 Y100 F6000\nG92 Z0\nG1 X151");
    bench.failed(ErrorCode::MoveOutOfRange, Some(4));
    bench.assert_position(100.0, 100.0, 0.5);
    bench.gcode("G1 Y90");
    bench.assert_position(100.0, 90.0, 0.5);
    // The offset of G92 still holds.
    bench.gcode("G1 Z1");
    bench.assert_position(100.0, 90.0, 1.5);
}

#[test]
fn cold_filament_is_not_pushed() {
    let mut bench = Setup::default().ready();
    bench.home();
    let counts = bench.counts();
    bench.gcode("G1 X20 E1 F600");
    bench.failed(ErrorCode::ColdExtrusion, Some(2));
    assert_eq!(bench.counts(), counts);
    bench.assert_all_off();
}

#[test]
fn what_cannot_be_read_and_what_is_unknown_stops_the_rest_of_what_was_typed() {
    for (line, code) in [("G1 Xfoo", ErrorCode::InvalidGcode), ("START_PRINT", ErrorCode::UnknownCommand)] {
        let mut bench = Setup::default().ready();
        bench.home();
        bench.gcode(&format!("G1 X20\n{line}\nG1 X40"));
        bench.failed(code, Some(3));
        bench.assert_position(20.0, 150.0, 0.5);
        bench.gcode("G1 X30");
        bench.assert_position(30.0, 150.0, 0.5);
    }
}

#[test]
fn motors_that_were_off_are_on_again_before_they_move() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("M84\nG28\nG1 X30 Y100 Z5 F9000");
    bench.assert_position(30.0, 100.0, 5.0);
    bench.gcode("M84");
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    assert!(bench.state().motors.iter().all(|motor| !motor.energised));
    bench.gcode("G1 X10");
    bench.failed(ErrorCode::NotHomed, Some(6));
}

#[test]
fn a_machine_that_nobody_uses_is_switched_off() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("M104 S60\nM140 S40");
    bench.run(15.0);
    assert!(bench.celsius(0) > 40.0);
    bench.run(20.0);
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    assert!(bench.state().motors.iter().all(|motor| !motor.energised));
    bench.assert_all_off();
    let told = |event: &&&Event| matches!(event, Event::Message(text) if text.contains("idle"));
    assert_eq!(bench.remarkable().iter().filter(told).count(), 1);
    assert_eq!(bench.session.phase(), PhaseName::Ready);
    bench.home();
}

#[test]
fn setting_a_target_counts_as_use() {
    let mut bench = Setup::default().ready();
    for _ in 0..4 {
        bench.run(12.0);
        bench.ask(Request::SetTemperature(gcode::Heater::Bed, units::Celsius(40.0)));
    }
    assert!(bench.celsius(1) > 30.0);
    assert!(!bench.events.iter().any(|event| matches!(event, Event::Message(_))));
}

#[test]
fn a_typed_wait_can_be_cancelled() {
    let mut bench = Setup::default().ready();
    bench.ask(Request::Gcode("M109 S200\nG28".into()));
    bench.run(5.0);
    bench.ask(Request::Cancel);
    bench.run(3.0);
    assert_eq!(bench.pulses(), []);
    bench.assert_all_off();
    bench.home();
}

#[test]
fn heaters_are_named_as_in_the_machine_file() {
    let mut bench = Setup::default().ready();
    bench.gcode("M104 T1 S200");
    let error = bench.error();
    assert_eq!((error.code, error.line), (ErrorCode::NoSuchHeater, Some(1)));
    assert!(error.detail.contains("extruder1") && !error.detail.contains("Tool"), "{error}");
    bench.events.clear();
    bench.gcode("M104 S300");
    bench.failed(ErrorCode::TargetOutOfRange, Some(1));
    bench.events.clear();
    // Switching off what is not there is what many files end with.
    bench.gcode("M141 S0\nM104 T1 S0\nM109 T1 S0");
    assert_eq!(bench.errors(), []);
    bench.assert_all_off();
}
