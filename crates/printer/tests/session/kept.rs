//! What the user has set outlives the host, as the print does.

use printer::session::{Event, JobStatus, Request};
use virtual_printer::BoardProfile;

use crate::{
    attach::{die, file, journaled, setup, started, take_up, take_up_paused},
    bench::Setup,
    print::{START, squares},
};

#[test]
fn what_the_user_set_last_outlives_every_host() {
    let setup = Setup::default();
    let file = squares(6);
    let (mut bench, from) = started(&setup, &file);
    bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 3000);
    // Planned far ahead, so none of it is in force where the board is.
    bench.ask(Request::SetSpeedFactor(0.5));
    bench.ask(Request::SetTemperature(gcode::Heater::Tool(0), units::Celsius(80.0)));
    bench.run(0.05);
    die(&mut bench, &setup, 0.2);
    take_up(&mut bench, &file);
    assert_eq!(bench.session.factors()[0], 0.5);
    // Nobody says yes, and that host dies too.
    die(&mut bench, &setup, 400.0);
    take_up(&mut bench, &file);
    assert_eq!(bench.session.factors()[0], 0.5);
    bench.ask(Request::Resume);
    let pulses = bench.pulses().len();
    bench.until("motion", 300.0, |bench| bench.pulses().len() > pulses);
    assert!(bench.celsius(0) > 75.0, "it goes on at {} °C", bench.celsius(0));
    bench.run(1.5);
    die(&mut bench, &setup, 0.2);
    take_up(&mut bench, &file);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    bench.assert_all_off();
}

#[test]
fn what_was_set_before_the_print_outlives_its_host() {
    let setup = setup(BoardProfile::rp2040());
    let moves = &squares(3)[START.len()..];
    let file = format!("G28\nM83\nG92 E0\n{moves}");
    let mut bench = setup.ready();
    bench.gcode("M106 S128\nM140 S35\nM104 S70");
    bench.until("heat", 200.0, |bench| bench.celsius(0) > 69.0);
    bench.start_with(&file, journaled()).unwrap();
    let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
    bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
    let from = bench.pulses().len();
    bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 3000);
    // Long enough for stand-by to be over, and everything to be cold.
    die(&mut bench, &setup, 3000.0);
    assert!(bench.celsius(0) < 40.0);
    take_up(&mut bench, &file);
    bench.ask(Request::Resume);
    let pulses = bench.pulses().len();
    bench.until("motion", 300.0, |bench| bench.pulses().len() > pulses);
    assert!(bench.celsius(0) > 60.0 && bench.celsius(1) > 30.0);
    let fan = bench.state().fans[0].duty;
    assert!((fan - 0.5).abs() < 0.01, "{fan}");
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_fan_that_was_set_in_a_pause_outlives_its_host() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = started(&setup, &file());
    bench.run(3.0);
    bench.ask(Request::Pause);
    bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
    bench.ask(Request::Gcode("M106 S51".into()));
    bench.run(1.0);
    die(&mut bench, &setup, 5.0);
    take_up_paused(&mut bench, &file());
    bench.ask(Request::Resume);
    bench.until("motion", 10.0, |bench| bench.events.contains(&Event::Resumed));
    bench.run(0.6);
    let fan = bench.state().fans[0].duty;
    assert!((fan - 0.2).abs() < 0.01, "{fan}");
    bench.job_over();
    bench.job_done();
}
