//! Typed G-code: homing, moves, and what is refused.

use printer::{
    error::ErrorCode,
    session::{Event, PhaseName, Request},
};

use units::{Mm, MmPerS};

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
                assert!(steps[*axis] > 100);
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
    bench.failed(ErrorCode::MoveOutOfRange, Some(3));
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
    bench.failed(ErrorCode::ColdExtrusion, Some(1));
    assert_eq!(bench.counts(), counts);
    bench.assert_all_off();
}

#[test]
fn what_cannot_be_read_and_what_is_unknown_stops_the_rest_of_what_was_typed() {
    for (line, code) in [("G1 Xfoo", ErrorCode::InvalidGcode), ("START_PRINT", ErrorCode::UnknownCommand)] {
        let mut bench = Setup::default().ready();
        bench.home();
        bench.gcode(&format!("G1 X20\n{line}\nG1 X40"));
        bench.failed(code, Some(2));
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
    bench.failed(ErrorCode::NotHomed, Some(1));
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

#[test]
fn lines_are_counted_from_the_first_of_each_text() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("G1 X20 F6000\nG1 X30");
    bench.gcode("G1 X999");
    bench.failed(ErrorCode::MoveOutOfRange, Some(1));
    bench.events.clear();
    bench.gcode("G1 X40\n\nG1 X999");
    bench.failed(ErrorCode::MoveOutOfRange, Some(3));
    bench.events.clear();
    // Also those of a text that has to wait for the one before.
    bench.ask(Request::Gcode("G28 X\nG1 X10".into()));
    bench.ask(Request::Gcode("G1 X20\nG1 Xfoo".into()));
    bench.settle();
    bench.failed(ErrorCode::InvalidGcode, Some(2));
    bench.assert_position(20.0, 150.0, 0.5);
}

fn by_hand(axis: usize, distance_mm: f64, speed_mm_s: f64) -> Request {
    Request::MoveBy { axis, distance: Mm(distance_mm), speed: MmPerS(speed_mm_s) }
}

#[test]
fn moves_by_hand_leave_modes_feed_and_factors_as_they_were() {
    for (modes, step) in [("G90\nM82", 60.0), ("G91\nM83", 80.0)] {
        let mut bench = Setup::default().ready();
        bench.home();
        bench.gcode(&format!("G90\nG1 X20 F1200\nM220 S50\nM221 S200\n{modes}"));
        for request in [by_hand(0, 30.0, 60.0), by_hand(0, -10.0, 60.0), by_hand(1, -50.0, 60.0)] {
            bench.ask(request);
        }
        bench.settle();
        bench.assert_position(40.0, 100.0, 0.5);
        bench.ask(by_hand(2, 999.0, 5.0));
        bench.settle();
        bench.failed(ErrorCode::MoveOutOfRange, None);
        bench.events.clear();
        // Absolute to X60, or by 60 - 20 mm more.
        bench.gcode(&format!("G1 X{}", if step == 60.0 { 60.0 } else { 40.0 }));
        bench.assert_position(step, 100.0, 0.5);
        let last = |event: &Event| if let Event::Move(made) = event { Some(*made) } else { None };
        let made = bench.events.iter().filter_map(last).next_back().unwrap();
        assert!((made.speed.cruise.0 - 10.0).abs() < 1e-9, "{made:?}");
        assert_eq!(bench.session.factors(), [0.5, 2.0]);
    }
}

#[test]
fn filament_is_moved_by_hand_as_far_as_asked_and_the_console_takes_no_notice() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("M82\nM221 S200\nM104 S70");
    bench.until("warm", 100.0, |bench| bench.celsius(0) > 65.0);
    bench.gcode("G92 E0\nG1 E2 F300");
    let before = bench.session.position().unwrap().0[3];
    bench.ask(by_hand(3, 5.0, 3.0));
    bench.ask(by_hand(3, -1.0, 3.0));
    bench.settle();
    let after = bench.session.position().unwrap().0[3];
    assert!((after - before - 4.0).abs() < 1e-9, "{before} {after}");
    // Where `G92` counts from has moved along.
    bench.gcode("G1 E2");
    assert_eq!(bench.session.position().unwrap().0[3], before);
    assert_eq!(bench.errors(), []);
}
