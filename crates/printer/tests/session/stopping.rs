//! Pause, resume, cancel, emergency stop.

use std::fmt::Write;

use gcode::Heater;
use printer::{
    error::ErrorCode,
    session::{Event, JobStatus, PhaseName, Request},
};
use units::Celsius;

use crate::{
    bench::{Bench, Setup},
    print::{END, START, print_alone, squares},
};

fn paused(bench: &mut Bench) {
    bench.ask(Request::Pause);
    bench.until("the pause", 12.0, |bench| bench.session.job_status() == JobStatus::Paused);
    assert!(bench.events.contains(&Event::Paused));
}

#[test]
fn a_paused_job_goes_on_where_it_was() {
    let (expected, _) = print_alone(&squares(3));
    let mut bench = Setup::default().ready();
    bench.start(&squares(3));
    bench.line(14);
    paused(&mut bench);
    let pulses = bench.pulses().len();
    bench.run(5.0);
    assert_eq!(bench.pulses().len(), pulses);
    // It stays hot meanwhile.
    assert!(bench.celsius(0) > 60.0);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    assert_eq!(bench.counts(), expected);
}

#[test]
fn a_paused_job_comes_back_after_moves_homing_and_extrusion() {
    let (expected, _) = print_alone(&squares(3));
    let mut bench = Setup::default().ready();
    bench.start(&squares(3));
    bench.line(14);
    paused(&mut bench);
    bench.gcode("G91\nG1 Z10 F600\nG90\nG1 X5 Y5 F6000\nM83\nG1 E3 F120\nG92 X0");
    assert_eq!(bench.errors(), []);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    let pushed = 3.0 * 3200.0 / 22.67;
    let counts = bench.counts();
    assert_eq!(counts[..3], expected[..3]);
    assert!((counts[3] as f64 - expected[3] as f64 - pushed).abs() <= 1.0, "{counts:?} {expected:?}");
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
}

#[test]
fn a_pause_in_an_arc_loses_no_filament() {
    // A slow arc of hundreds of chords: the pause falls into it.
    let file = format!("{START}G1 X20 Y75 F6000\nG2 X20 Y75 I50 E20 F900\nG1 X10 F6000\n{END}");
    let (expected, _) = print_alone(&file);
    let mut bench = Setup::default().ready();
    bench.start(&file);
    bench.line(9);
    paused(&mut bench);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    assert_eq!(bench.counts(), expected);
}

#[test]
fn a_pause_breaks_a_wait_off_and_takes_it_up_again() {
    let mut bench = Setup::default().ready();
    // The machine is not even homed yet.
    bench.start(&format!("M104 S75\nM190 S60\nG28\nM109 S75\nG1 X20 F6000\nG1 X30 E1\n{END}"));
    bench.run(5.0);
    paused(&mut bench);
    assert!(bench.celsius(1) < 60.0);
    bench.run(2.0);
    bench.ask(Request::Resume);
    bench.run(1.0);
    assert_eq!(bench.pulses(), []);
    bench.job_over();
    bench.job_done();
    assert!(!bench.pulses().is_empty());
}

#[test]
fn a_pause_before_a_wait_keeps_the_wait() {
    let mut bench = Setup::default().ready();
    bench.start(&format!("{START}G1 X100 F600\nM109 S100\nG1 X10 E1 F1200\n{END}"));
    bench.line(8);
    bench.run(0.2);
    paused(&mut bench);
    bench.run(5.0);
    assert!(bench.celsius(0) < 85.0, "the wait has begun in the pause");
    bench.ask(Request::Resume);
    bench.until("hot", 120.0, |bench| bench.celsius(0) > 98.0);
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_pause_in_the_file_waits_for_the_user() {
    let mut bench = Setup::default().ready();
    bench.start("G28\nG1 X20 F6000\nM0\nG1 X30\n");
    bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
    bench.assert_position(20.0, 150.0, 0.5);
    // Once it is paused another pause is nothing new.
    bench.ask(Request::Pause);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    bench.assert_position(30.0, 150.0, 0.5);
}

#[test]
fn a_job_is_not_resumed_cold_or_without_its_position() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(3));
    bench.line(12);
    paused(&mut bench);
    bench.ask(Request::SetTemperature(Heater::Tool(0), Celsius(0.0)));
    bench.until("cold", 200.0, |bench| bench.celsius(0) < 55.0);
    bench.gcode("M84");
    bench.until("motors off", 90.0, |bench| !bench.printer.state().motors[0].energised);
    assert_eq!(bench.request(Request::Resume).unwrap_err().code, ErrorCode::NotHomed);
    assert_eq!(bench.session.job_status(), JobStatus::Paused);
    bench.gcode("G28");
    let pulses = bench.pulses().len();
    bench.ask(Request::Resume);
    bench.until("heat", 90.0, |bench| bench.celsius(0) > 65.0);
    assert_eq!(bench.pulses().len(), pulses, "it is heated first");
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_pause_without_end_switches_the_heaters_off_and_keeps_the_position() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(2));
    bench.line(12);
    paused(&mut bench);
    bench.run(33.0);
    bench.assert_safe();
    assert_eq!(bench.session.job_status(), JobStatus::Paused);
    assert_eq!(bench.session.position().unwrap().1, [true; 3]);
    assert!(bench.state().motors.iter().all(|motor| motor.energised));
}

#[test]
fn a_cancelled_job_ends_with_everything_off() {
    // Between the orders in the file and their time there are seconds: none may come true afterwards.
    let mut file = String::from(START);
    for n in 0..40 {
        write!(file, "G1 X60 E1 F1200\nM104 S{}\nM106 S255\nG1 X10 E1\n", 70 + n % 2).unwrap();
    }
    let mut bench = Setup::default().ready();
    bench.start(&file);
    bench.line(16);
    bench.events.clear();
    bench.ask(Request::Cancel);
    bench.job_over();
    assert!(bench.events.contains(&Event::JobCancelled));
    let heats = |event: &Event| matches!(event, Event::Temperature { target, .. } if target.0 > 0.0);
    assert!(!bench.events.iter().any(heats), "an order of the cancelled job came true");
    assert_eq!(bench.errors(), []);
    bench.run(5.0);
    bench.assert_all_off();
    let state = bench.state();
    let (claimed, _) = bench.session.position().unwrap();
    assert!((state.motors[0].position.0 - claimed[0]).abs() < 0.1);
    bench.run(10.0);
    bench.home();
}

#[test]
fn cancelling_a_wait_for_a_temperature_ends_it_at_once() {
    let mut bench = Setup::default().ready();
    bench.start("M104 S200\nG28\nM109 S200\nG1 X20\n");
    bench.until("homed", 60.0, |bench| bench.session.position().unwrap().1 == [true; 3]);
    bench.run(2.0);
    bench.ask(Request::Cancel);
    bench.run(0.5);
    assert_eq!(bench.session.job_status(), JobStatus::None);
    bench.assert_all_off();
}

#[test]
fn cancelling_stops_an_axis_that_is_being_homed() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.gcode("G1 X150 F9000");
    bench.start("G28 X\nG28 Y\n");
    bench.run(1.2);
    let begun = bench.state().motors[0].position.0;
    assert!(begun < 149.0, "{begun}");
    bench.ask(Request::Cancel);
    bench.run(0.5);
    assert_eq!(bench.session.job_status(), JobStatus::None);
    assert!(bench.state().motors[0].position.0 > 80.0);
    // Where it stopped nobody knows.
    assert_eq!(bench.session.position().unwrap().1, [false, true, true]);
    bench.assert_all_off();
    bench.home();
    bench.assert_position(0.0, 150.0, 0.5);
}

#[test]
fn cancelling_before_an_axis_has_begun_to_home_leaves_it_still() {
    for delay in [0.0, 0.01, 0.1, 0.2, 0.26, 0.3, 0.35, 0.5] {
        let mut bench = Setup::default().ready();
        bench.ask(Request::Gcode("G28 X".into()));
        bench.run(delay);
        bench.ask(Request::Cancel);
        bench.run(1.0);
        bench.assert_all_off();
        assert!(!bench.session.position().unwrap().1[0], "{delay}");
        bench.home();
        bench.assert_position(0.0, 150.0, 0.5);
    }
}

#[test]
fn an_emergency_stop_reaches_the_board_at_once_and_a_restart_makes_it_ready() {
    for typed in [false, true] {
        let mut bench = Setup::default().ready();
        bench.start(&squares(3));
        bench.line(12);
        let asked = bench.now();
        bench.ask(if typed { Request::Gcode("m112 ; stop\n".into()) } else { Request::EmergencyStop });
        bench.until("shutdown", 0.1, |bench| bench.printer.state().shutdown.is_some());
        assert!((bench.now() - asked).0 <= 0.1);
        bench.failed(ErrorCode::EmergencyStop, None);
        assert_eq!(bench.session.phase(), PhaseName::Shutdown);
        assert_eq!(bench.session.position(), None);
        bench.assert_all_off();
        bench.run(30.0);
        bench.assert_all_off();
        bench.events.clear();
        bench.ask(Request::FirmwareRestart);
        assert_eq!(bench.session.phase(), PhaseName::Restarting);
        bench.connect();
        assert_eq!(bench.session.job_status(), JobStatus::None);
        assert_eq!(bench.session.position().unwrap().1, [false; 3]);
        bench.assert_all_off();
        bench.home();
        assert_eq!(bench.errors(), []);
    }
}

#[test]
fn an_emergency_stop_in_a_file_stops_there() {
    let mut bench = Setup::default().ready();
    bench.start("G28\nG1 X20 F6000\nM112\nG1 X30\n");
    bench.until("shutdown", 30.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    bench.failed(ErrorCode::EmergencyStop, Some(3));
    bench.assert_all_off();
    assert!((bench.state().motors[0].position.0 - 20.0).abs() < 0.1);
}

#[test]
fn a_restart_while_printing_ends_the_job() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(2));
    bench.line(12);
    bench.ask(Request::FirmwareRestart);
    assert!(bench.events.contains(&Event::JobCancelled));
    bench.connect();
    assert_eq!(bench.session.job_status(), JobStatus::None);
    bench.assert_all_off();
}
