//! A host that dies in the middle of a print, and another that takes the print up: on a board that holds its motion it goes
//! on with the very next step, at the user's word, or is refused for a reason.

use std::fmt::Write as _;

use printer::{
    error::ErrorCode,
    journal::{Journal, JournalError},
    session::{Event, JobOptions, JobStatus, PhaseName, Request},
};
use virtual_printer::BoardProfile;

use crate::{
    bench::{Bench, Pulse, Setup},
    print::squares,
};

/// No heat: what becomes of that is told elsewhere.
pub(crate) fn setup(board: BoardProfile) -> Setup {
    let mut setup = Setup { board, ..Setup::default() };
    setup.config = setup.config.replacen("min_extrude_temp: 60", "min_extrude_temp: 0", 1);
    setup
}

/// Several runs of motion with turns, fan changes and filament.
pub(crate) fn file() -> String {
    let mut file = String::from("G28\nM83\nG92 E0\nG1 X20 Y20 Z1 F6000\nG1 X140 E2 F3000\n");
    for layer in 0..3 {
        let _ = write!(file, "M106 S{}\nG1 Z{:.1} F600\n", 80 * (layer + 1), 1.2 + 0.2 * f64::from(layer));
        for side in 0..8 {
            let at = 20 + 10 * side;
            let _ =
                write!(file, "G1 X{at} Y{at} E0.5 F4800\nG1 X{} E0.8\nG2 X{at} Y{at} I-10 J0 E1\n", at + 20);
        }
        file += if layer == 1 { "M400\nG4 P300\n" } else { "M221 S95\n" };
    }
    file + "M107\nM84\n"
}

pub(crate) fn journaled() -> JobOptions {
    JobOptions { journal: Some(0x00ab_0000), ..JobOptions::default() }
}

/// Starts the print; what has been pulsed before it got to work does not count.
pub(crate) fn started(setup: &Setup, file: &str) -> (Bench, usize) {
    let mut bench = setup.ready();
    bench.start_with(file, journaled()).unwrap();
    let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
    bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
    let from = bench.pulses().len();
    (bench, from)
}

/// Each motor's steps in their order.
pub(crate) fn steps(bench: &mut Bench, from: usize) -> Vec<Vec<bool>> {
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    let of = |wanted: usize| {
        let steps = bench.pulses()[from..].iter().filter(|(_, motor, _)| *motor == wanted);
        steps.map(|&(_, _, forward)| forward).collect()
    };
    (0..4).map(of).collect()
}

pub(crate) fn clean(setup: &Setup, file: &str) -> (Vec<Vec<bool>>, Vec<Pulse>) {
    let (mut bench, from) = started(setup, file);
    bench.job_over();
    bench.job_done();
    (steps(&mut bench, from), bench.relative_pulses(from))
}

/// The host is gone for good, and after a while another one connects.
pub(crate) fn die(bench: &mut Bench, setup: &Setup, seconds: f64) {
    bench.stalled = true;
    bench.run(seconds);
    bench.stalled = false;
    bench.replace_session(&setup.config);
}

/// The new host finds the print and takes it up, which moves nothing.
#[track_caller]
fn take_up_as(bench: &mut Bench, file: &str, status: JobStatus) {
    bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
    let pulses = bench.pulses().len();
    let journal = Journal::read(bench.journal.as_bytes()).unwrap();
    assert!(journal.knows(bench.session.held_print().unwrap()));
    bench.load(file);
    bench.session.take_up(&journal).unwrap();
    bench.until("the plan", 20.0, |bench| bench.session.job_status() == status);
    bench.run(2.0);
    assert_eq!(bench.pulses().len(), pulses, "it goes on by itself");
    assert_eq!((bench.session.job_status(), bench.errors()), (status, vec![]));
}

/// It was printing.
#[track_caller]
pub(crate) fn take_up(bench: &mut Bench, file: &str) {
    take_up_as(bench, file, JobStatus::Held);
    let held = bench.events.iter().filter(|event| matches!(event, Event::Held(_))).count();
    assert_eq!(held, 1);
}

/// It had been put aside.
#[track_caller]
pub(crate) fn take_up_paused(bench: &mut Bench, file: &str) {
    take_up_as(bench, file, JobStatus::Paused);
    assert!(bench.events.contains(&Event::Paused));
}

#[test]
fn the_next_step_follows_whenever_the_host_dies() {
    for board in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let setup = setup(board);
        let file = file();
        let (expected, _) = clean(&setup, &file);
        for tenth in 0..30 {
            let (mut bench, from) = started(&setup, &file);
            bench.run(0.05 + 0.37 * f64::from(tenth));
            if bench.session.job_status() == JobStatus::None {
                assert!(tenth > 20, "the print is too short");
                break;
            }
            die(&mut bench, &setup, 0.1 * f64::from(tenth % 7));
            take_up(&mut bench, &file);
            bench.ask(Request::Resume);
            bench.job_over();
            bench.job_done();
            assert!(steps(&mut bench, from) == expected, "{tenth} on {}", setup.board.name);
        }
    }
}

#[test]
fn hosts_may_die_as_often_as_they_like() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (expected, pulses) = clean(&setup, &file);
    for seed in 0..8 {
        let mut random = rand_pcg::Pcg32::new(seed, 5);
        let mut below = |limit: f64| {
            use rand_pcg::rand_core::Rng;
            limit * f64::from(random.next_u32()) / f64::from(u32::MAX)
        };
        let (mut bench, from) = started(&setup, &file);
        let mut deaths = 0;
        while bench.session.job_status() != JobStatus::None {
            bench.run(0.3 + below(4.0));
            if bench.session.job_status() == JobStatus::None {
                break;
            }
            deaths += 1;
            die(&mut bench, &setup, below(2.0));
            take_up(&mut bench, &file);
            if below(1.0) < 0.3 {
                // Nor does it matter that nobody said yes.
                die(&mut bench, &setup, below(2.0));
                take_up(&mut bench, &file);
            }
            bench.ask(Request::Resume);
            bench.run(below(1.0));
        }
        assert!(deaths > 3, "{deaths}");
        assert!(steps(&mut bench, from) == expected, "seed {seed}");
        // On the motion clock they come at the very same times, up to where the first run ends.
        let relative = bench.relative_pulses(from);
        let run = pulses.len() / 2;
        assert!(relative[..run] == pulses[..run], "seed {seed}");
    }
}

#[test]
fn what_the_user_changed_is_part_of_the_plan() {
    let setup = setup(BoardProfile::rp2040());
    let file = file().replace("M221 S95\n", "");
    let play = |dies: bool| {
        let (mut bench, from) = started(&setup, &file);
        bench.run(1.0);
        bench.ask(Request::SetSpeedFactor(0.6));
        bench.run(2.0);
        bench.ask(Request::SetFlowFactor(1.2));
        bench.run(0.5);
        bench.ask(Request::Pause);
        bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
        bench.gcode("G91\nG1 X5 Y-3 E2 F3000\nM204 S500\nG1 X5");
        bench.ask(Request::Resume);
        bench.until("the return", 30.0, |bench| bench.events.contains(&Event::Resumed));
        bench.run(3.0);
        if dies {
            die(&mut bench, &setup, 0.4);
            take_up(&mut bench, &file);
            assert_eq!(bench.session.factors(), [0.6, 1.2]);
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
        steps(&mut bench, from)
    };
    assert!(play(true) == play(false));
}

#[test]
fn a_print_that_was_taken_up_can_be_ended_instead() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = started(&setup, &file());
    bench.run(3.0);
    die(&mut bench, &setup, 1.0);
    take_up(&mut bench, &file());
    bench.ask(Request::Cancel);
    bench.job_over();
    assert!(bench.events.contains(&Event::JobCancelled));
    let (claimed, homed) = bench.session.position().unwrap();
    assert_eq!(homed, [true; 3]);
    bench.assert_position(claimed[0], claimed[1], claimed[2]);
    assert!(Journal::read(bench.journal.as_bytes()).unwrap().has_ended);
    bench.gcode("G1 X30 F3000");
    bench.assert_position(30.0, claimed[1], claimed[2]);
}

/// The board still holds, nothing has moved, and the user may restart it.
#[track_caller]
fn refused(bench: &mut Bench, journal: &Journal, file: &str) {
    bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
    let pulses = bench.pulses().len();
    bench.load(file);
    let error = bench.session.take_up(journal).err().unwrap_or_else(|| {
        bench.until("the refusal", 20.0, |bench| !bench.errors().is_empty());
        bench.error()
    });
    assert_eq!(error.code, ErrorCode::ContinuationRefused, "{error}");
    bench.run(2.0);
    assert_eq!((bench.session.phase(), bench.pulses().len()), (PhaseName::Holding, pulses));
}

#[test]
fn what_does_not_fit_is_refused_and_the_board_goes_on_holding() {
    let setup = setup(BoardProfile::rp2040());
    let (mut bench, _) = started(&setup, &file());
    bench.run(4.0);
    die(&mut bench, &setup, 1.0);
    let journal = Journal::read(bench.journal.as_bytes()).unwrap();
    // Another file, one that ends too soon, one that is empty, one that is none.
    let other = file().replace("X140 E2", "X139 E2");
    for file in [other.as_str(), "G28\nG1 X20 Y20 Z1 F6000\n", "", "\u{1}\u{2}G1 X1\nG28 X\nG1 X9999\n"] {
        refused(&mut bench, &journal, file);
        bench.events.clear();
    }
    // The journal of another print, and one whose print has ended.
    let (mut ended, _) = started(&setup, "G28\nG1 X20 F6000\n");
    ended.job_over();
    let ended = Journal::read(ended.journal.as_bytes()).unwrap();
    refused(&mut bench, &ended, &file());
    // Another machine file: the board would be restarted by it, so only its kinematics differ.
    bench.replace_session(&setup.config.replacen("max_accel: 2000", "max_accel: 2001", 1));
    refused(&mut bench, &journal, &file());
    // And still it can be gone on with.
    bench.replace_session(&setup.config);
    take_up(&mut bench, &file());
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
}

#[test]
fn a_torn_journal_is_right_or_refused() {
    let setup = setup(BoardProfile::rp2040());
    let file = file();
    let (expected, _) = clean(&setup, &file);
    let (mut bench, from) = started(&setup, &file);
    bench.run(2.0);
    bench.ask(Request::SetSpeedFactor(0.5));
    bench.run(6.0);
    die(&mut bench, &setup, 0.2);
    take_up(&mut bench, &file);
    bench.ask(Request::Resume);
    bench.run(1.0);
    die(&mut bench, &setup, 0.2);
    bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
    let whole = bench.journal.clone();
    let mut right = 0;
    for at in (0..whole.len()).step_by(7) {
        let journal = match Journal::read(&whole.as_bytes()[..at]) {
            Ok(journal) => journal,
            Err(error) => {
                assert_eq!(error, JournalError::NoBegin, "{at}");
                continue;
            }
        };
        bench.events.clear();
        bench.load(&file);
        if bench.session.take_up(&journal).is_ok() {
            bench.until("the end of the plan", 20.0, |bench| {
                !bench.errors().is_empty() || bench.session.job_status() == JobStatus::Held
            });
        }
        if bench.session.job_status() == JobStatus::Held {
            right += 1;
            bench.replace_session(&setup.config);
            bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
        }
        // What the sessions wrote does not belong to the journal that is torn.
        bench.journal.clone_from(&whole);
    }
    assert!(right > 0, "none of them was of use");
    take_up(&mut bench, &file);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    // The speed changes when steps are made, and which of two that are due together comes first, but not how many.
    let counts = |steps: &[Vec<bool>]| -> Vec<[usize; 2]> {
        steps.iter().map(|of| [true, false].map(|way| of.iter().filter(|&&is| is == way).count())).collect()
    };
    assert_eq!(counts(&steps(&mut bench, from)), counts(&expected));
}

#[test]
fn a_board_without_a_print_is_restarted_as_ever() {
    let setup = setup(BoardProfile::rp2040());
    let mut bench = setup.ready();
    bench.home();
    bench.gcode("G1 X50 F6000");
    die(&mut bench, &setup, 0.2);
    bench.connect();
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    // Nor is one that is being homed anything to go on with.
    bench.start_with(&file(), journaled()).unwrap();
    bench.until("homing", 10.0, |bench| bench.session.position().unwrap().1[0]);
    die(&mut bench, &setup, 0.2);
    bench.connect();
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
}

#[test]
fn a_host_that_was_away_for_long_heats_again_before_the_next_step() {
    let setup = Setup::default();
    let file = squares(3);
    let (expected, _) = clean(&setup, &file);
    for away in [3.0, 60.0, 900.0] {
        let (mut bench, from) = started(&setup, &file);
        bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 9000);
        assert!(bench.celsius(0) > 65.0);
        die(&mut bench, &setup, away);
        take_up(&mut bench, &file);
        let cooled = bench.celsius(0);
        bench.ask(Request::Resume);
        let pulses = bench.pulses().len();
        bench.until("motion", 300.0, |bench| bench.pulses().len() > pulses);
        assert!(bench.celsius(0) > 64.0, "it goes on at {} °C, from {cooled} °C", bench.celsius(0));
        bench.job_over();
        bench.job_done();
        assert!(steps(&mut bench, from) == expected, "{away}");
        bench.assert_all_off();
    }
}

#[test]
fn what_is_done_by_hand_in_a_pause_is_no_print_to_be_taken_up() {
    let setup = setup(BoardProfile::rp2040());
    for by_hand in [Request::Gcode("M84".into()), Request::SetPosition { axis: 2, position: units::Mm(3.0) }]
    {
        let (mut bench, _) = started(&setup, &file());
        bench.run(3.0);
        bench.ask(Request::Pause);
        bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
        bench.ask(by_hand);
        bench.run(1.0);
        die(&mut bench, &setup, 0.5);
        bench.connect();
        assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    }
    // A pause in which nothing else was done is as good as a hold, however long it lasts.
    let (expected, _) = clean(&setup, &file());
    for seconds in [1.0, 100.0, 200.0, 300.0, 3000.0] {
        let (mut bench, from) = started(&setup, &file());
        bench.run(3.0);
        bench.ask(Request::Pause);
        bench.until("the pause", 30.0, |bench| bench.session.job_status() == JobStatus::Paused);
        let parked = bench.pulses().len();
        die(&mut bench, &setup, seconds);
        take_up_paused(&mut bench, &file());
        bench.ask(Request::Resume);
        bench.until("going on", 30.0, |bench| {
            bench.events.iter().any(|event| matches!(event, Event::RunResumed { .. }))
        });
        let back = bench.pulses().len();
        assert!(back > parked);
        bench.job_over();
        bench.job_done();
        // Less those to the park position and back, the steps are the same.
        let sums = |steps: &[Vec<bool>]| -> Vec<i64> {
            let sum = |of: &Vec<bool>| of.iter().map(|&is| if is { 1 } else { -1 }).sum();
            steps.iter().map(sum).collect()
        };
        assert_eq!(sums(&steps(&mut bench, from)), sums(&expected), "{seconds}");
    }
}

#[test]
fn a_print_that_is_over_is_not_held() {
    let setup = setup(BoardProfile::rp2040());
    for cancelled in [false, true] {
        let (mut bench, _) = started(&setup, &file());
        if cancelled {
            bench.run(2.0);
            bench.ask(Request::Cancel);
        }
        bench.job_over();
        die(&mut bench, &setup, 0.5);
        bench.until("ready", 12.0, |bench| {
            assert_ne!(bench.session.phase(), PhaseName::Holding);
            bench.session.phase() == PhaseName::Ready
        });
    }
}

#[test]
fn heat_that_falls_again_is_asked_about_again() {
    let setup = Setup::default();
    let file = squares(3);
    let (mut bench, from) = started(&setup, &file);
    bench.until("motion", 100.0, |bench| bench.pulses().len() > from + 9000);
    die(&mut bench, &setup, 900.0);
    take_up(&mut bench, &file);
    bench.ask(Request::Resume);
    bench.run(1.0);
    let pulses = bench.pulses().len();
    bench.stalled = true;
    bench.run(30.0);
    bench.stalled = false;
    bench.run(60.0);
    assert_eq!(bench.session.job_status(), JobStatus::Held);
    assert_eq!(bench.pulses().len(), pulses);
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
}
