//! Homing over a line, or by a host, that falls silent: the board stops the axis by itself, and it goes on where nothing
//! speaks against that.

use printer::{
    error::{Ended, ErrorCode},
    session::{Event, JobStatus, PhaseName, Request},
};
use virtual_printer::BoardProfile;

use crate::{
    bench::{Bench, Setup},
    print::START,
};

/// Longer than the board's time-out, and not so long that the host counts as gone, in s.
const SILENCE_S: f64 = 0.9;
/// X stands so far from its switch at first, and may go so far at most, in mm.
const TRAVEL_MAX_MM: f64 = 1.5 * 150.0;
const STEPS_PER_MM: f64 = 80.0;

/// X takes seconds for each approach.
fn slow() -> Setup {
    Setup::config("homing_speed: 40\nsecond_homing_speed: 10", "homing_speed: 5\nsecond_homing_speed: 2")
}

/// What breaks the connection.
#[derive(Clone, Copy, Debug)]
enum Silence {
    Line,
    Host,
}

fn silent(bench: &mut Bench, what: Silence, seconds: f64) {
    let is = |bench: &mut Bench, is: bool| match what {
        Silence::Line => bench.is_line_stuck = is,
        Silence::Host => bench.stalled = is,
    };
    is(bench, true);
    bench.run(seconds);
    is(bench, false);
}

/// How often the user was told that homing goes on.
fn went_on(bench: &Bench) -> usize {
    let is_it =
        |event: &&Event| matches!(event, Event::Message(text) if text.contains("it goes on from there"));
    bench.events.iter().filter(is_it).count()
}

/// All axes are home, and where they say.
#[track_caller]
fn is_home(bench: &mut Bench) {
    bench.until("home", 60.0, |bench| {
        bench.session.position().is_none_or(|(_, homed)| homed == [true; 3]) || !bench.errors().is_empty()
    });
    assert_eq!(bench.errors(), []);
    bench.settle();
    bench.assert_position(0.0, 150.0, 0.5);
}

/// Homing has begun and an axis moves.
fn on_the_way(setup: &Setup) -> Bench {
    let mut bench = setup.ready();
    bench.ask(Request::Gcode("G28".into()));
    bench.until("motion", 5.0, |bench| bench.pulses().len() > 100);
    bench
}

#[test]
fn a_short_silence_on_the_way_costs_nothing_but_time() {
    // In the fast approach, of 1200 steps, and after as many and the way back of 400 in the slow one.
    for pulses in [50, 300, 600, 800, 1650, 1750, 1840] {
        for what in [Silence::Line, Silence::Host] {
            for board in [BoardProfile::rp2040(), BoardProfile::stm32f103().plain()] {
                let mut bench = Setup { board, ..slow() }.ready();
                bench.ask(Request::Gcode("G28".into()));
                bench.until("motion", 20.0, |bench| bench.pulses().len() >= pulses);
                silent(&mut bench, what, SILENCE_S);
                is_home(&mut bench);
                assert_eq!(went_on(&bench), 1, "{what:?} {pulses}");
            }
        }
    }
}

#[test]
fn silence_again_and_again_ends_it() {
    for what in [Silence::Line, Silence::Host] {
        let mut bench = slow().ready();
        bench.start(&format!("M104 S70\nM106\n{START}G1 X5\n"));
        for _ in 0..3 {
            let from = bench.pulses().len();
            bench.until("motion", 5.0, |bench| bench.pulses().len() > from + 50);
            silent(&mut bench, what, SILENCE_S);
        }
        bench.job_over();
        bench.failed(ErrorCode::HomingTimeout, Some(5));
        assert_eq!((bench.error().ended, went_on(&bench)), (Ended::Job, 2));
        assert_eq!(bench.session.position().unwrap().1, [false; 3]);
        bench.assert_all_off();
        bench.events.clear();
        bench.home();
    }
}

#[test]
fn after_a_long_silence_nothing_goes_on_by_itself() {
    for what in [Silence::Line, Silence::Host] {
        let mut bench = on_the_way(&slow());
        silent(&mut bench, what, 2.5);
        bench.until("the error", 5.0, |bench| !bench.errors().is_empty());
        bench.failed(ErrorCode::HomingTimeout, Some(1));
        let pulses = bench.pulses().len();
        bench.run(10.0);
        assert_eq!((bench.pulses().len(), went_on(&bench)), (pulses, 0));
        assert_eq!(bench.session.phase(), PhaseName::Ready);
    }
}

#[test]
fn a_line_that_stays_silent_is_lost() {
    let mut bench = on_the_way(&slow());
    bench.is_line_stuck = true;
    bench.run(0.7);
    let pulses = bench.pulses().len();
    bench.until("the loss", 20.0, |bench| bench.session.phase() == PhaseName::Failed);
    assert_eq!((bench.pulses().len(), went_on(&bench)), (pulses, 0));
    let codes: Vec<ErrorCode> = bench.errors().iter().map(|error| error.code).collect();
    assert_eq!(codes, [ErrorCode::HomingTimeout, ErrorCode::LinkLost]);
}

#[test]
fn however_often_it_goes_on_it_goes_no_further_than_one_approach() {
    let mut bench = Setup::faults("endstop-stuck-off=x").ready();
    bench.ask(Request::Gcode("G28 X".into()));
    for _ in 0..2 {
        let from = bench.pulses().len();
        bench.until("motion", 5.0, |bench| bench.pulses().len() > from + 2000);
        silent(&mut bench, Silence::Line, SILENCE_S);
    }
    bench.until("the error", 20.0, |bench| !bench.errors().is_empty());
    bench.failed(ErrorCode::EndstopNotReached, Some(1));
    let made = bench.pulses().len() as f64 / STEPS_PER_MM;
    assert!((made - TRAVEL_MAX_MM).abs() < 0.1, "{made} mm");
    assert_eq!(went_on(&bench), 2);
}

#[test]
fn a_switch_that_is_held_down_is_found_all_the_same() {
    let mut bench = Setup::default().ready();
    bench.home();
    let runs = bench.events.iter().filter(|event| matches!(event, Event::RunStarted { .. })).count();
    // X stands at its switch: the approach ends where it begins.
    bench.ask(Request::Gcode("G28 X".into()));
    bench.until("an approach", 5.0, |bench| {
        bench.events.iter().filter(|event| matches!(event, Event::RunStarted { .. })).count() > runs
    });
    silent(&mut bench, Silence::Line, SILENCE_S);
    is_home(&mut bench);
}

#[test]
fn it_can_be_cancelled_while_it_is_about_to_go_on() {
    for hundredths in 0..40 {
        let mut bench = slow().ready();
        bench.start(&format!("{START}G1 X5\n"));
        bench.until("motion", 5.0, |bench| bench.pulses().len() > 100);
        silent(&mut bench, Silence::Line, SILENCE_S);
        bench.run(0.02 * f64::from(hundredths));
        bench.ask(Request::Cancel);
        let pulses = bench.pulses().len();
        bench.until("the end", 3.0, |bench| bench.session.job_status() == JobStatus::None);
        assert!(bench.events.contains(&Event::JobCancelled) && bench.errors().is_empty());
        let more = (bench.pulses().len() - pulses) as f64 / STEPS_PER_MM;
        assert!(more < 20.0, "{hundredths}: {more} mm");
        bench.assert_safe();
    }
}

#[test]
fn a_silence_before_the_axis_moves_stops_nothing() {
    let mut bench = on_the_way(&slow());
    // From now on the line counts as bad, and motion begins a while after it has been sent.
    silent(&mut bench, Silence::Line, SILENCE_S);
    bench.until("the next try", 5.0, |bench| went_on(bench) == 1);
    let pulses = bench.pulses().len();
    bench.run(0.2);
    silent(&mut bench, Silence::Line, SILENCE_S);
    assert_eq!(bench.pulses().len(), pulses, "it has not begun");
    is_home(&mut bench);
    assert_eq!(went_on(&bench), 1);
}
