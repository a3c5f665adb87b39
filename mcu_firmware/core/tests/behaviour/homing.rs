//! Endstops, triggers and the steppers that obey them.

use firmware_core::Pull;
use wire::{Command, Response, ShutdownReason};

use crate::bench::{Bench, Edge, MILLISECOND, SECOND, STEP_PIN, stepper, steps};

const STEPPER: u8 = 0;
const TRSYNC: u8 = 1;
const ENDSTOP: u8 = 2;
const SWITCH: u8 = 5;
const START: u64 = SECOND;
const SAMPLE: u32 = 180;
const REST: u32 = 3000;
const ENDSTOP_HIT: u8 = 1;
const HOST_REQUEST: u8 = 2;
const EXPIRED: u8 = 4;

const CONFIG: [Command<'static>; 3] = [
    stepper(STEPPER),
    Command::ConfigTrsync { oid: TRSYNC },
    Command::ConfigEndstop { oid: ENDSTOP, pin: SWITCH, pull_up: 1 },
];

const fn home(clock: u64, sample_count: u8) -> Command<'static> {
    Command::EndstopHome {
        oid: ENDSTOP,
        clock: clock as u32,
        sample_ticks: SAMPLE,
        sample_count,
        rest_ticks: REST,
        pin_value: 1,
        trsync_oid: TRSYNC,
        trigger_reason: ENDSTOP_HIT,
    }
}

/// Homing from [`START`] at 4000 steps/s, with the trigger to expire after `timeout`.
fn homing(timeout: u64) -> Bench {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send_all(&[
        Command::TrsyncStart {
            oid: TRSYNC,
            report_clock: START as u32,
            report_ticks: 75 * MILLISECOND as u32,
            expire_reason: EXPIRED,
        },
        Command::StepperStopOnTrigger { oid: STEPPER, trsync_oid: TRSYNC },
        Command::TrsyncSetTimeout { oid: TRSYNC, clock: (START + timeout) as u32 },
        home(START, 4),
        steps(STEPPER, START as u32, 1, 0),
        steps(STEPPER, 3000, 20_000, 0),
    ]);
    bench.run_until(START - 1);
    bench.board.sent.clear();
    bench
}

/// Reports of the trigger: armed, reason, clock.
fn reports(bench: &mut Bench) -> Vec<(bool, u8, u32)> {
    bench.pick(|response| match *response {
        Response::TrsyncState { can_trigger, trigger_reason, clock, .. } => {
            Some((can_trigger != 0, trigger_reason, clock))
        }
        _ => None,
    })
}

fn press(bench: &mut Bench, at: u64) {
    bench.board.inputs.push(Edge { at, pin: SWITCH, level: true });
}

fn release(bench: &mut Bench, at: u64) {
    bench.board.inputs.push(Edge { at, pin: SWITCH, level: false });
}

#[test]
fn a_switch_stops_the_stepper_after_equal_readings() {
    let mut bench = homing(2 * SECOND);
    let hit = START + 10 * u64::from(REST) + 1;
    press(&mut bench, hit);
    bench.run_until(START + SECOND);
    let first_reading = START + 11 * u64::from(REST);
    let fired = first_reading + 3 * u64::from(SAMPLE);
    let rises = bench.edges_of(STEP_PIN, true);
    assert!(rises.iter().all(|&at| at <= fired));
    assert_eq!(bench.edges_of(STEP_PIN, false).len(), rises.len(), "the last pulse ended");
    let states = reports(&mut bench);
    assert!(states.contains(&(false, ENDSTOP_HIT, fired as u32)), "{states:?}");
    assert_eq!(bench.position(STEPPER), -(rises.len() as i32));
    bench.send(&Command::EndstopQueryState { oid: ENDSTOP });
    let next_clock = first_reading as u32 + REST;
    assert_eq!(
        bench.said(),
        [format!("EndstopState {{ oid: {ENDSTOP}, homing: 0, next_clock: {next_clock}, pin_value: 1 }}")],
        "hosts take the first reading's clock from this"
    );
}

#[test]
fn bounce_does_not_count() {
    let mut bench = homing(2 * SECOND);
    let hit = START + 10 * u64::from(REST);
    press(&mut bench, hit);
    // Open again at the fourth reading, closed for good before the next search.
    release(&mut bench, hit + 3 * u64::from(SAMPLE));
    press(&mut bench, hit + 4 * u64::from(SAMPLE));
    bench.run_until(START + SECOND);
    let fired = hit + u64::from(REST) + 3 * u64::from(SAMPLE);
    assert!(reports(&mut bench).contains(&(false, ENDSTOP_HIT, fired as u32)));
}

#[test]
fn a_search_slower_than_its_row_of_readings_goes_on() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send_all(&[
        Command::TrsyncStart { oid: TRSYNC, report_clock: 0, report_ticks: 0, expire_reason: EXPIRED },
        Command::EndstopHome {
            oid: ENDSTOP,
            clock: 1000,
            sample_ticks: 180,
            sample_count: 4,
            rest_ticks: 100,
            pin_value: 1,
            trsync_oid: TRSYNC,
            trigger_reason: ENDSTOP_HIT,
        },
    ]);
    press(&mut bench, 1000);
    release(&mut bench, 1500);
    press(&mut bench, 5000);
    bench.run_until(SECOND);
    assert_eq!(bench.shutdown(), None);
    // Readings at 1000, 1180, 1360, 1540 (open), then every 100 ticks: 1640 … 5040, and three more.
    assert_eq!(reports(&mut bench), [(false, ENDSTOP_HIT, 5040 + 3 * 180)]);
}

#[test]
fn a_silent_host_stops_the_stepper() {
    let mut bench = homing(250 * MILLISECOND);
    bench.run_until(START + SECOND);
    let fired = START + 250 * MILLISECOND;
    assert!(bench.edges_of(STEP_PIN, true).iter().all(|&at| at <= fired));
    let states = reports(&mut bench);
    let expired = states.iter().filter(|state| state.1 == EXPIRED).count();
    assert!(states.contains(&(false, EXPIRED, fired as u32)) && expired > 5, "reported again and again");
    bench.send(&Command::TrsyncTrigger { oid: TRSYNC, reason: HOST_REQUEST });
    assert_eq!(reports(&mut bench), [(false, EXPIRED, states.last().unwrap().2)], "the first reason stays");
    bench.run_for(SECOND);
    assert_eq!(reports(&mut bench), [], "the host knows now");
}

#[test]
fn a_live_host_keeps_it_moving_and_reports_come_in_time() {
    let mut bench = homing(250 * MILLISECOND);
    let mut seen = Vec::new();
    while bench.board.now < START + SECOND {
        bench.run_for(100 * MILLISECOND);
        let clock = (bench.board.now + 250 * MILLISECOND) as u32;
        bench.send(&Command::TrsyncSetTimeout { oid: TRSYNC, clock });
        seen.extend(reports(&mut bench));
    }
    let period = 75 * MILLISECOND as u32;
    let expected: Vec<_> = (0..seen.len() as u32).map(|k| (true, 0, START as u32 + k * period)).collect();
    assert_eq!(seen, expected);
    assert!(seen.len() >= 13);
    bench.send(&Command::TrsyncTrigger { oid: TRSYNC, reason: HOST_REQUEST });
    let stopped = bench.edges_of(STEP_PIN, true).len();
    assert_eq!(reports(&mut bench), [(false, HOST_REQUEST, bench.board.now as u32)]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true).len(), stopped);
}

#[test]
fn ending_the_search_ends_the_time_out_but_not_the_move() {
    let mut bench = homing(250 * MILLISECOND);
    bench.run_for(100 * MILLISECOND);
    bench.send(&home(0, 0));
    press(&mut bench, 0);
    bench.run_for(10 * SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true).len(), 20_001);
    assert!(reports(&mut bench).iter().all(|state| state.0), "still armed for the host");
}

#[test]
fn after_a_stop_rows_are_ignored_until_the_clock_is_reset() {
    let mut bench = homing(250 * MILLISECOND);
    bench.run_until(START + SECOND);
    let position = bench.position(STEPPER);
    for _ in 0..1000 {
        bench.send(&steps(STEPPER, 100, 1, 0));
    }
    bench.run_for(SECOND);
    assert_eq!(bench.position(STEPPER), position);
    let clock = bench.board.now as u32;
    bench.send_all(&[
        Command::SetNextStepDir { oid: STEPPER, dir: 1 },
        Command::ResetStepClock { oid: STEPPER, clock },
        steps(STEPPER, 1000, 10, 0),
    ]);
    bench.run_for(SECOND);
    assert_eq!(bench.position(STEPPER), position + 10);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_trigger_armed_anew_frees_its_steppers() {
    let mut bench = homing(250 * MILLISECOND);
    let start =
        Command::TrsyncStart { oid: TRSYNC, report_clock: 0, report_ticks: 0, expire_reason: EXPIRED };
    bench.send_all(&[start, Command::TrsyncTrigger { oid: TRSYNC, reason: HOST_REQUEST }]);
    bench.run_for(10 * SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true).len(), 20_001);
}

#[test]
fn obeying_a_trigger_that_has_fired_stops_at_once() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send_all(&[
        steps(STEPPER, 1000, 1000, 0),
        Command::StepperStopOnTrigger { oid: STEPPER, trsync_oid: TRSYNC },
    ]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true), [0_u64; 0]);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_time_out_for_a_trigger_that_has_fired_is_no_fault() {
    let mut bench = homing(250 * MILLISECOND);
    bench.run_until(START + SECOND);
    bench.send(&Command::TrsyncSetTimeout { oid: TRSYNC, clock: 0 });
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn homing_works_across_the_wrap() {
    let start = (1_u64 << 32) + 500;
    let mut bench = Bench::configured(start - SECOND, &CONFIG);
    bench.send_all(&[
        Command::TrsyncStart {
            oid: TRSYNC,
            report_clock: start as u32,
            report_ticks: 900_000,
            expire_reason: EXPIRED,
        },
        Command::StepperStopOnTrigger { oid: STEPPER, trsync_oid: TRSYNC },
        Command::TrsyncSetTimeout { oid: TRSYNC, clock: (start + SECOND) as u32 },
        home(start, 4),
        Command::ResetStepClock { oid: STEPPER, clock: (start - 10_000) as u32 },
        steps(STEPPER, 3000, 1000, 0),
    ]);
    press(&mut bench, start);
    bench.run_until(start + 2 * SECOND);
    let fired = start + 3 * u64::from(SAMPLE);
    assert!(reports(&mut bench).contains(&(false, ENDSTOP_HIT, fired as u32)));
    assert_eq!(bench.position(STEPPER), -3, "steps at -7000, -4000, -1000 of the start");
}

#[test]
fn a_search_that_makes_no_sense_is_refused() {
    for (sample_ticks, rest_ticks) in [(180, 0), (0, 3000)] {
        let mut bench = Bench::configured(0, &CONFIG);
        bench.send(&Command::EndstopHome {
            oid: ENDSTOP,
            clock: 1000,
            sample_ticks,
            sample_count: 4,
            rest_ticks,
            pin_value: 1,
            trsync_oid: TRSYNC,
            trigger_reason: 1,
        });
        assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidEndstop));
    }
}

#[test]
fn a_switch_may_have_a_resistor_either_way_or_none() {
    let config = |oid, pull_up| Command::ConfigEndstop { oid, pin: 10 + oid, pull_up };
    let bench = Bench::configured(0, &[config(0, 1), config(1, 0), config(2, -1)]);
    assert_eq!(bench.board.pulls, [(10, Pull::Up), (11, Pull::Floating), (12, Pull::Down)]);
}
