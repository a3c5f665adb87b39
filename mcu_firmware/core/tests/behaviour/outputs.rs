//! Digital outputs: queued changes, software PWM and the time within which a host has to speak.

use wire::{Command, ShutdownReason};

use crate::bench::{Bench, MILLISECOND, SECOND, output};

const PIN: u8 = 17;
const LIMIT: u32 = 3 * SECOND as u32;

fn queue(clock: u64, on_ticks: u32) -> Command<'static> {
    Command::QueueDigitalOut { oid: 0, clock: clock as u32, on_ticks }
}

fn pwm(max_duration: u32, cycle_ticks: u32) -> Bench {
    Bench::configured(0, &[output(0, max_duration), Command::SetDigitalOutPwmCycle { oid: 0, cycle_ticks }])
}

fn pulses(bench: &Bench) -> Vec<(u64, u64)> {
    bench.edges_of(PIN, true).into_iter().zip(bench.edges_of(PIN, false)).collect()
}

#[test]
fn changes_happen_at_their_clocks() {
    let mut bench = Bench::configured(0, &[output(0, 0)]);
    bench.send_all(&[queue(1000, 1), queue(3000, 0), queue(5000, 1)]);
    bench.run_for(SECOND);
    assert_eq!(bench.edges_of(PIN, true), [1000, 5000]);
    assert_eq!(bench.edges_of(PIN, false), [3000]);
}

#[test]
fn pulse_width_modulation_keeps_time() {
    let mut bench = pwm(0, 1000);
    bench.send_all(&[queue(10_000, 250), queue(13_500, 900), queue(15_000, 1000), queue(20_000, 0)]);
    bench.run_for(SECOND);
    let expected = [
        (10_000, 10_250),
        (11_000, 11_250),
        (12_000, 12_250),
        // A new width begins a new cycle; a full one is a steady level.
        (13_000, 13_250),
        (13_500, 14_400),
        (14_500, 20_000),
    ];
    assert_eq!(pulses(&bench), expected);
}

#[test]
fn a_change_may_come_while_the_output_is_modulated() {
    let mut bench = pwm(0, 1000);
    bench.send(&queue(10_000, 500));
    for (arrives, due) in [(20_100, 20_200), (20_600, 22_000)] {
        bench.run_until(arrives);
        bench.send(&queue(due, 100));
    }
    bench.run_until(23_050);
    let last: Vec<_> = pulses(&bench).into_iter().skip_while(|pulse| pulse.0 < 20_000).collect();
    assert_eq!(last, [(20_000, 20_300), (21_200, 21_300), (22_000, 22_100)]);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_steady_width_survives_the_wrap() {
    let start = (1_u64 << 32) - 5000;
    let mut bench = Bench::configured(
        start,
        &[output(0, 0), Command::SetDigitalOutPwmCycle { oid: 0, cycle_ticks: 1000 }],
    );
    bench.send(&queue(start + 1000, 300));
    bench.run_for(10_500);
    let expected: Vec<_> = (1..=10).map(|k| (start + k * 1000, start + k * 1000 + 300)).collect();
    assert_eq!(pulses(&bench), expected);
}

#[test]
fn a_host_that_falls_silent_loses_its_heater() {
    for (cycle, on_ticks) in [(0, 1), (1_200_000, 400_000), (1_200_000, 1_200_000)] {
        let mut bench = pwm(LIMIT, cycle);
        bench.send(&queue(SECOND, on_ticks));
        bench.run_until(SECOND + u64::from(LIMIT) - 1);
        assert_eq!(bench.shutdown(), None);
        bench.run_for(1);
        assert_eq!(bench.shutdown(), Some(ShutdownReason::MissedOutput));
        assert!(!bench.board.levels[usize::from(PIN)]);
        bench.run_for(SECOND);
        assert!(!bench.board.levels[usize::from(PIN)]);
    }
}

#[test]
fn a_host_that_speaks_keeps_its_heater() {
    let mut bench = pwm(LIMIT, 1_200_000);
    for round in 1..20_u64 {
        bench.send(&queue(round * SECOND * 5 / 2, 600_000));
        bench.run_until(round * SECOND * 5 / 2 + SECOND);
    }
    assert_eq!(bench.shutdown(), None);
    bench.send(&queue(bench.board.now + MILLISECOND, 0));
    bench.run_for(100 * SECOND);
    assert_eq!(bench.shutdown(), None, "off needs no refreshing");
}

#[test]
fn a_change_beyond_the_limit_is_refused() {
    let mut bench = pwm(LIMIT, 0);
    bench.send(&queue(SECOND, 1));
    bench.run_until(2 * SECOND);
    bench.send(&queue(SECOND + u64::from(LIMIT) + 1, 1));
    assert_eq!(bench.shutdown(), Some(ShutdownReason::OutputTooFarAhead));
    let mut bench = pwm(LIMIT, 0);
    bench.send_all(&[queue(SECOND, 1), queue(5 * SECOND, 1)]);
    bench.run_until(SECOND);
    assert_eq!(
        bench.shutdown(),
        Some(ShutdownReason::OutputTooFarAhead),
        "seen when the first is carried out"
    );
}

#[test]
fn an_update_acts_now_and_is_limited_too() {
    let mut bench = pwm(LIMIT, 1000);
    bench.send(&queue(SECOND, 400));
    bench.run_until(SECOND + 100);
    bench.send(&Command::UpdateDigitalOut { oid: 0, value: 1 });
    bench.run_until(SECOND + 2000);
    assert_eq!(bench.edges_of(PIN, true), [SECOND], "no longer modulated");
    bench.run_until(SECOND + 100 + u64::from(LIMIT));
    assert_eq!(bench.shutdown(), Some(ShutdownReason::MissedOutput));
    let mut bench = pwm(LIMIT, 0);
    bench.send_all(&[queue(SECOND, 1), Command::UpdateDigitalOut { oid: 0, value: 0 }]);
    bench.run_for(10 * SECOND);
    assert_eq!(bench.board.edges, [], "what was queued is dropped");
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn changes_out_of_order_or_in_the_past_are_too_close() {
    for commands in [[queue(2000, 1), queue(1999, 1)], [queue(5000, 1), queue((1 << 31) + 2000, 1)]] {
        let mut bench = pwm(0, 0);
        bench.run_for(1000);
        bench.send_all(&commands);
        assert_eq!(bench.shutdown(), Some(ShutdownReason::TimerTooClose));
    }
    let mut bench = pwm(0, 0);
    bench.run_for(1000);
    bench.send(&queue(999, 1));
    assert_eq!(bench.shutdown(), Some(ShutdownReason::TimerTooClose));
}

#[test]
fn the_cycle_only_changes_with_an_empty_queue() {
    let cycle = |cycle_ticks| Command::SetDigitalOutPwmCycle { oid: 0, cycle_ticks };
    let mut bench = pwm(0, 1000);
    bench.send_all(&[queue(1000, 1), cycle(2000)]);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidPwm));
    let mut bench = pwm(0, 1000);
    bench.send(&cycle(1 << 31));
    assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidPwm));
}

#[test]
fn timers_that_never_let_up_leave_time_for_the_host() {
    // A look at the clock takes 100 ticks: edges 100 ticks apart are due as soon as the one before has been made.
    let mut bench = pwm(0, 200);
    bench.send(&queue(1000, 100));
    bench.board.ticks_per_read = 100;
    for _ in 0..1000 {
        let entered = bench.board.now;
        let next = u64::from(bench.firmware.run_timers(&mut bench.board).0);
        assert!(bench.board.now - entered <= MILLISECOND / 5, "the main loop was kept waiting");
        assert!(next > bench.board.now, "and then had no time");
        bench.board.now = next;
    }
    assert_eq!(bench.shutdown(), None);
    bench.send(&Command::EmergencyStop {});
    assert!(!bench.board.levels[usize::from(PIN)]);
}
