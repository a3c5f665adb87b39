//! The speed factor while a print is made: less acts at once, on the part of the queue that was planned faster; more comes
//! behind it. Every step is made once, in order, on the path, whatever else happens meanwhile.

use std::fmt::Write as _;

use printer::session::{Event, JobStatus, Request, ScheduledMove};
use units::{Seconds, Ticks};
use virtual_printer::BoardProfile;

use crate::{
    attach::{die, file, setup, started, take_up},
    bench::{Bench, Setup},
    hold::{held, holds, stall},
    pause::{self, is_over, pause, random, resume, steps_of},
};

/// A change acts within the ramp and this.
const LATENCY_MAX: f64 = 0.3;
const RAMP: f64 = 0.3;
/// X in steps a second on the long way.
const STEPS_S: f64 = 20.0 * 80.0;

/// A long way at 20 mm/s, to and fro, in short pieces.
fn long(sides: usize) -> String {
    let mut lines = String::new();
    for piece in 0..sides * 60 {
        let way = 2 * (piece % 120 + 1);
        let _ = writeln!(lines, "G1 X{} E0.02", 20 + if way <= 120 { way } else { 240 - way });
    }
    format!("G28\nM83\nG92 E0\nG1 X20 Y20 Z1 F6000\nG1 F1200\n{lines}M84\n")
}

/// Lets it get well into the long way.
fn on_the_way(setup: &Setup, file: &str) -> (Bench, usize) {
    let (mut bench, from) = started(setup, file);
    bench.until("the way", 30.0, |bench| bench.pulses().len() > from + 8000);
    bench.run(1.0);
    (bench, from)
}

/// The rate of motion in the next quarter of a second, as the board's clocks tell.
fn rate(bench: &mut Bench) -> f64 {
    let before = (bench.printer.now(), bench.printer.motion_now());
    bench.run(0.25);
    let since = |now: Ticks, then: Ticks| now.saturating_sub(then).0 as f64;
    since(bench.printer.motion_now(), before.1) / since(bench.printer.now(), before.0)
}

/// X's steps a second in the next fifth of a second.
fn speed(bench: &mut Bench) -> f64 {
    let count = |bench: &Bench| bench.pulses().iter().rev().filter(|pulse| pulse.1 == 0).count();
    let before = count(bench);
    bench.run(0.2);
    (count(bench) - before) as f64 / 0.2
}

#[track_caller]
fn assert_near(is: f64, should: f64, what: &str) {
    assert!((is - should).abs() <= should * 0.02, "{what}: {is}, not {should}");
}

/// The first pulse after motion was last cut off.
fn cut_at(bench: &Bench) -> usize {
    let last = pause::cuts(bench).last().copied().expect("a cut");
    bench.pulses().partition_point(|pulse| pulse.0 <= last)
}

/// The first move that was planned at this speed, in mm/s.
fn planned_at(bench: &Bench, speed: f64) -> Option<ScheduledMove> {
    bench.events.iter().find_map(|event| match event {
        Event::Move(mv) if mv.line > 5 && (mv.speed.cruise.0 - speed).abs() < 1e-6 => Some(*mv),
        _ => None,
    })
}

#[track_caller]
fn until_made(bench: &mut Bench, at: Ticks) {
    bench.until("the clock", 400.0, |bench| bench.printer.motion_now() >= at);
}

#[test]
fn less_speed_acts_at_once_and_the_queue_stays_what_it_is() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let file = long(8);
        let (expected, plain) = {
            let (mut bench, from) = started(&setup, &file);
            bench.job_over();
            bench.job_done();
            (steps_of(&bench, from, None), bench.relative_pulses(from))
        };
        let (mut bench, from) = on_the_way(&setup, &file);
        assert_near(speed(&mut bench), STEPS_S, "the plan");
        bench.ask(Request::SetSpeedFactor(0.5));
        bench.run(RAMP / 2.0 + LATENCY_MAX);
        assert_near(speed(&mut bench), STEPS_S / 2.0, "the queue");
        assert_near(rate(&mut bench), 0.5, "the rate");
        bench.until("the new plan", 60.0, |bench| planned_at(bench, 10.0).is_some());
        let seam = planned_at(&bench, 10.0).unwrap();
        assert!(bench.printer.motion_now() < seam.start, "there was no queue");
        let first = bench.pulses()[from].0;
        until_made(&mut bench, Ticks(seam.start.0 - u64::from(setup.board.clock.0) / 4));
        assert_near(rate(&mut bench), 0.5, "just before the seam");
        until_made(&mut bench, seam.start);
        bench.run(RAMP / 2.0 + LATENCY_MAX);
        assert_near(rate(&mut bench), 1.0, "behind the seam");
        assert_near(speed(&mut bench), STEPS_S / 2.0, "behind the seam");
        bench.job_done();
        // What had been planned by then was made as planned; rows of steps reach up to the seam.
        let until = seam.start.0 - first - u64::from(setup.board.clock.0) / 2;
        let before = |pulses: &[crate::bench::Pulse]| pulses.iter().filter(|pulse| pulse.0 < until).count();
        let made = bench.relative_pulses(from);
        let count = before(&made);
        assert!(count > 20_000 && count == before(&plain) && made[..count] == plain[..count]);
        assert!(steps_of(&bench, from, None) == expected);
        assert_eq!(holds(&bench), []);
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    }
}

#[test]
fn more_speed_comes_behind_the_queue() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = on_the_way(&setup, &long(8));
    let behind = |bench: &Bench| bench.printer.now().saturating_sub(bench.printer.motion_now());
    bench.ask(Request::SetSpeedFactor(2.0));
    bench.until("the new plan", 60.0, |bench| planned_at(bench, 40.0).is_some());
    let seam = planned_at(&bench, 40.0).unwrap();
    assert!(bench.printer.motion_now() < seam.start);
    assert_near(speed(&mut bench), STEPS_S, "the queue");
    until_made(&mut bench, seam.start);
    // It may turn round in the first of these.
    let faster = [speed(&mut bench), speed(&mut bench), speed(&mut bench)].into_iter().fold(0.0, f64::max);
    assert_near(faster, STEPS_S * 2.0, "behind the queue");
    bench.job_done();
    assert_eq!(behind(&bench), Ticks(0));
}

#[test]
fn it_is_undone_at_once() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = on_the_way(&setup, &long(10));
    for (factor, expected) in [(0.25, 0.25), (0.75, 0.75), (0.1, 0.1), (1.0, 1.0), (0.5, 0.5), (3.0, 1.0)] {
        bench.ask(Request::SetSpeedFactor(factor));
        bench.run(RAMP + LATENCY_MAX);
        assert_near(rate(&mut bench), expected, "the rate");
    }
    bench.job_done();
    assert_eq!(holds(&bench), []);
}

#[test]
fn what_the_file_sets_acts_where_it_stands() {
    let setup = setup(BoardProfile::rp2040());
    let file = long(8).replacen("G1 X140 E0.02\n", "G1 X140 E0.02\nM220 S50\n", 1);
    let (mut bench, _) = on_the_way(&setup, &file);
    bench.until("the new plan", 60.0, |bench| planned_at(bench, 10.0).is_some());
    let seam = planned_at(&bench, 10.0).unwrap();
    assert_near(rate(&mut bench), 1.0, "the file's");
    // The user's word is for all of it, and what the file has made as slow already is not made slower.
    bench.ask(Request::SetSpeedFactor(0.6));
    bench.run(RAMP + LATENCY_MAX);
    assert_near(rate(&mut bench), 0.6, "the user's");
    until_made(&mut bench, seam.start);
    bench.run(RAMP + LATENCY_MAX);
    assert_near(rate(&mut bench), 1.0, "slow already");
    bench.job_done();
}

#[test]
fn what_is_typed_acts_too() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = on_the_way(&setup, &long(6));
    bench.ask(Request::Gcode("m220 s40 ; slower".into()));
    bench.ask(Request::Gcode("M221S110".into()));
    assert_eq!(bench.session.factors(), [0.4, 1.1]);
    for other in ["M220 S50\nG1 X5", "M220", "M220 S0", "M220 Snan", "M220 B", "M220 S50 R", "M2201 S5"] {
        bench.request(Request::Gcode(other.into())).unwrap_err();
    }
    bench.run(RAMP + LATENCY_MAX);
    assert_near(rate(&mut bench), 0.4, "typed");
    bench.job_done();
}

#[test]
fn a_board_without_a_motion_clock_is_told_nothing() {
    let setup = setup(BoardProfile::rp2040().plain());
    let (mut bench, _) = on_the_way(&setup, &long(4));
    bench.ask(Request::SetSpeedFactor(0.5));
    bench.run(RAMP + LATENCY_MAX);
    assert_near(speed(&mut bench), STEPS_S, "the queue");
    bench.job_done();
    assert_eq!(bench.printer.now(), bench.printer.motion_now());
}

/// No more motion is claimed than the board can have made: what it still holds takes room in its queue.
#[test]
fn what_is_undone_in_its_ramp_is_not_claimed() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let (mut bench, _) = on_the_way(&setup, &long(6));
        // Of the estimate of the board's clock.
        let slack = setup.board.clock.ticks_in(Seconds(0.005));
        for (slow, wait) in [(0.01, 0.24), (0.01, 0.1), (0.3, 0.15), (0.05, 0.01), (0.01, 0.29)] {
            for (factor, wait) in [(slow, wait), (1.0, 0.06), (slow, 0.05), (1.0, 0.5)] {
                bench.ask(Request::SetSpeedFactor(factor));
                let until = bench.now() + Seconds(wait);
                while bench.now() < until {
                    let claimed = bench.session.motion_clock(bench.now()).expect("a board");
                    let made = bench.printer.motion_now();
                    assert!(claimed <= made + slack, "{factor} of {slow}: {claimed:?} of {made:?}");
                    bench.run(0.000_5);
                }
            }
        }
        bench.job_done();
    }
}

#[test]
fn the_next_run_begins_at_the_full_rate() {
    let setup = setup(BoardProfile::rp2040());
    for factor in [0.1, 0.7] {
        let file = format!("{}M400\nG1 X30 Y30\nG28 X\nG1 X140\n", long(1).replace("M84\n", ""));
        let (mut bench, _) = on_the_way(&setup, &file);
        bench.ask(Request::SetSpeedFactor(factor));
        bench.run(RAMP + LATENCY_MAX);
        assert_near(rate(&mut bench), factor, "the rate");
        let runs = |bench: &Bench| {
            bench.events.iter().filter(|event| matches!(event, Event::RunStarted { .. })).count()
        };
        let before = runs(&bench);
        bench.until("the next run", 120.0, |bench| runs(bench) > before);
        assert_near(rate(&mut bench), 1.0, "the rate");
        bench.job_over();
        bench.job_done();
        assert_eq!(holds(&bench), []);
        let at = bench.session.position().unwrap().0;
        bench.assert_position(at[0], at[1], at[2]);
    }
}

#[test]
fn to_cancel_while_it_is_slow_rests_within_a_ramp() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let (mut bench, _) = on_the_way(&setup, &long(6));
        bench.ask(Request::SetSpeedFactor(0.3));
        bench.run(RAMP + LATENCY_MAX);
        bench.ask(Request::Cancel);
        bench.run(RAMP + LATENCY_MAX);
        let pulses = bench.pulses().len();
        bench.job_over();
        assert_eq!(bench.pulses().len(), pulses);
        bench.assert_all_off();
        let [x, y, z, _] = bench.session.position().unwrap().0;
        bench.assert_position(x, y, z);
        bench.ask(Request::Gcode("G1 X140 F1200".into()));
        bench.run(1.0);
        assert_near(rate(&mut bench), 1.0, "by hand");
        bench.settle();
        bench.assert_position(140.0, y, z);
    }
}

/// What happens to a print that goes at a third of its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Trouble {
    None,
    Pause,
    Stall,
    Death,
    DeathInPause,
}

#[test]
fn the_steps_of_a_slow_print_are_the_same_whatever_happens() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let file = long(7);
        let play = |trouble: Trouble| {
            let (mut bench, from) = on_the_way(&setup, &file);
            bench.ask(Request::SetSpeedFactor(0.4));
            bench.run(2.0);
            assert_near(rate(&mut bench), 0.4, "the rate");
            let mut away = None;
            match trouble {
                Trouble::None => {}
                Trouble::Pause | Trouble::DeathInPause => {
                    bench.ask(Request::Pause);
                    bench.run(RAMP + LATENCY_MAX);
                    let begin = cut_at(&bench);
                    bench.run(0.2);
                    assert_near(rate(&mut bench), 1.0, "the way to the park position");
                    bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
                    if trouble == Trouble::DeathInPause {
                        die(&mut bench, &setup, 1.0);
                        crate::attach::take_up_paused(&mut bench, &file);
                    }
                    resume(&mut bench);
                    away = Some((begin, bench.pulses().len()));
                }
                Trouble::Stall => {
                    stall(&mut bench, 2.6);
                    held(&mut bench);
                    bench.ask(Request::Resume);
                }
                Trouble::Death => {
                    die(&mut bench, &setup, 0.7);
                    take_up(&mut bench, &file);
                    bench.ask(Request::Resume);
                }
            }
            bench.run(2.0 * RAMP + LATENCY_MAX);
            assert_near(rate(&mut bench), 0.4, &format!("after {trouble:?}"));
            bench.job_over();
            bench.job_done();
            assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0), "{trouble:?}");
            (steps_of(&bench, from, away), bench.counts())
        };
        let expected = play(Trouble::None);
        for trouble in [Trouble::Pause, Trouble::Stall, Trouble::Death, Trouble::DeathInPause] {
            assert!(play(trouble) == expected, "{trouble:?} on {}", setup.board.name);
        }
    }
}

/// On lines that are bad too: responses get lost.
#[test]
fn anything_in_any_order_loses_nothing() {
    for seed in 0..14 {
        let board = if seed % 3 == 0 { BoardProfile::stm32f103() } else { BoardProfile::rp2040() };
        let mut setup = setup(board);
        let file = file();
        let expected = {
            let (mut bench, from) = started(&setup, &file);
            bench.job_over();
            steps_of(&bench, from, None)
        };
        if seed % 2 == 1 {
            setup.faults = "drop=0.004,corrupt=0.003".into();
            setup.seed = seed;
        }
        let mut between = random(seed);
        let (mut bench, from) = started(&setup, &file);
        let mut away: Vec<(usize, usize)> = Vec::new();
        for _ in 0..7 {
            bench.run(between(0.0, 2.5));
            if is_over(&bench) {
                break;
            }
            let factor = between(0.05, 1.6);
            bench.ask(Request::SetSpeedFactor(factor));
            bench.run(between(0.0, 1.0));
            match between(0.0, 4.0) as u32 {
                0 if !is_over(&bench) => {
                    die(&mut bench, &setup, between(0.0, 3.0));
                    take_up(&mut bench, &file);
                    bench.ask(Request::Resume);
                }
                1 if !is_over(&bench) => {
                    if pause(&mut bench).is_some() {
                        let begin = cut_at(&bench);
                        resume(&mut bench);
                        away.push((begin, bench.pulses().len()));
                    } else if !is_over(&bench) {
                        resume(&mut bench);
                    }
                }
                2 if !is_over(&bench) => {
                    stall(&mut bench, between(0.5, 3.5));
                    bench.run(1.0);
                    if bench.session.job_status() == JobStatus::Held {
                        bench.ask(Request::Resume);
                    }
                }
                _ => {}
            }
        }
        if bench.session.job_status() == JobStatus::Held {
            bench.ask(Request::Resume);
        }
        bench.ask(Request::SetSpeedFactor(2.0));
        bench.job_over();
        bench.job_done();
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0), "seed {seed}");
        let made = pause::steps_without(&bench, from, &away);
        assert!(made == expected, "seed {seed}");
    }
}
