//! Heaters that the board regulates: a host that is away for long finds them at stand-by or off, and its print whole.

use gcode::Heater;
use printer::{
    error::ErrorCode,
    session::{Event, JobStatus, PhaseName, Request},
};
use units::Celsius;
use virtual_printer::BoardProfile;

use crate::{
    bench::{Bench, Setup},
    hold::{clean, held, holds, on_the_way, printed, stall},
    print::squares,
};

/// Stand-by well below what the test prints with.
fn setup(board: BoardProfile) -> Setup {
    let mut setup = Setup { board, ..Setup::default() };
    setup.config = setup.config.replacen("min_extrude_temp: 60", "min_extrude_temp: 60\nstandby_temp: 40", 1);
    // The user takes longer than usual to come back.
    setup.config = setup.config.replacen("timeout: 30", "timeout: 7200", 1);
    setup
}

/// The last that was said of a heater: its target, and whether the board has lowered it.
fn told(bench: &Bench, of: Heater) -> (f64, bool) {
    let reading = |event: &Event| match event {
        Event::Temperature { heater, target, standby, .. } if *heater == of => Some((target.0, *standby)),
        _ => None,
    };
    bench.events.iter().rev().find_map(reading).expect("a reading")
}

const NOZZLE: Heater = Heater::Tool(0);

#[test]
fn a_host_that_is_away_for_long_finds_its_print_where_it_was() {
    for board in BoardProfile::all() {
        let setup = setup(board);
        let expected = clean(&setup);
        for seconds in [10.0, 30.0, 64.0, 600.0, 2400.0] {
            let (mut bench, from) = on_the_way(&setup);
            stall(&mut bench, seconds);
            held(&mut bench);
            assert_eq!((holds(&bench), bench.errors()), (vec![ErrorCode::HeldHostAway], vec![]));
            let is_over = seconds > 1900.0;
            let expected_of = |standby| if is_over { (0.0, true) } else { (standby, true) };
            assert_eq!(told(&bench, NOZZLE), expected_of(40.0), "{seconds}");
            assert_eq!(told(&bench, Heater::Bed), expected_of(35.0));
            // Nothing is heated before the user says so.
            let cool = bench.celsius(0);
            bench.run(5.0);
            assert!(bench.celsius(0) < cool + 1.5);
            bench.ask(Request::Resume);
            bench.until("motion", 200.0, |bench| bench.events.contains(&Event::Resumed));
            assert!(bench.celsius(0) > 67.0, "{}", bench.celsius(0));
            bench.job_over();
            bench.job_done();
            assert_eq!(holds(&bench).len(), 1);
            assert!(printed(&mut bench, from) == expected, "{} {seconds}", setup.board.name);
        }
    }
}

#[test]
fn a_short_stall_leaves_the_heaters_alone() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040()));
    stall(&mut bench, 4.0);
    held(&mut bench);
    assert_eq!((told(&bench, NOZZLE), told(&bench, Heater::Bed)), ((70.0, false), (35.0, false)));
    bench.ask(Request::Resume);
    bench.until("motion", 2.0, |bench| bench.events.contains(&Event::Resumed));
}

#[test]
fn a_host_that_never_comes_back_leaves_a_printer_that_cools() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040()));
    bench.stalled = true;
    bench.run(3.0);
    let pulses = bench.pulses().len();
    bench.run(900.0);
    assert!((bench.celsius(0) - 40.0).abs() < 2.0 && (bench.celsius(1) - 35.0).abs() < 3.0);
    bench.run(1000.0);
    let state = bench.state();
    assert_eq!((state.shutdown, bench.pulses().len()), (None, pulses));
    assert!(state.heaters.iter().all(|heater| heater.duty == 0.0));
    assert!(state.motors.iter().all(|motor| motor.energised && motor.lost.0 == 0));
}

#[test]
fn the_user_may_end_what_is_being_heated_again() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040()));
    stall(&mut bench, 200.0);
    held(&mut bench);
    bench.ask(Request::Resume);
    bench.run(3.0);
    assert_eq!((told(&bench, NOZZLE), bench.session.job_status()), ((70.0, false), JobStatus::Printing));
    bench.ask(Request::Cancel);
    bench.job_over();
    assert!(bench.events.contains(&Event::JobCancelled));
    bench.assert_all_off();
}

#[test]
fn another_stall_while_it_is_heated_again_asks_again() {
    let setup = setup(BoardProfile::rp2040());
    let expected = clean(&setup);
    let (mut bench, from) = on_the_way(&setup);
    stall(&mut bench, 200.0);
    held(&mut bench);
    bench.ask(Request::Resume);
    bench.run(2.0);
    stall(&mut bench, 60.0);
    held(&mut bench);
    assert_eq!((holds(&bench).len(), told(&bench, NOZZLE)), (2, (40.0, true)));
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    assert!(printed(&mut bench, from) == expected);
}

#[test]
fn what_is_set_while_held_is_what_it_goes_on_with() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040()));
    stall(&mut bench, 60.0);
    held(&mut bench);
    bench.ask(Request::SetTemperature(NOZZLE, Celsius(80.0)));
    bench.run(1.0);
    assert_eq!(told(&bench, NOZZLE), (80.0, false));
    bench.ask(Request::Resume);
    bench.until("motion", 200.0, |bench| bench.events.contains(&Event::Resumed));
    assert!(bench.celsius(0) > 77.0, "{}", bench.celsius(0));
    assert_eq!((told(&bench, NOZZLE), told(&bench, Heater::Bed)), ((80.0, false), (35.0, false)));
}

#[test]
fn a_job_that_is_heating_pauses_when_its_host_was_away() {
    for away in [30.0, 2400.0] {
        let mut bench = setup(BoardProfile::rp2040()).ready();
        bench.start(&squares(1));
        bench.until("heat", 60.0, |bench| bench.celsius(0) > 30.0);
        stall(&mut bench, away);
        bench.until("the pause", 60.0, |bench| bench.session.job_status() == JobStatus::Paused);
        let lowered = if away > 1900.0 { 0.0 } else { 40.0 };
        assert_eq!((holds(&bench), told(&bench, NOZZLE)), (vec![], (lowered, true)));
        bench.ask(Request::Resume);
        bench.run(2.0);
        stall(&mut bench, 30.0);
        bench.until("the pause", 60.0, |bench| bench.session.job_status() == JobStatus::Paused);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
    }
}

#[test]
fn what_was_typed_is_not_gone_on_with() {
    let mut bench = setup(BoardProfile::rp2040()).ready();
    bench.home();
    bench.ask(Request::Gcode("M109 S70\nG1 X50 F6000".into()));
    bench.run(3.0);
    stall(&mut bench, 30.0);
    bench.run(200.0);
    assert_eq!(told(&bench, NOZZLE), (40.0, true));
    bench.assert_position(0.0, 150.0, 0.5);
    bench.ask(Request::Gcode("M109 S45\nG1 X30 F6000".into()));
    bench.until("the move", 60.0, |bench| bench.session.position().is_some_and(|(at, _)| at[0] == 30.0));
    bench.settle();
    bench.assert_position(30.0, 150.0, 0.5);
    assert_eq!((told(&bench, NOZZLE), bench.errors()), ((45.0, false), vec![]));
}

#[test]
fn faults_are_faults_while_nobody_looks() {
    for (fault, code) in [
        ("heater-dead=extruder@130", ErrorCode::HeaterDrifted),
        ("heater-stuck-on=extruder@130", ErrorCode::BoardSensorRange),
        ("sensor-open=heater_bed@130", ErrorCode::BoardSensorRange),
    ] {
        let mut setup = setup(BoardProfile::rp2040());
        fault.clone_into(&mut setup.faults);
        let (mut bench, _) = on_the_way(&setup);
        assert!(bench.age() < 130.0, "{}", bench.age());
        stall(&mut bench, 400.0);
        assert!(bench.state().shutdown.is_some(), "{fault}");
        assert!(fault.contains("stuck") || bench.state().heaters.iter().all(|heater| heater.duty == 0.0));
        bench.until("the word", 10.0, |bench| bench.session.phase() == PhaseName::Shutdown);
        bench.failed(code, None);
    }
}
