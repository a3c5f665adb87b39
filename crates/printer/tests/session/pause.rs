//! Pauses on a board that can hold its motion: the head rests within a ramp, is parked, comes back, and the very next step
//! follows. The steps of the print, and their ticks within each run of motion, are those of a print that was never paused.

use printer::{
    error::ErrorCode,
    session::{Event, JobStatus, PhaseName, Request},
};
use rand_pcg::{Pcg32, rand_core::Rng};
use units::{Seconds, Ticks};
use virtual_printer::BoardProfile;

use crate::{
    attach::{die, file, setup, started, take_up, take_up_paused},
    bench::{Bench, Setup},
    hold::{holds, stall},
    print::squares,
};

/// Slowing down takes so long on the usual machine …
const RAMP: f64 = 0.3;
/// … and the order gets to the board, and takes effect, within this.
const LATENCY_MAX: f64 = 0.2;

/// A step of the print: the run of motion, ticks from its start, the motor, and which way.
pub(crate) type Step = (usize, u64, usize, bool);

/// The motion clocks at which runs were cut off in a pause; homing breaks runs off too.
pub(crate) fn cuts(bench: &Bench) -> Vec<u64> {
    let homed = bench.events.iter().rposition(|event| matches!(event, Event::Homed { .. }));
    let cut = |event: &Event| match event {
        Event::RunBroken { at } => Some(at.0),
        _ => None,
    };
    bench.events[homed.unwrap_or_default()..].iter().filter_map(cut).collect()
}

/// The steps of the print without those of its pauses, told apart by what the session said of them.
fn print_steps(bench: &Bench, from: usize) -> Vec<Step> {
    let cuts = cuts(bench);
    let mut parts: Vec<(Ticks, Option<(usize, Ticks)>)> = Vec::new();
    let (mut runs, mut start, mut by_hand) = (0, Ticks(0), false);
    for (index, event) in bench.events.iter().enumerate() {
        match *event {
            Event::RunStarted { at, .. } => {
                // What no line asks for is the way to the park position, or back.
                let line = bench.events[index..].iter().find_map(|event| match event {
                    Event::Move(made) => Some(made.line),
                    _ => None,
                });
                if by_hand || line == Some(0) {
                    parts.push((at, None));
                } else {
                    (runs, start) = (runs + 1, at);
                    parts.push((at, Some((runs, start))));
                }
            }
            Event::Paused => by_hand = true,
            Event::Resumed => by_hand = false,
            Event::RunBroken { at } if cuts.contains(&at.0) => parts.push((at, None)),
            Event::RunResumed { broken, at } => {
                start = Ticks(start.0 + at.0 - broken.0);
                parts.push((at, Some((runs, start))));
            }
            _ => {}
        }
    }
    let mut steps: Vec<Step> = Vec::new();
    for &(at, motor, forward) in &bench.pulses()[from..] {
        let index = parts.partition_point(|(begin, _)| begin.0 < at);
        if let (_, Some((run, start))) = parts[index - 1] {
            steps.push((run, at - start.0, motor, forward));
        }
    }
    // Those of one tick have no order among motors.
    steps.sort_unstable();
    steps
}

/// Each motor's steps in their order, without those from one place to another.
pub(crate) fn steps_of(bench: &Bench, from: usize, without: Option<(usize, usize)>) -> Vec<Vec<bool>> {
    steps_without(bench, from, without.as_slice())
}

/// The same, from several places to others.
pub(crate) fn steps_without(bench: &Bench, from: usize, without: &[(usize, usize)]) -> Vec<Vec<bool>> {
    let is_own = |index: usize| without.iter().all(|(begin, end)| !(*begin..*end).contains(&index));
    let pulses = bench.pulses().iter().enumerate().skip(from).filter(|(index, _)| is_own(*index));
    let pulses: Vec<_> = pulses.map(|(_, pulse)| *pulse).collect();
    let of = |motor: usize| pulses.iter().filter(move |pulse| pulse.1 == motor).map(|pulse| pulse.2);
    (0..4).map(|motor| of(motor).collect()).collect()
}

pub(crate) fn random(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut random = Pcg32::new(seed, 17);
    move |low, high| low + (high - low) * f64::from(random.next_u32()) / f64::from(u32::MAX)
}

pub(crate) fn is_over(bench: &Bench) -> bool {
    bench.session.job_status() == JobStatus::None
}

/// Pauses, and waits until the head is parked, or the job has ended. Says how long motion took to rest, where it was cut
/// off.
#[track_caller]
pub(crate) fn pause(bench: &mut Bench) -> Option<f64> {
    let (asked, pulses) = (bench.now(), bench.pulses().len());
    let before = cuts(bench).len();
    bench.ask(Request::Pause);
    let (mut last, mut made) = (asked, pulses);
    bench.until("the rest", 60.0, |bench| {
        if bench.pulses().len() != made && cuts(bench).len() == before {
            (last, made) = (bench.now(), bench.pulses().len());
        }
        cuts(bench).len() > before || bench.session.job_status() == JobStatus::Paused || is_over(bench)
    });
    let was_cut = cuts(bench).len() > before;
    bench.until("the pause", 60.0, |bench| bench.session.job_status() == JobStatus::Paused || is_over(bench));
    was_cut.then_some((last - asked).0)
}

#[track_caller]
pub(crate) fn resume(bench: &mut Bench) {
    bench.ask(Request::Resume);
    let resumed = |event: &&Event| matches!(event, Event::RunResumed { .. });
    let wanted = cuts(bench).len();
    bench.until("going on", 60.0, |bench| bench.events.iter().filter(resumed).count() == wanted);
}

pub(crate) fn clean(setup: &Setup, file: &str) -> (Vec<Step>, f64) {
    let (mut bench, from) = started(setup, file);
    let began = bench.age();
    bench.job_over();
    bench.job_done();
    (print_steps(&bench, from), bench.age() - began)
}

#[track_caller]
pub(crate) fn assert_whole(bench: &mut Bench, from: usize, expected: &[Step], what: &str) {
    bench.job_over();
    bench.job_done();
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0), "{what}");
    let steps = print_steps(bench, from);
    let differs = steps.iter().zip(expected).position(|(is, should)| is != should);
    assert!(steps == expected, "{what}: {} of {} steps, from {differs:?}", steps.len(), expected.len());
}

#[test]
fn the_steps_of_a_paused_print_are_those_of_any_other() {
    for (board, rounds) in [(BoardProfile::rp2040(), 14), (BoardProfile::stm32f103(), 7)] {
        let setup = setup(board);
        let file = file();
        let (expected, lasts) = clean(&setup, &file);
        let (mut cuts, mut slowest) = (0, 0.0_f64);
        for round in 0..rounds {
            let mut between = random(round);
            let (mut bench, from) = started(&setup, &file);
            for _ in 0..2 {
                bench.run(between(0.0, lasts / 2.0));
                if is_over(&bench) {
                    break;
                }
                if let Some(took) = pause(&mut bench) {
                    cuts += 1;
                    slowest = slowest.max(took);
                }
                if is_over(&bench) {
                    break;
                }
                let pulses = bench.pulses().len();
                bench.run(between(0.1, 3.0));
                assert_eq!(bench.pulses().len(), pulses, "it moves in a pause");
                if between(0.0, 1.0) < 0.5 {
                    bench.gcode("G91\nG1 X-5 Y3 E2 F3000\nM204 S500\nG1 Z2\nM106 S10");
                }
                resume(&mut bench);
            }
            let what = format!("round {round} on {}", setup.board.name);
            assert_whole(&mut bench, from, &expected, &what);
            assert_eq!(holds(&bench), []);
        }
        assert!(cuts > rounds, "{cuts} cuts");
        assert!(slowest <= RAMP + LATENCY_MAX, "it took {slowest} s to rest");
        assert!(slowest > 0.1, "{slowest} s: nothing moved");
    }
}

#[test]
fn the_head_is_parked_above_the_part_and_comes_back() {
    let mut setup = setup(BoardProfile::rp2040());
    setup.config = setup.config.replacen("max_accel:", "pause_lift: 7\npause_x: 3\nmax_accel:", 1);
    let (mut bench, _) = started(&setup, &file());
    bench.run(4.0);
    bench.ask(Request::Pause);
    bench.until("the rest", 2.0, |bench| !cuts(bench).is_empty());
    bench.run(0.1);
    let at: Vec<f64> = bench.state().motors.iter().map(|motor| motor.position.0).collect();
    let counts = bench.counts();
    bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
    let retracted = bench.counts()[3] - counts[3];
    assert!((retracted as f64 + 3200.0 / 22.67).abs() <= 1.0, "{retracted} steps of filament");
    let parked = bench.state();
    let by: Vec<f64> = parked.motors.iter().zip(&at).map(|(motor, at)| motor.position.0 - at).collect();
    assert!((parked.motors[0].position.0 - 3.0).abs() < 0.1, "{}", parked.motors[0].position.0);
    assert!(by[1].abs() < 0.02 && (by[2] - 7.0).abs() < 0.02, "{by:?}");
    bench.ask(Request::Resume);
    bench.until("the way back", 30.0, |bench| {
        bench.events.iter().any(|event| matches!(event, Event::RunResumed { .. }))
    });
    assert_eq!(bench.counts(), counts, "it is not back at the very step");
    bench.job_over();
    bench.job_done();
}

#[test]
fn hosts_may_die_at_any_moment_around_a_pause() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (mut bench, from) = started(&setup, &file);
    bench.job_over();
    let expected = steps_of(&bench, from, None);
    drop(bench);
    for seed in 0..12 {
        let mut between = random(seed);
        let (mut bench, from) = started(&setup, &file);
        bench.run(between(0.3, 6.0));
        if pause(&mut bench).is_none() {
            continue;
        }
        let begin = bench.pulses().partition_point(|pulse| pulse.0 <= cuts(&bench)[0]);
        bench.run(between(0.0, 2.0));
        bench.ask(Request::Resume);
        let resumed = |event: &Event| matches!(event, Event::RunResumed { .. });
        bench.until("going on", 30.0, |bench| bench.events.iter().any(resumed));
        let end = bench.pulses().len();
        bench.run(between(0.0, 3.0));
        if !is_over(&bench) {
            die(&mut bench, &setup, between(0.0, 3.0));
            take_up(&mut bench, &file);
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
        assert!(steps_of(&bench, from, Some((begin, end))) == expected, "seed {seed}");
    }
    // Before the board has dropped anything it is a hold as any other.
    for hundredth in [0, 3, 10, 20, 30] {
        let (mut bench, from) = started(&setup, &file);
        bench.run(3.0);
        bench.ask(Request::Pause);
        bench.run(0.01 * f64::from(hundredth));
        die(&mut bench, &setup, 0.5);
        take_up(&mut bench, &file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(steps_of(&bench, from, None) == expected, "{hundredth}");
    }
}

/// The first host dies while the head is on its way to the park position, there, or on its way back.
#[test]
fn a_host_may_die_while_the_head_is_parked() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let file = file();
        let (mut bench, from) = started(&setup, &file);
        bench.job_over();
        let expected = steps_of(&bench, from, None);
        drop(bench);
        for seed in 0..14 {
            let mut between = random(seed);
            let (mut bench, from) = started(&setup, &file);
            bench.run(between(0.3, 8.0));
            bench.ask(Request::Pause);
            bench.until("the rest", 10.0, |bench| !cuts(bench).is_empty());
            let cut = cuts(&bench)[0];
            let begin = bench.pulses().partition_point(|pulse| pulse.0 <= cut);
            let is_parked = seed % 2 == 0;
            bench.run(if is_parked { between(1.0, 2.0) } else { between(0.0, 0.8) });
            if seed % 4 == 0 {
                bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
                bench.gcode("G91\nG1 X-5 Y3 F3000\nG1 Z2");
                bench.ask(Request::Resume);
                bench.run(between(0.0, 0.5));
            }
            for _ in 0..=(seed % 3) {
                die(&mut bench, &setup, between(0.0, 5.0));
                take_up_paused(&mut bench, &file);
            }
            bench.ask(Request::Resume);
            let resumed = |event: &Event| matches!(event, Event::RunResumed { .. });
            bench.until("going on", 30.0, |bench| bench.events.iter().any(resumed));
            let end = bench.pulses().len();
            bench.job_over();
            bench.job_done();
            assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
            assert!(steps_of(&bench, from, Some((begin, end))) == expected, "{seed} on {}", setup.board.name);
            let made: i64 = bench.pulses()[begin..end].iter().map(|pulse| if pulse.2 { 1 } else { -1 }).sum();
            assert_eq!(made, 0, "it did not come back to the very step");
        }
    }
}

#[test]
fn a_pause_may_come_at_the_first_step_at_the_last_and_again_at_once() {
    let setup = setup(BoardProfile::rp2040());
    let file = "G28\nG1 X20 Y20 Z1 F6000\nM400\nG1 X40 F6000\nM400\nG1 X60 F6000\n";
    let (expected, lasts) = clean(&setup, file);
    for hundredth in 0..(lasts * 12.0) as u32 {
        let (mut bench, from) = started(&setup, file);
        bench.run(f64::from(hundredth) / 12.0);
        while !is_over(&bench) {
            pause(&mut bench);
            // Once it is paused another pause is nothing new.
            if !is_over(&bench) {
                bench.ask(Request::Pause);
                bench.run(0.1);
                resume(&mut bench);
                bench.run(0.45);
            }
        }
        assert_whole(&mut bench, from, &expected, &format!("{hundredth}"));
    }
}

#[test]
fn a_pause_as_it_speeds_up_again_is_a_pause() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (expected, _) = clean(&setup, &file);
    for step in 0..12 {
        let (mut bench, from) = started(&setup, &file);
        bench.run(3.0);
        for _ in 0..2 {
            pause(&mut bench).expect("a cut");
            resume(&mut bench);
            bench.run(0.06 * f64::from(step));
        }
        pause(&mut bench).expect("a cut");
        resume(&mut bench);
        assert_whole(&mut bench, from, &expected, &format!("{step}"));
    }
}

#[test]
fn what_is_held_for_another_reason_can_be_paused() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (expected, _) = clean(&setup, &file);
    for (index, away) in [1.8, 2.05, 2.3, 2.6, 4.0].into_iter().enumerate() {
        let (mut bench, from) = started(&setup, &file);
        bench.run(2.0 + 0.3 * index as f64);
        stall(&mut bench, away);
        bench.run(0.1 * index as f64);
        pause(&mut bench);
        resume(&mut bench);
        assert_whole(&mut bench, from, &expected, &format!("{away}"));
    }
    // What another host began is paused as well.
    let (mut bench, from) = started(&setup, &file);
    bench.run(3.0);
    die(&mut bench, &setup, 1.0);
    take_up(&mut bench, &file);
    pause(&mut bench).expect("a cut");
    let pulses = bench.pulses().len();
    bench.run(3.0);
    assert_eq!(bench.pulses().len(), pulses);
    resume(&mut bench);
    bench.job_over();
    bench.job_done();
    assert!(bench.pulses().len() - from > expected.len());
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
}

#[test]
fn a_pause_can_become_an_end_or_an_emergency() {
    let setup = setup(BoardProfile::rp2040());
    for twentieth in 0..40 {
        let (mut bench, _) = started(&setup, &file());
        bench.run(3.0);
        bench.ask(Request::Pause);
        bench.run(f64::from(twentieth) / 20.0);
        if twentieth % 4 == 3 {
            bench.ask(Request::EmergencyStop);
            bench.failed(ErrorCode::EmergencyStop, None);
            bench.run(0.1);
            assert_eq!(bench.session.phase(), PhaseName::Shutdown);
            bench.assert_all_off();
            continue;
        }
        let asked = bench.now();
        bench.ask(Request::Cancel);
        bench.job_over();
        assert!(bench.now() - asked < Seconds(1.5), "{:?}", bench.now() - asked);
        assert!(bench.events.contains(&Event::JobCancelled), "{twentieth}");
        bench.assert_all_off();
        let claimed = bench.session.position().unwrap().0;
        bench.assert_position(claimed[0], claimed[1], claimed[2]);
        bench.gcode("G1 X30 F3000");
        bench.assert_position(30.0, claimed[1], claimed[2]);
    }
}

#[test]
fn to_cancel_rests_within_a_ramp() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let (mut bench, _) = started(&setup, &file());
        bench.run(3.0);
        let (asked, mut last) = (bench.now(), bench.now());
        bench.ask(Request::Cancel);
        let mut pulses = bench.pulses().len();
        bench.until("the end", 10.0, |bench| {
            if bench.pulses().len() != pulses {
                (last, pulses) = (bench.now(), bench.pulses().len());
            }
            is_over(bench)
        });
        assert!((last - asked).0 < RAMP + LATENCY_MAX, "{} s", (last - asked).0);
        bench.assert_all_off();
        let claimed = bench.session.position().unwrap().0;
        bench.assert_position(claimed[0], claimed[1], claimed[2]);
        // And so are moves by hand.
        bench.ask(Request::Gcode("G1 X140 F600".into()));
        bench.run(2.0);
        let asked = bench.now();
        bench.ask(Request::Cancel);
        bench.settle();
        assert!((bench.now() - asked).0 < RAMP + LATENCY_MAX + 1.6);
        let x = bench.session.position().unwrap().0[0];
        bench.assert_position(x, claimed[1], claimed[2]);
        bench.gcode("G1 X30 F3000");
        bench.assert_position(30.0, claimed[1], claimed[2]);
    }
}

#[test]
fn a_bad_line_loses_nothing() {
    let mut setup = setup(BoardProfile::stm32f103());
    let file = file();
    let (expected, lasts) = clean(&setup, &file);
    for (seed, faults) in
        ["corrupt=0.01", "drop=0.01", "duplicate=0.01", "delay=0.005"].into_iter().enumerate()
    {
        setup.faults = faults.to_owned();
        setup.seed = seed as u64;
        let mut between = random(seed as u64);
        let (mut bench, from) = started(&setup, &file);
        for _ in 0..3 {
            bench.run(between(0.0, lasts / 3.0));
            pause(&mut bench);
            if is_over(&bench) {
                break;
            }
            bench.run(between(0.0, 1.0));
            resume(&mut bench);
        }
        assert_whole(&mut bench, from, &expected, faults);
    }
}

#[test]
fn a_head_that_was_moved_by_hand_is_homed_and_goes_on() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = started(&setup, &file());
    bench.run(4.0);
    pause(&mut bench).expect("a cut");
    let cut = bench.session.position().unwrap().0;
    bench.gcode("M84");
    assert_eq!(bench.request(Request::Resume).unwrap_err().code, ErrorCode::NotHomed);
    bench.gcode("G28");
    resume(&mut bench);
    bench.job_over();
    bench.job_done();
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    assert!(cut[2] > 1.0);
}

#[test]
fn a_nozzle_that_is_off_in_a_pause_is_heated_again() {
    let setup = Setup::default();
    let file = squares(3);
    let (mut bench, from) = started(&setup, &file);
    bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 9000);
    pause(&mut bench).expect("a cut");
    assert!(bench.celsius(0) > 60.0);
    bench.ask(Request::SetTemperature(gcode::Heater::Tool(0), units::Celsius(0.0)));
    bench.until("cold", 200.0, |bench| bench.celsius(0) < 50.0);
    let pulses = bench.pulses().len();
    bench.ask(Request::Resume);
    bench.until("motion", 200.0, |bench| bench.pulses().len() > pulses);
    assert!(bench.celsius(0) > 64.0, "{}", bench.celsius(0));
    bench.job_over();
    bench.job_done();
    bench.assert_all_off();
}
