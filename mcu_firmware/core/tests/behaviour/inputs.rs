//! Analog inputs: sums, reports and ranges.

use wire::{Command, Response, ShutdownReason};

use crate::bench::{Bench, MILLISECOND, SECOND};

const PIN: usize = 26;
const CONFIG: [Command<'static>; 1] = [Command::ConfigAnalogIn { oid: 0, pin: PIN as u32 }];

fn query(clock: u64, bytes_per_report: u8, range: (u16, u16), range_check_count: u8) -> Command<'static> {
    Command::QueryAnalogIn {
        oid: 0,
        clock: clock as u32,
        sample_ticks: MILLISECOND as u32,
        sample_count: 8,
        rest_ticks: 300 * MILLISECOND as u32,
        bytes_per_report,
        min_value: range.0,
        max_value: range.1,
        range_check_count,
    }
}

fn reports(bench: &mut Bench) -> Vec<(u32, Vec<u8>)> {
    bench.pick(|response| match *response {
        Response::AnalogInState { next_clock, values, .. } => Some((next_clock, values.to_vec())),
        _ => None,
    })
}

#[test]
fn sums_are_reported_with_the_clock_of_the_next_group() {
    for conversion_ticks in [0, 500] {
        let mut bench = Bench::configured(0, &CONFIG);
        bench.board.analog[PIN] = 0x123;
        bench.board.conversion_ticks = conversion_ticks;
        bench.send(&query(SECOND, 2, (0, 0x7fff), 1));
        bench.run_until(SECOND + 700 * MILLISECOND);
        let sum = vec![0x18, 0x09];
        let clocks = [300, 600, 900].map(|at| (SECOND + at * MILLISECOND) as u32);
        assert_eq!(reports(&mut bench), clocks.map(|clock| (clock, sum.clone())));
    }
}

#[test]
fn several_sums_share_a_report() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send(&query(SECOND, 6, (0, u16::MAX), 1));
    for value in [1, 2, 3] {
        bench.board.analog[PIN] = value;
        bench.run_until(SECOND + (u64::from(value) * 300 - 1) * MILLISECOND);
    }
    let clock = (SECOND + 900 * MILLISECOND) as u32;
    assert_eq!(reports(&mut bench), [(clock, vec![8, 0, 16, 0, 24, 0])]);
}

#[test]
fn a_report_without_room_is_dropped_and_the_next_is_whole() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send(&query(SECOND, 2, (0, u16::MAX), 1));
    bench.run_until(SECOND - 1);
    bench.board.has_room = false;
    bench.run_until(SECOND + 200 * MILLISECOND);
    bench.board.has_room = true;
    bench.board.sent.clear();
    bench.run_until(SECOND + 500 * MILLISECOND);
    assert_eq!(reports(&mut bench).iter().map(|report| report.1.len()).collect::<Vec<_>>(), [2]);
}

#[test]
fn a_main_loop_that_is_late_loses_the_old_sum_and_not_the_board() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send(&query(SECOND, 4, (0, u16::MAX), 1));
    // Timers run, tasks do not.
    while bench.board.now < 4 * SECOND {
        let next = bench.firmware.run_timers(&mut bench.board);
        bench.board.now = u64::from(next.0);
    }
    bench.firmware.run_tasks(&mut bench.board);
    assert_eq!(reports(&mut bench).len(), 1);
}

#[test]
fn the_range_is_guarded_by_the_board() {
    for value in [100, 4000] {
        let mut bench = Bench::configured(0, &CONFIG);
        bench.send(&query(SECOND, 2, (1290, 30_000), 4));
        bench.run_until(SECOND + 500 * MILLISECOND);
        bench.board.analog[PIN] = value;
        // The third and fourth groups are out of range, the fifth is not: the count begins anew.
        bench.run_until(SECOND + 1100 * MILLISECOND);
        bench.board.analog[PIN] = 2000;
        bench.run_until(SECOND + 1300 * MILLISECOND);
        bench.board.analog[PIN] = value;
        bench.run_until(SECOND + (1500 + 3 * 300 - 1) * MILLISECOND);
        assert_eq!(bench.shutdown(), None, "three in a row");
        bench.run_for(100 * MILLISECOND);
        assert_eq!(bench.shutdown(), Some(ShutdownReason::AdcOutOfRange), "four in a row");
    }
}

#[test]
fn a_sum_that_overflows_is_not_mistaken_for_a_small_one() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.board.analog[PIN] = 0x2000;
    bench.send(&query(SECOND, 2, (0, 1000), 1));
    bench.run_until(2 * SECOND);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::AdcOutOfRange));
}

#[test]
fn sampling_can_be_stopped_and_started_again() {
    let mut bench = Bench::configured(0, &CONFIG);
    bench.send(&query(SECOND, 2, (0, u16::MAX), 1));
    bench.run_until(SECOND + 3 * MILLISECOND);
    bench.send(&Command::QueryAnalogIn {
        oid: 0,
        clock: 0,
        sample_ticks: 0,
        sample_count: 0,
        rest_ticks: 0,
        bytes_per_report: 0,
        min_value: 0,
        max_value: 0,
        range_check_count: 0,
    });
    bench.run_until(3 * SECOND);
    assert_eq!(reports(&mut bench), []);
    bench.send(&query(4 * SECOND, 2, (0, u16::MAX), 1));
    bench.run_until(4 * SECOND + 10 * MILLISECOND);
    assert_eq!(reports(&mut bench).len(), 1);
}

#[test]
fn sampling_that_does_not_fit_is_refused() {
    let refused = |sample_ticks, sample_count, rest_ticks, bytes_per_report| {
        let mut bench = Bench::configured(0, &CONFIG);
        bench.send(&Command::QueryAnalogIn {
            oid: 0,
            clock: 1000,
            sample_ticks,
            sample_count,
            rest_ticks,
            bytes_per_report,
            min_value: 0,
            max_value: 1,
            range_check_count: 1,
        });
        bench.shutdown() == Some(ShutdownReason::InvalidAdcTiming)
    };
    assert!(refused(1000, 8, 7000, 2), "the group would take longer than its period");
    assert!(!refused(1000, 8, 7001, 2));
    assert!(refused(0, 1, 0, 2), "no period");
    assert!(refused(u32::MAX, 255, u32::MAX, 2));
    for bytes in [0, 1, 3, 34] {
        assert!(refused(1000, 8, 100_000, bytes), "{bytes} bytes a report");
    }
}
