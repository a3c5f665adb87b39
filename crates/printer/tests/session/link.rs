//! The line to the board: cut, damaged, silent, shared with another host, slow.

use std::fmt::Write;

use printer::{
    error::{ErrorCode, PrinterError},
    session::{JobStatus, PhaseName, Request, Session},
};
use rand_pcg::{Pcg32, rand_core::Rng};
use units::Seconds;
use virtual_printer::BoardProfile;

use crate::{
    bench::{Bench, Pulse, Setup},
    machine,
    print::{END, START, squares},
};

/// The pulses of each run of motion, by their distance from its first.
fn runs(bench: &Bench) -> Vec<Vec<Pulse>> {
    let mut runs: Vec<Vec<Pulse>> = Vec::new();
    let mut last = 0;
    // Runs are further apart than any two steps within one.
    let pause = u64::from(bench.printer.profile().clock.0) / 5;
    let mut first = 0;
    for &(at, motor, forward) in bench.pulses() {
        if runs.is_empty() || at - last > pause {
            runs.push(Vec::new());
            first = at;
        }
        last = at;
        runs.last_mut().unwrap().push((at - first, motor, forward));
    }
    runs
}

#[test]
fn a_damaged_line_changes_no_pulse() {
    let file = squares(2);
    let print = |faults: &str, seed| {
        let mut bench = Setup { seed, ..Setup::faults(faults) }.bench();
        bench.until("ready", 60.0, |bench| bench.session.phase() == PhaseName::Ready);
        bench.print(&file);
        bench.job_done();
        bench.assert_all_off();
        let damaged = bench.state().damaged_bytes;
        let stats = bench.session.link_stats().unwrap();
        // Homing ends where the switch bounces to: the print itself is compared.
        let runs = runs(&bench);
        (runs.last().unwrap().clone(), damaged, stats.bytes_retransmitted)
    };
    let (expected, damaged, _) = print("", 1);
    assert_eq!(damaged, [0, 0]);
    assert!(expected.len() > 10_000);
    for (seed, faults) in [
        (1, "corrupt=0.01"),
        (2, "drop=0.01"),
        (3, "duplicate=0.01"),
        (4, "delay=0.01"),
        (5, "corrupt=0.005,drop=0.005,delay=0.002"),
    ] {
        let (pulses, damaged, again) = print(faults, seed);
        assert!(damaged.iter().sum::<u64>() > 50, "{faults}: {damaged:?}");
        assert!(again > 0 || faults.starts_with('d'), "{faults}");
        assert!(pulses == expected, "{faults}: {} pulses, {} expected", pulses.len(), expected.len());
    }
}

#[test]
fn an_emergency_stop_gets_through_a_damaged_line() {
    for seed in 1..6 {
        let mut bench = Setup { seed, ..Setup::faults("corrupt=0.01") }.bench();
        bench.until("ready", 60.0, |bench| bench.session.phase() == PhaseName::Ready);
        bench.start(&squares(2));
        bench.line(12);
        bench.ask(Request::EmergencyStop);
        bench.until("shutdown", 2.0, |bench| bench.printer.state().shutdown.is_some());
        bench.ask(Request::FirmwareRestart);
        bench.until("ready", 60.0, |bench| bench.session.phase() == PhaseName::Ready);
    }
}

#[test]
fn a_cable_that_is_pulled() {
    let mut bench = Setup::faults("unplug@45,replug@60").ready();
    let body: String = (0..60).map(|_| "G1 X100 E2 F1200\nG1 X10 E2\n").collect();
    bench.start(&format!("{START}{body}{END}"));
    bench.until("the loss", 80.0, |bench| bench.session.phase() == PhaseName::Failed);
    assert!(bench.age() < 55.0, "{}", bench.age());
    bench.failed(ErrorCode::LinkLost, None);
    assert_eq!(bench.session.position(), None);
    // The board, alone, holds the motion, and keeps its heaters at stand-by: what was asked for is less here.
    let pulses = bench.pulses().len();
    bench.run(30.0);
    let state = bench.state();
    assert_eq!((state.shutdown, bench.pulses().len()), (None, pulses));
    assert!(state.motors.iter().all(|motor| motor.lost.0 == 0));
    assert!(state.heaters.iter().all(|heater| heater.temperature.0 < 73.0));
    assert_eq!(bench.session.job_status(), JobStatus::None);
    assert_eq!(bench.session.phase(), PhaseName::Failed);
    // Only the user starts again.
    bench.events.clear();
    bench.ask(Request::FirmwareRestart);
    bench.connect();
    bench.assert_all_off();
    bench.home();
}

#[test]
fn blocks_are_checked_where_the_board_knows_how() {
    for board in BoardProfile::all() {
        for (board, checked) in [(board.clone(), true), (board.plain(), false)] {
            let setup = Setup { board, ..Setup::default() };
            let mut bench = setup.ready();
            assert_eq!(bench.session.link_stats().unwrap().checked, checked);
            // A host that died leaves a board that takes nothing without a check; the next one finds in all the same.
            bench.gcode("M104 S200");
            bench.replace_session(&setup.config);
            bench.connect();
            let stats = bench.session.link_stats().unwrap();
            assert_eq!((stats.checked, stats.unchecked), (checked, 0));
            bench.home();
        }
    }
}

#[test]
fn a_board_that_starts_anew_in_a_print_is_noticed_and_left_alone() {
    for board in BoardProfile::all().into_iter().flat_map(|board| [board.clone().plain(), board]) {
        let setup = Setup { board, ..Setup::faults("board-reset@45") };
        let mut bench = setup.ready();
        let body: String = (0..60).map(|_| "G1 X100 E2 F1200\nG1 X10 E2\n").collect();
        bench.start(&format!("{START}{body}{END}"));
        bench.until("the restart", 80.0, |bench| bench.session.phase() == PhaseName::Failed);
        assert!(bench.age() < 46.0, "{}", bench.age());
        bench.failed(ErrorCode::BoardRestarted, None);
        bench.run(10.0);
        bench.assert_all_off();
    }
}

#[test]
fn a_board_that_another_host_left_configured() {
    let mut bench = Setup::default().ready();
    bench.home();
    let other = machine::CONFIG.replace("gpio18", "gpio19");
    bench.replace_session(&other);
    bench.connect();
    assert_eq!(bench.errors(), []);
    bench.run(2.0);
    bench.assert_all_off();
}

#[test]
fn a_board_that_was_left_printing_is_stopped_by_connecting() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(3));
    bench.line(12);
    bench.replace_session(machine::CONFIG);
    bench.connect();
    bench.assert_all_off();
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
}

#[test]
fn a_board_that_is_in_shutdown_says_why() {
    let mut bench = Setup::default().ready();
    bench.ask(Request::EmergencyStop);
    bench.run(1.0);
    bench.replace_session(machine::CONFIG);
    bench.until("shutdown", 15.0, |bench| bench.session.phase() == PhaseName::Shutdown);
    bench.failed(ErrorCode::EmergencyStop, None);
    bench.run(5.0);
    assert_eq!(bench.session.phase(), PhaseName::Shutdown);
    bench.events.clear();
    bench.ask(Request::FirmwareRestart);
    bench.connect();
    assert_eq!(bench.errors(), []);
    bench.home();
}

#[test]
fn a_stop_that_nobody_answers_is_not_claimed() {
    let mut bench = Setup::faults("unplug@60").ready();
    bench.run(60.0 - bench.age());
    bench.ask(Request::EmergencyStop);
    bench.events.clear();
    bench.until("the silence", 10.0, |bench| bench.session.phase() == PhaseName::Failed);
    bench.failed(ErrorCode::LinkTimeout, None);
    assert!(bench.error().what_to_do().contains("cut its power"));
}

#[test]
fn a_port_with_nobody_there() {
    let mut bench = Setup::faults("unplug").bench();
    bench.until("the end", 10.0, |bench| bench.session.phase() == PhaseName::Failed);
    bench.failed(ErrorCode::BoardSilent, None);
    let refused = bench.request(Request::EmergencyStop).unwrap_err();
    assert_eq!(refused.code, ErrorCode::NotConnected);
}

/// What a session makes of a port whose other end answers each message with this, and after how many seconds.
fn judged(mut answer: impl FnMut() -> Vec<u8>) -> (PrinterError, f64) {
    let config = printer::config::parse(crate::machine::CONFIG).0.unwrap();
    let mut now = Seconds(100.0);
    let mut session = Session::new(config, now);
    let mut out = Vec::new();
    loop {
        assert!(now < Seconds(120.0), "nothing came of it");
        let wake = session.poll(now, &mut out);
        if session.phase() != PhaseName::Identifying {
            break;
        }
        now = wake.max(now + Seconds(0.001));
        if !core::mem::take(&mut out).is_empty() {
            session.receive(&answer(), now);
        }
    }
    assert_eq!(session.phase(), PhaseName::Failed);
    (session.error().unwrap().clone(), now.0 - 100.0)
}

#[test]
fn what_answers_wrongly_is_told_apart_in_time() {
    let mut chance = Pcg32::new(5, 5);
    let mut noise = move || (0..40).map(|_| chance.next_u32() as u8).collect::<Vec<u8>>();
    let text = |text: &'static str| move || text.as_bytes().to_vec();
    // A sound block without content: an acknowledgement.
    let block = wire::block::Block::new(1, &[]).as_bytes().to_vec();
    for ((error, after_s), code) in [
        (judged(Vec::new), ErrorCode::BoardSilent),
        (judged(text("echo:Unknown command: \"\"\nok\n")), ErrorCode::WrongFirmware),
        (judged(&mut noise), ErrorCode::BoardUnreadable),
        (judged(|| block.clone()), ErrorCode::WrongFirmware),
    ] {
        assert_eq!(error.code, code, "{error}");
        assert!(after_s < 6.0, "{error} after {after_s} s");
    }
}

#[test]
fn a_machine_file_for_another_board() {
    let setup = Setup::config("gpio18", "gpio99");
    // The machine itself is wired as usual.
    let mut bench = Setup::default().bench();
    bench.replace_session(&setup.config);
    bench.until("the end", 10.0, |bench| bench.session.phase() == PhaseName::Failed);
    bench.failed(ErrorCode::PinUnknown, None);
    assert!(bench.error().detail.contains("gpio99"));
}

#[test]
fn a_host_that_stalls_is_safe() {
    let mut bench = Setup { board: BoardProfile::rp2040().plain(), ..Setup::default() }.ready();
    bench.start(&squares(4));
    bench.line(14);
    bench.stalled = true;
    bench.run(8.0);
    // The board's own watch has ended it.
    assert!(bench.state().shutdown.is_some());
    assert!(bench.state().heaters.iter().all(|heater| heater.duty == 0.0));
    bench.stalled = false;
    bench.run(2.0);
    assert_ne!(bench.session.phase(), PhaseName::Ready);
    assert_eq!(bench.errors().len(), 1);
    bench.assert_all_off();
}

#[test]
fn a_short_stall_is_not_noticed() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(3));
    bench.line(14);
    bench.stalled = true;
    bench.run(1.7);
    bench.stalled = false;
    bench.job_over();
    bench.job_done();
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
}

#[test]
fn a_small_board_on_a_serial_line_prints_a_dense_file() {
    let mut bench = Setup { board: BoardProfile::stm32f103(), ..Setup::default() }.ready();
    // Short pieces at speed, forth and back, as curves are.
    let mut file = String::from(START);
    for n in 0..3000 {
        let angle = f64::from(n) * 0.05;
        let (x, y) = (75.0 + 20.0 * libm::cos(angle), 75.0 + 20.0 * libm::sin(angle));
        writeln!(file, "G1 X{x:.3} Y{y:.3} E0.04 F6000").unwrap();
    }
    bench.print(&(file + END));
    bench.job_done();
    bench.assert_all_off();
    let state = bench.state();
    assert!(state.motors.iter().all(|motor| motor.lost.0 == 0));
    assert!(bench.pulses().len() > 100_000);
}

#[test]
fn noise_on_the_wire_is_no_harm() {
    let mut bench = Setup::default().ready();
    bench.home();
    // Whatever bytes come: sound blocks with damaged contents, half blocks, nothing but noise.
    let mut state = 12345_u64;
    for _ in 0..2000 {
        let bytes: Vec<u8> = (0..40)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as u8
            })
            .collect();
        let now = bench.now();
        bench.session.receive(&bytes, now);
        bench.run(0.001);
    }
    assert_eq!(bench.session.phase(), PhaseName::Ready);
    bench.gcode("G1 X20 F6000");
    bench.assert_position(20.0, 150.0, 0.5);
}
