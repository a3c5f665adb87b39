//! A host that is held up: on a board that can hold its motion the print waits at rest on its path, and goes on with the
//! very next step once the user says so.

use printer::{
    error::ErrorCode,
    session::{Event, JobStatus, PhaseName, Request},
};
use virtual_printer::BoardProfile;

use crate::{
    bench::{Bench, Pulse, Setup},
    print::{END, START, squares},
};

fn setup(board: BoardProfile) -> Setup {
    Setup { board, ..Setup::default() }
}

/// A long way at an even speed, then the squares.
fn file() -> String {
    format!("{START}G1 X20 Y20 Z1 F6000\nG1 X140 E2 F1200\nG1 X20 E2\n{}", &squares(2)[START.len()..])
}

/// Pulses of every motor from the first after homing, and where they end. Those of one tick have no order among motors.
pub(crate) fn printed(bench: &mut Bench, from: usize) -> (Vec<Pulse>, Vec<i64>) {
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    let mut pulses = bench.relative_pulses(from);
    pulses.sort_unstable();
    (pulses, bench.counts())
}

/// Starts the print and lets it get to its long way; what has been pulsed before does not count.
pub(crate) fn on_the_way(setup: &Setup) -> (Bench, usize) {
    let mut bench = setup.ready();
    bench.start(&file());
    let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
    bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
    let from = bench.pulses().len();
    bench.until("the way", 100.0, |bench| bench.pulses().len() > from + 2000);
    (bench, from)
}

pub(crate) fn clean(setup: &Setup) -> (Vec<Pulse>, Vec<i64>) {
    let (mut bench, from) = on_the_way(setup);
    bench.job_over();
    bench.job_done();
    assert!(holds(&bench).is_empty());
    printed(&mut bench, from)
}

pub(crate) fn stall(bench: &mut Bench, seconds: f64) {
    bench.stalled = true;
    bench.run(seconds);
    bench.stalled = false;
}

pub(crate) fn holds(bench: &Bench) -> Vec<ErrorCode> {
    let code = |event: &Event| match event {
        Event::Held(error) => Some(error.code),
        _ => None,
    };
    bench.events.iter().filter_map(code).collect()
}

#[track_caller]
pub(crate) fn held(bench: &mut Bench) {
    bench.until("the hold", 3.0, |bench| bench.session.job_status() == JobStatus::Held);
    let pulses = bench.pulses().len();
    bench.run(4.0);
    assert_eq!(bench.pulses().len(), pulses, "it goes on by itself");
    assert_eq!(bench.session.job_status(), JobStatus::Held);
}

#[test]
fn a_short_stall_changes_no_pulse() {
    for board in [BoardProfile::rp2040(), BoardProfile::rp2040().plain()] {
        let setup = setup(board);
        let expected = clean(&setup);
        for seconds in [0.5, 1.2, 1.7] {
            let (mut bench, from) = on_the_way(&setup);
            stall(&mut bench, seconds);
            bench.run(0.7);
            stall(&mut bench, seconds);
            bench.job_over();
            bench.job_done();
            assert_eq!(holds(&bench), []);
            assert!(printed(&mut bench, from) == expected, "{seconds}");
        }
    }
}

#[test]
fn a_long_stall_holds_and_the_next_step_follows() {
    for board in BoardProfile::all() {
        let setup = setup(board);
        let expected = clean(&setup);
        for seconds in [2.5, 3.9] {
            let (mut bench, from) = on_the_way(&setup);
            stall(&mut bench, seconds);
            held(&mut bench);
            assert_eq!(holds(&bench).len(), 1);
            bench.ask(Request::Resume);
            bench.until("motion", 2.0, |bench| bench.events.contains(&Event::Resumed));
            bench.job_over();
            bench.job_done();
            assert_eq!(holds(&bench).len(), 1);
            assert!(printed(&mut bench, from) == expected, "{} {seconds}", setup.board.name);
        }
    }
}

#[test]
fn it_says_for_how_long_the_computer_was_away() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040()));
    stall(&mut bench, 2.8);
    held(&mut bench);
    let text = bench.events.iter().find_map(|event| match event {
        Event::Held(error) => Some(error.to_string()),
        _ => None,
    });
    assert!(text.unwrap().contains("away for 2.8 s"));
    // It is no time for anything else.
    assert_eq!(bench.request(Request::Gcode("G1 X5".into())).unwrap_err().code, ErrorCode::BusyPrinting);
    bench.ask(Request::EmergencyStop);
    bench.assert_all_off();
}

#[test]
fn a_held_print_can_be_ended_and_the_position_is_known() {
    for board in BoardProfile::all() {
        let (mut bench, _) = on_the_way(&setup(board));
        stall(&mut bench, 3.0);
        held(&mut bench);
        bench.ask(Request::Cancel);
        bench.job_over();
        assert!(bench.events.contains(&Event::JobCancelled));
        bench.assert_all_off();
        let (claimed, homed) = bench.session.position().unwrap();
        assert_eq!(homed, [true; 3]);
        for (motor, claimed) in bench.state().motors.iter().zip(claimed) {
            assert_eq!(motor.lost.0, 0);
            // Within a step or two of the switch' own error.
            assert!((motor.position.0 - claimed).abs() < 0.1 || motor.name == "extruder", "{}", motor.name);
        }
        // The clocks are apart now: another print, with homing and fan, is as good as ever.
        bench.events.clear();
        bench.gcode("M106 S255");
        assert!(bench.state().fans[0].duty > 0.9);
        bench.print(&squares(1));
        bench.job_done();
        bench.assert_all_off();
    }
}

#[test]
fn a_cold_nozzle_is_heated_first() {
    let setup = setup(BoardProfile::rp2040());
    let expected = clean(&setup);
    let (mut bench, from) = on_the_way(&setup);
    stall(&mut bench, 2.6);
    held(&mut bench);
    bench.ask(Request::SetTemperature(gcode::Heater::Tool(0), units::Celsius(0.0)));
    bench.run(150.0);
    assert!(bench.celsius(0) < 55.0, "{}", bench.celsius(0));
    let pulses = bench.pulses().len();
    bench.ask(Request::Resume);
    bench.until("heat", 60.0, |bench| bench.celsius(0) > 64.0);
    assert_eq!(bench.pulses().len(), pulses, "it went on too cold");
    bench.job_over();
    bench.job_done();
    assert!(printed(&mut bench, from) == expected);
}

#[test]
fn without_a_motion_clock_the_same_stall_ends_as_ever() {
    let (mut bench, _) = on_the_way(&setup(BoardProfile::rp2040().plain()));
    stall(&mut bench, 3.9);
    bench.until("the end", 10.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    assert_eq!(holds(&bench), []);
    bench.failed(ErrorCode::HeaterUnattended, None);
    bench.assert_safe();
}

#[test]
fn moves_by_hand_are_held_too() {
    let mut bench = setup(BoardProfile::rp2040()).ready();
    bench.home();
    bench.ask(Request::Gcode("G1 X140 F600\nG1 X100".into()));
    bench.run(3.0);
    stall(&mut bench, 2.5);
    held(&mut bench);
    bench.ask(Request::Resume);
    bench.settle();
    bench.assert_position(100.0, 150.0, 0.5);
    assert_eq!(bench.session.job_status(), JobStatus::None);
    bench.ask(Request::Gcode("G1 X20 F600".into()));
    bench.run(3.0);
    stall(&mut bench, 2.5);
    held(&mut bench);
    bench.ask(Request::Cancel);
    bench.settle();
    let x = bench.session.position().unwrap().0[0];
    assert!(x > 50.0 && x < 99.0);
    bench.assert_position(x, 150.0, 0.5);
    bench.gcode("G1 X30 F6000");
    bench.assert_position(30.0, 150.0, 0.5);
}

#[test]
fn a_stall_where_nothing_is_leased_ends_as_it_would_without() {
    // While homing: the board's own time-out stops the axis.
    let mut slow = setup(BoardProfile::rp2040());
    slow.config = slow.config.replacen("homing_speed: 40", "homing_speed: 10", 1);
    let mut bench = slow.ready();
    bench.start(&format!("G28\nG1 X20 F6000\n{END}"));
    bench.until("homing", 10.0, |bench| bench.pulses().len() > 100);
    stall(&mut bench, 2.5);
    bench.job_over();
    assert_eq!((bench.error().code, holds(&bench)), (ErrorCode::HomingTimeout, vec![]));
    // In a pause, and while it is heated.
    let (mut bench, from) = on_the_way(&setup(BoardProfile::rp2040()));
    bench.ask(Request::Pause);
    bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
    stall(&mut bench, 4.0);
    bench.run(1.0);
    assert_eq!(bench.session.job_status(), JobStatus::Paused);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    assert_eq!((holds(&bench), from > 0), (vec![], true));
    let mut bench = setup(BoardProfile::rp2040()).ready();
    bench.start(&squares(1));
    bench.run(1.5);
    stall(&mut bench, 4.0);
    bench.job_over();
    bench.job_done();
    assert_eq!(holds(&bench), []);
}

/// What covers a run gets stuck on the line and comes after its begin: it only begins a little later, and nobody is asked.
#[test]
fn a_run_that_is_covered_late_begins_late() {
    let setup = setup(BoardProfile::rp2040());
    let file = format!("{START}G1 X20 F6000\nM109 S70\nG1 X140 F1200\n{END}");
    let runs =
        |bench: &Bench| bench.events.iter().filter(|event| matches!(event, Event::RunStarted { .. })).count();
    let on_its_way = || {
        let mut bench = setup.ready();
        bench.start(&file);
        let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
        bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
        let known = runs(&bench);
        bench.until("the last run", 100.0, |bench| runs(bench) == known + 2);
        bench
    };
    let mut began_late = 0;
    for hundredths in 0..28 {
        let mut bench = on_its_way();
        bench.run(0.01 * f64::from(hundredths));
        bench.is_line_stuck = true;
        bench.run(0.35);
        bench.is_line_stuck = false;
        bench.job_over();
        bench.job_done();
        assert_eq!((holds(&bench), bench.errors()), (vec![], vec![]), "{hundredths}");
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
        began_late += usize::from(bench.printer.now() > bench.printer.motion_now());
    }
    assert!(began_late > 0, "{began_late}");
}

/// Stalls at every stage of a print's end, also such as outlast half the range of the board's 32-bit clock and all of it:
/// the print is whole whatever happens.
#[test]
fn a_stall_at_the_end_of_a_run_loses_nothing() {
    for (board, seconds) in [
        (BoardProfile::rp2040(), 3.0),
        (BoardProfile::stm32f103(), 3.0),
        (BoardProfile::stm32f103(), 35.0),
        (BoardProfile::stm32f103(), 70.0),
    ] {
        let setup = setup(board);
        let expected = clean(&setup);
        let (mut bench, from) = on_the_way(&setup);
        let began = bench.age();
        bench.job_over();
        let lasts = bench.age() - began;
        drop(bench);
        let mut held_once = 0;
        for part in 0..12 {
            let (mut bench, _) = on_the_way(&setup);
            bench.run(lasts - 5.0 + 0.42 * f64::from(part));
            stall(&mut bench, seconds);
            finish(&mut bench);
            held_once += holds(&bench).len();
            assert!(printed(&mut bench, from) == expected, "{} {seconds} {part}", setup.board.name);
        }
        // Heaters at stand-by are told once more where the user is quicker than they are.
        assert!((2..24).contains(&held_once), "{} {seconds}: {held_once}", setup.board.name);
    }
}

/// The board comes to rest on a run's very last steps, or a little after: there is next to nothing left to go on with.
#[test]
fn a_hold_on_the_last_steps_of_a_run_can_be_ended() {
    let setup = setup(BoardProfile::rp2040());
    let started = |file: &str| {
        let mut bench = setup.ready();
        bench.start(file);
        let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
        bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
        let known = bench.pulses().len();
        bench.until("motion", 100.0, |bench| bench.pulses().len() > known);
        bench
    };
    let mut held = 0;
    // The lease is renewed every 0.15 s: its end falls everywhere between the renewals.
    for hundredths in 0..15 {
        let x = 30.0 + 0.5 * f64::from(hundredths);
        let file = format!("{START}G1 X140 F3000\nG1 X{x}\n{END}");
        let mut bench = started(&file);
        let began = bench.age();
        bench.until("the end", 100.0, |bench| bench.events.contains(&Event::JobDone));
        let lasts = bench.age() - began;
        for renewals in 0..6 {
            let mut bench = started(&file);
            bench.run(lasts - 2.6 + 0.15 * f64::from(renewals));
            stall(&mut bench, 3.0);
            finish(&mut bench);
            held += holds(&bench).len();
        }
    }
    assert!((5..90).contains(&held), "{held}");
}

/// Resumes whatever is held, until the job is over.
#[track_caller]
fn finish(bench: &mut Bench) {
    bench.until("the end of the job", 600.0, |bench| {
        // Where its heaters fell to stand-by between two runs, it is paused.
        if matches!(bench.session.job_status(), JobStatus::Held | JobStatus::Paused) {
            bench.ask(Request::Resume);
        }
        bench.session.job_status() == JobStatus::None
    });
    bench.job_done();
}

#[test]
fn stalls_at_random_moments_leave_the_same_pulses() {
    for (board, seeds) in [(BoardProfile::rp2040(), 0..14_u64), (BoardProfile::stm32f103(), 0..6)] {
        let setup = setup(board);
        let expected = clean(&setup);
        let mut count = 0;
        for seed in seeds {
            let mut random = rand_pcg::Pcg32::new(seed, 11);
            let mut between = |low: f64, high: f64| {
                use rand_pcg::rand_core::Rng;
                low + (high - low) * f64::from(random.next_u32()) / f64::from(u32::MAX)
            };
            let (mut bench, from) = on_the_way(&setup);
            for _ in 0..3 {
                bench.run(between(0.0, 4.0));
                stall(&mut bench, between(0.2, 4.2));
                bench.run(between(0.5, 1.5));
                if bench.session.job_status() == JobStatus::Held && between(0.0, 1.0) < 0.7 {
                    bench.ask(Request::Resume);
                }
            }
            finish(&mut bench);
            count += holds(&bench).len();
            assert!(printed(&mut bench, from) == expected, "seed {seed} on {}", setup.board.name);
        }
        assert!(count > 5, "{count} holds");
    }
}

#[test]
fn a_host_that_is_held_up_once_more_right_after_the_word_goes_on() {
    let setup = crate::attach::setup(BoardProfile::rp2040());
    let file = crate::attach::file();
    for request in [Request::Resume, Request::Cancel] {
        let (mut bench, _) = crate::attach::started(&setup, &file);
        bench.run(3.0);
        crate::attach::die(&mut bench, &setup, 1.0);
        crate::attach::take_up(&mut bench, &file);
        bench.ask(request.clone());
        let now = bench.now();
        bench.session.poll(now, &mut Vec::new());
        stall(&mut bench, 8.0);
        bench.run(1.0);
        if bench.session.job_status() == JobStatus::Held {
            bench.ask(request);
        }
        bench.job_over();
        assert_eq!(bench.errors(), []);
        assert_eq!(bench.session.phase(), PhaseName::Ready);
    }
}
