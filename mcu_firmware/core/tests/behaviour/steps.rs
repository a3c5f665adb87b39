//! Step and direction pins: every edge at its tick.

use proptest::prelude::*;
use units::Clock32;
use wire::{Command, ShutdownReason};

use crate::bench::{Bench, DIR_PIN, PULSE, SECOND, STEP_PIN, stepper, steps};

const PULSE_TICKS: u64 = PULSE as u64;

fn bench_at(now: u64) -> Bench {
    let mut bench = Bench::configured(now, &[stepper(0)]);
    bench.send(&Command::ResetStepClock { oid: 0, clock: now as u32 });
    bench
}

#[test]
fn edges_come_at_their_ticks_and_pulses_have_their_width() {
    let mut bench = bench_at(0);
    bench.send_all(&[steps(0, 1000, 3, 0), steps(0, 500, 4, -50)]);
    bench.run_for(SECOND);
    let rises = bench.edges_of(STEP_PIN, true);
    assert_eq!(rises, [1000, 2000, 3000, 3500, 3950, 4350, 4700]);
    let falls: Vec<u64> = rises.iter().map(|at| at + PULSE_TICKS).collect();
    assert_eq!(bench.edges_of(STEP_PIN, false), falls);
    assert_eq!(bench.position(0), -7);
}

#[test]
fn steps_cross_the_wrap_of_the_clock() {
    let start = (1 << 32) - 2500;
    let mut bench = bench_at(start);
    bench.send(&steps(0, 1000, 5, 0));
    bench.run_for(SECOND);
    let expected: Vec<u64> = (1..=5).map(|k| start + k * 1000).collect();
    assert_eq!(bench.edges_of(STEP_PIN, true), expected);
}

#[test]
fn an_inverted_step_pin_idles_high() {
    let inverted = Command::ConfigStepper {
        oid: 0,
        step_pin: STEP_PIN,
        dir_pin: DIR_PIN,
        invert_step: 1,
        step_pulse_ticks: PULSE,
    };
    let mut bench = Bench::configured(0, &[inverted]);
    assert!(bench.board.levels[usize::from(STEP_PIN)]);
    bench.send(&steps(0, 1000, 1, 0));
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, false), [1000]);
    assert_eq!(bench.edges_of(STEP_PIN, true), [1000 + PULSE_TICKS]);
}

#[test]
fn the_direction_changes_between_the_pulses_with_time_to_settle() {
    let mut bench = bench_at(0);
    bench.send_all(&[
        Command::SetNextStepDir { oid: 0, dir: 1 },
        steps(0, 1000, 2, 0),
        Command::SetNextStepDir { oid: 0, dir: 0 },
        // Sooner than the pulse before it ends: put off, not lost.
        steps(0, 10, 1, 0),
        steps(0, 1000, 1, 0),
    ]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(DIR_PIN, true), [1000 - PULSE_TICKS], "as late as it may be");
    assert_eq!(bench.edges_of(DIR_PIN, false), [2000 + PULSE_TICKS], "when the last pulse has ended");
    assert_eq!(bench.edges_of(STEP_PIN, true), [1000, 2000, 2000 + 2 * PULSE_TICKS, 3010]);
    assert_eq!(bench.position(0), 0);
}

#[test]
fn when_rows_arrive_changes_no_edge() {
    let edges = |arrival: u64| {
        let mut bench = bench_at(0);
        bench.send_all(&[Command::SetNextStepDir { oid: 0, dir: 1 }, steps(0, 1000, 2, 0)]);
        bench.run_for(arrival);
        bench.send_all(&[Command::SetNextStepDir { oid: 0, dir: 0 }, steps(0, 5000, 3, -7)]);
        bench.run_for(SECOND);
        [STEP_PIN, DIR_PIN].map(|pin| [true, false].map(|level| bench.edges_of(pin, level)))
    };
    let at_once = edges(0);
    for arrival in [500, 1000, 1500, 2000, 2500, 4000, 6500] {
        assert_eq!(edges(arrival), at_once, "the second row arrives at {arrival}");
    }
}

#[test]
fn a_step_right_after_a_change_of_direction_waits() {
    let mut bench = bench_at(100);
    bench.send_all(&[Command::SetNextStepDir { oid: 0, dir: 1 }, steps(0, 1, 1, 0), steps(0, 99, 1, 0)]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true), [100 + PULSE_TICKS, 200], "the second keeps its time");
}

#[test]
fn a_row_for_an_idle_stepper_counts_from_its_last_step() {
    let mut bench = bench_at(0);
    bench.send(&steps(0, 1000, 2, 0));
    bench.run_until(500_000);
    bench.send(&steps(0, 598_000, 1, 0));
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true), [1000, 2000, 600_000]);
}

#[test]
fn an_interval_modulo_the_clock_reaches_a_long_idle_stepper() {
    let mut bench = bench_at(0);
    bench.send(&steps(0, 1000, 1, 0));
    let late = 3 * (1 << 32) + 77;
    bench.run_until(late - SECOND);
    let interval = Clock32(late as u32).since(Clock32(1000)) as u32;
    bench.send(&steps(0, interval, 1, 0));
    bench.run_until(late + SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true), [1000, late]);
}

#[test]
fn the_step_clock_is_only_reset_at_rest() {
    let mut bench = bench_at(0);
    bench.send_all(&[steps(0, 1000, 1, 0), Command::ResetStepClock { oid: 0, clock: 5 }]);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::StepperActive));
    let mut bench = bench_at(0);
    bench.send(&steps(0, 1000, 1, 0));
    bench.run_until(1010);
    bench.send_all(&[Command::ResetStepClock { oid: 0, clock: 1020 }, steps(0, 1000, 1, 0)]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(STEP_PIN, true), [1000, 2020], "only the end of the pulse was left");
    assert_eq!(bench.edges_of(STEP_PIN, false), [1000 + PULSE_TICKS, 2020 + PULSE_TICKS]);
}

#[test]
fn a_chip_that_cannot_keep_up_for_a_millisecond_shuts_down() {
    // Intervals below what the pulses need fall behind by 38 ticks a step: a millisecond after 316 steps.
    let mut bench = bench_at(0);
    bench.send(&steps(0, 10, 300, 0));
    bench.run_for(SECOND);
    assert_eq!(bench.shutdown(), None);
    assert_eq!(bench.edges_of(STEP_PIN, true).len(), 300, "late, but none lost");
    let mut bench = bench_at(0);
    bench.send(&steps(0, 10, 400, 0));
    bench.run_for(SECOND);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::StepperTooFarInPast));
}

#[test]
fn many_steppers_keep_their_ticks() {
    let config: Vec<Command<'_>> = (0..4)
        .map(|oid| Command::ConfigStepper {
            oid,
            step_pin: 2 * oid,
            dir_pin: 2 * oid + 1,
            invert_step: 0,
            step_pulse_ticks: PULSE,
        })
        .collect();
    let mut bench = Bench::configured(0, &config);
    for oid in 0..4 {
        bench.send(&steps(oid, 600 + u32::from(oid), 1000, 0));
    }
    bench.run_for(SECOND);
    for oid in 0..4 {
        let expected: Vec<u64> = (1..=1000).map(|k| k * (600 + u64::from(oid))).collect();
        assert_eq!(bench.edges_of(2 * oid, true), expected);
    }
}

proptest! {
    #[test]
    fn every_row_is_executed_to_the_tick(
        start: u32,
        rows in prop::collection::vec((60_u32..100_000, 1_u16..40, -200_i16..200, any::<bool>()), 1..12),
    ) {
        let start = u64::from(start);
        let mut bench = bench_at(start);
        let (mut clock, mut position, mut expected) = (start, 0, vec![]);
        for &(interval, count, add, forward) in &rows {
            let last = i64::from(interval) + i64::from(add) * i64::from(count - 1);
            if last < i64::from(2 * PULSE) {
                continue;
            }
            let mut interval_now = i64::from(interval);
            for _ in 0..count {
                clock += interval_now as u64;
                interval_now += i64::from(add);
                expected.push(clock);
                position += if forward { 1 } else { -1 };
            }
            bench.send_all(&[
                Command::SetNextStepDir { oid: 0, dir: forward.into() },
                steps(0, interval, count, add),
            ]);
        }
        bench.run_until(clock + SECOND);
        prop_assert_eq!(bench.shutdown(), None);
        prop_assert_eq!(bench.edges_of(STEP_PIN, true), expected);
        prop_assert_eq!(bench.position(0), position);
    }
}
