//! A user who changes his mind, and a host that is held up, while a print is about to go on: it is paused or held again, and
//! nothing moves unasked, cold or twice.

use printer::{
    error::ErrorCode,
    session::{Event, JobStatus, PhaseName, Request},
};
use units::{Celsius, Mm};
use virtual_printer::BoardProfile;

use crate::{
    attach::{die, file, setup, started, take_up, take_up_paused},
    bench::{Bench, Setup},
    hold::{clean as clean_hold, held, holds, on_the_way, printed, stall},
    pause::{assert_whole, clean, pause},
    print::squares,
    start::paused,
};

const NOZZLE: gcode::Heater = gcode::Heater::Tool(0);

#[track_caller]
fn is_paused(bench: &mut Bench, within: f64) {
    bench.until("the pause", within, |bench| bench.session.job_status() == JobStatus::Paused);
}

#[track_caller]
fn stands_still(bench: &mut Bench, seconds: f64) {
    let pulses = bench.pulses().len();
    bench.run(seconds);
    assert_eq!(bench.pulses().len(), pulses, "it moves");
}

fn has_gone_on(bench: &Bench) -> bool {
    bench.events.iter().any(|event| matches!(event, Event::RunResumed { .. }))
}

/// A print that is held, and whose nozzle has frozen to the part.
fn frozen(setup: &Setup) -> (Bench, usize) {
    let (mut bench, from) = on_the_way(setup);
    stall(&mut bench, 2.6);
    held(&mut bench);
    bench.ask(Request::SetTemperature(NOZZLE, Celsius(0.0)));
    bench.run(150.0);
    assert!(bench.celsius(0) < 55.0, "{}", bench.celsius(0));
    (bench, from)
}

#[test]
fn a_cold_nozzle_is_not_torn_off_the_part() {
    let setup = Setup::default();
    let expected = clean_hold(&setup);
    let (mut bench, from) = frozen(&setup);
    let pulses = bench.pulses().len();
    bench.ask(Request::Resume);
    bench.run(0.3);
    assert_eq!(bench.session.job_status(), JobStatus::Printing);
    bench.ask(Request::Pause);
    assert_eq!((bench.session.job_status(), holds(&bench).len()), (JobStatus::Held, 2));
    bench.run(3.0);
    assert_eq!(bench.pulses().len(), pulses);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    assert!(printed(&mut bench, from) == expected);
    // Nor by a pause before anything is heated.
    let (mut bench, _) = frozen(&setup);
    let pulses = bench.pulses().len();
    bench.ask(Request::Pause);
    is_paused(&mut bench, 5.0);
    bench.run(1.0);
    assert_eq!(bench.pulses().len(), pulses);
    bench.ask(Request::Resume);
    bench.until("heat", 60.0, |bench| bench.celsius(0) > 64.0);
    assert_eq!(bench.pulses().len(), pulses);
    bench.job_over();
    bench.job_done();
}

#[test]
fn the_fan_goes_on_as_it_was() {
    let way = "G1 X20 Y20 Z1 F6000\nG1 X140 F1200\nG1 X20\n";
    for (typed, file) in [
        ("", format!("G28\nM106 S128\n{way}M84\n")),
        ("M106 S128", format!("G28\n{way}M84\n")),
        ("M106 S255", format!("G28\nG1 X30 F6000\nM400\nM106 S128\nG4 P100\n{way}M84\n")),
    ] {
        let mut bench = setup(BoardProfile::rp2040()).ready();
        bench.gcode(typed);
        bench.start(&file);
        let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
        bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
        bench.run(3.5);
        let duty = bench.state().fans[0].duty;
        assert!((duty - 0.5).abs() < 0.01, "{duty}");
        pause(&mut bench).expect("a cut");
        bench.run(0.5);
        assert_eq!(bench.state().fans[0].duty, duty, "{typed}");
        bench.ask(Request::Resume);
        bench.until("going on", 60.0, |bench| has_gone_on(bench));
        bench.run(1.0);
        assert_eq!(bench.state().fans[0].duty, duty, "{typed}");
        bench.job_over();
        bench.job_done();
    }
}

#[test]
fn a_nozzle_that_is_switched_off_before_it_goes_on_is_asked_about() {
    let setup = Setup::default();
    let (mut bench, from) = started(&setup, &squares(3));
    bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 9000);
    pause(&mut bench).expect("a cut");
    bench.ask(Request::SetTemperature(NOZZLE, Celsius(0.0)));
    bench.until("cold", 200.0, |bench| bench.celsius(0) < 50.0);
    let pulses = bench.pulses().len();
    bench.ask(Request::Resume);
    bench.run(0.5);
    bench.ask(Request::SetTemperature(NOZZLE, Celsius(0.0)));
    is_paused(&mut bench, 5.0);
    bench.run(5.0);
    assert_eq!((bench.pulses().len(), bench.errors()), (pulses, vec![]));
    bench.ask(Request::Resume);
    bench.until("motion", 200.0, |bench| bench.pulses().len() > pulses);
    assert!(bench.celsius(0) > 64.0);
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_pause_on_the_way_back_is_a_pause() {
    for board in [BoardProfile::rp2040(), BoardProfile::rp2040().plain()] {
        let setup = setup(board);
        let file = file();
        let (expected, _) = clean(&setup, &file);
        let mut broken_off = 0;
        for step in 0..14 {
            let (mut bench, from) = started(&setup, &file);
            bench.run(3.0);
            pause(&mut bench);
            bench.gcode("G91\nG1 X-15 Y13 Z2 F6000");
            for again in 0..2 {
                bench.ask(Request::Resume);
                bench.run(0.1 * f64::from(step) + 0.03 * f64::from(again));
                if !has_gone_on(&bench) && bench.session.job_status() == JobStatus::Printing {
                    bench.ask(Request::Pause);
                    is_paused(&mut bench, 10.0);
                    stands_still(&mut bench, 1.0);
                    broken_off += 1;
                }
                if bench.session.job_status() != JobStatus::Paused {
                    break;
                }
            }
            if bench.session.job_status() == JobStatus::Paused {
                bench.ask(Request::Resume);
            }
            bench.job_over();
            bench.job_done();
            if bench.events.iter().any(|event| matches!(event, Event::RunResumed { .. })) {
                assert_whole(&mut bench, from, &expected, &format!("{step}"));
            }
        }
        assert!(broken_off > 4, "{broken_off}");
    }
}

#[test]
fn a_host_may_die_once_a_way_back_was_broken_off() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (mut bench, _) = started(&setup, &file);
    bench.job_over();
    let expected = bench.counts();
    let mut broken_off = 0;
    for step in 0..8 {
        let (mut bench, _) = started(&setup, &file);
        bench.run(3.0);
        pause(&mut bench);
        bench.ask(Request::Resume);
        bench.run(0.08 * f64::from(step));
        if has_gone_on(&bench) {
            break;
        }
        bench.ask(Request::Pause);
        is_paused(&mut bench, 10.0);
        broken_off += 1;
        die(&mut bench, &setup, 2.0);
        take_up_paused(&mut bench, &file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
        assert_eq!(bench.counts(), expected, "{step}");
    }
    assert!(broken_off > 2, "{broken_off}");
}

#[test]
fn a_pause_on_the_way_to_a_first_line_is_a_pause() {
    let file = squares(3);
    let mut stages = [0; 2];
    for step in 0..26 {
        let mut bench = Setup::default().ready();
        paused(&mut bench, &file, 17);
        bench.ask(Request::SetPosition { axis: 2, position: Mm(6.0) });
        for _ in 0..2 {
            bench.ask(Request::Resume);
            bench.run(1.3 * f64::from(step));
            let line = |event: &Event| matches!(event, Event::Progress { line, .. } if *line >= 17);
            if bench.events.iter().any(line) || bench.session.job_status() != JobStatus::Printing {
                break;
            }
            let was_homed = bench.session.position().unwrap().1[1];
            bench.ask(Request::Pause);
            is_paused(&mut bench, 10.0);
            assert!(bench.session.position().unwrap().1[2], "Z is lost");
            stages[usize::from(was_homed)] += 1;
            stands_still(&mut bench, 1.0);
        }
        if bench.session.job_status() == JobStatus::Paused {
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
    }
    assert!(stages[0] > 2 && stages[1] > 2, "{stages:?}");
}

#[test]
fn a_run_does_not_begin_unasked_after_a_long_stall() {
    let setup = setup(BoardProfile::rp2040());
    let file = "G28\nG1 X20 Y20 F6000\nM400\nG4 P100\nG1 X140 F1200\nM84\n";
    let last = |event: &Event| matches!(event, Event::RunStarted { position, .. } if position[0] > 19.0);
    let mut held_before = 0;
    for hundredths in 0..20 {
        let (mut bench, _) = started(&setup, file);
        bench.until("the last run", 100.0, |bench| bench.events.iter().any(last));
        bench.run(0.01 * f64::from(hundredths));
        let pulses = bench.pulses().len();
        stall(&mut bench, 60.0);
        if bench.pulses().len() == pulses {
            held_before += 1;
            stands_still(&mut bench, 4.0);
            assert_eq!(bench.session.job_status(), JobStatus::Held, "{hundredths}");
            bench.ask(Request::Resume);
        }
        bench.until("the end", 60.0, |bench| {
            if bench.session.job_status() == JobStatus::Held {
                bench.ask(Request::Resume);
            }
            bench.session.job_status() == JobStatus::None
        });
        bench.job_done();
    }
    assert!(held_before > 0);
}

/// The word to go on is still on the line when the user thinks better of it, and the board goes on saying that it holds.
#[test]
fn to_go_on_can_be_taken_back_at_once() {
    let setup = setup(BoardProfile::rp2040());
    for request in [Request::Cancel, Request::Pause] {
        for tenths in 0..6 {
            let (mut bench, _) = started(&setup, &file());
            bench.run(3.0);
            stall(&mut bench, 2.6);
            held(&mut bench);
            bench.is_line_stuck = true;
            bench.ask(Request::Resume);
            bench.run(0.06);
            bench.ask(request.clone());
            bench.run(0.1 * f64::from(tenths));
            bench.is_line_stuck = false;
            if request == Request::Pause {
                is_paused(&mut bench, 10.0);
                bench.ask(Request::Resume);
                bench.job_over();
                bench.job_done();
            } else {
                bench.job_over();
                assert!(bench.events.contains(&Event::JobCancelled));
            }
            assert_eq!((bench.session.phase(), bench.errors()), (PhaseName::Ready, vec![]), "{tenths}");
            assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
        }
    }
}

#[test]
fn a_stall_at_the_end_of_the_way_back_is_asked_about() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let mut asked = 0;
    for step in 0..40 {
        let (mut bench, _) = started(&setup, &file);
        bench.run(3.0);
        pause(&mut bench).expect("a cut");
        bench.gcode("G91\nG1 Z40 F600");
        bench.ask(Request::Resume);
        bench.run(0.1 * f64::from(step));
        let has_gone_on = has_gone_on(&bench);
        stall(&mut bench, 3.0);
        bench.run(1.0);
        if !has_gone_on && !holds(&bench).is_empty() {
            asked += 1;
            stands_still(&mut bench, 3.0);
            assert_eq!(bench.session.job_status(), JobStatus::Held, "{step}");
        }
        bench.until("the end", 100.0, |bench| {
            if matches!(bench.session.job_status(), JobStatus::Held | JobStatus::Paused) {
                bench.ask(Request::Resume);
            }
            bench.session.job_status() == JobStatus::None
        });
        bench.job_done();
    }
    assert!(asked > 2, "{asked}");
}

#[test]
fn factors_that_are_set_while_lines_are_passed_over_hold() {
    let file = squares(3).replace("G1 Z1.2 F600\n", "G1 Z1.2 F600\nM220 S80\nM221 S90\n");
    let play = |dies: bool| {
        let setup = Setup::default();
        let mut bench = setup.ready();
        bench.feed_max = 60;
        let options = printer::session::JobOptions {
            start_line: Some(19),
            journal: Some(77),
            ..printer::session::JobOptions::default()
        };
        bench.start_with(&file, options).unwrap();
        bench.run(0.1);
        bench.ask(Request::SetSpeedFactor(0.5));
        bench.ask(Request::SetFlowFactor(1.1));
        bench.feed_max = usize::MAX;
        is_paused(&mut bench, 20.0);
        assert_eq!(bench.session.factors(), [0.5, 1.1]);
        bench.home();
        bench.ask(Request::Resume);
        bench.line(20);
        if dies {
            die(&mut bench, &setup, 20.0);
            take_up(&mut bench, &file);
            assert_eq!(bench.session.factors(), [0.5, 1.1]);
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
        assert!(!bench.errors().iter().any(|error| error.code == ErrorCode::ContinuationRefused));
        bench.counts()
    };
    assert_eq!(play(true), play(false));
}
