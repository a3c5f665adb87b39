//! The board's clock as it is found out over good and bad lines.

use rand_pcg::{Pcg32, rand_core::Rng};

use super::*;

const NOMINAL: Hertz = Hertz(12_000_000);

/// A board whose crystal is off, behind a line that delays each way by 1 ms and a chance amount.
struct Board {
    start: u64,
    frequency: f64,
    jitter_s: f64,
    /// Held up by as much as this, but for one time in eight.
    stalls_s: f64,
    chance: Pcg32,
}

impl Board {
    fn new(frequency_ratio: f64, jitter_s: f64) -> Self {
        // The low half wraps after five seconds.
        let start = (7 << 32) - 5 * u64::from(NOMINAL.0);
        Self {
            start,
            frequency: f64::from(NOMINAL.0) * frequency_ratio,
            jitter_s,
            stalls_s: 0.0,
            chance: Pcg32::new(1, 2),
        }
    }

    fn clock(&self, now_s: f64) -> u64 {
        self.start + (now_s * self.frequency) as u64
    }

    fn delay_s(&mut self) -> f64 {
        let mut part = || f64::from(self.chance.next_u32()) / f64::from(u32::MAX);
        let stall_s = if part() < 0.125 { 0.0 } else { self.stalls_s * part() };
        0.001 + self.jitter_s * part() + stall_s
    }

    /// Asks and answers until a time.
    fn run(
        &mut self,
        sync: &mut ClockSync,
        from_s: f64,
        until_s: f64,
        mut check: impl FnMut(&Self, &ClockSync, f64),
    ) {
        let mut now_s = from_s;
        while now_s < until_s {
            let request = sync.poll(Seconds(now_s)).expect("it asks when it said it would");
            let read_s = now_s + self.delay_s();
            let received = Seconds(read_s + self.delay_s());
            let clock = self.clock(read_s);
            match request {
                ClockRequest::Uptime => {
                    sync.uptime((clock >> 32) as u32, Clock32(clock as u32), Some(Seconds(now_s)), received);
                }
                ClockRequest::Clock => sync.clock(Clock32(clock as u32), Some(Seconds(now_s)), received),
            }
            check(self, sync, received.0);
            now_s = sync.next_wake().0;
        }
    }

    fn error_s(&self, sync: &ClockSync, now_s: f64) -> f64 {
        (sync.clock_at(Seconds(now_s)).0 as f64 - self.clock(now_s) as f64) / self.frequency
    }
}

#[test]
fn once_settled_the_clock_is_known_to_a_millisecond_even_a_second_ahead_and_across_a_wrap() {
    for ratio in [1.0, 1.0001, 0.9999] {
        let mut board = Board::new(ratio, 0.0005);
        let mut sync = ClockSync::new(NOMINAL);
        let mut settled_s = f64::INFINITY;
        board.run(&mut sync, 0.0, 120.0, |board, sync, now_s| {
            if sync.is_settled() {
                settled_s = settled_s.min(now_s);
                for ahead_s in [0.0, 1.0] {
                    let error_s = board.error_s(sync, now_s + ahead_s);
                    assert!(error_s.abs() < 0.001, "{error_s} s off at {now_s} + {ahead_s} s, ratio {ratio}");
                }
            }
        });
        assert!((2.0..5.0).contains(&settled_s), "settled after {settled_s} s");
        assert!((sync.frequency_ratio() - ratio).abs() < 2e-6, "{}", sync.frequency_ratio());
    }
}

#[test]
fn a_busy_computer_whose_answers_come_late_at_random_is_done_in_seconds_too() {
    let mut board = Board::new(1.0001, 0.03);
    let mut sync = ClockSync::new(NOMINAL);
    let mut settled_s = f64::INFINITY;
    board.run(&mut sync, 0.0, 60.0, |_, sync, now_s| {
        if sync.is_settled() {
            settled_s = settled_s.min(now_s);
        }
    });
    assert!(settled_s < 12.0, "settled after {settled_s} s");
    // What delays the questions delays them all, by half of it on average.
    assert!(board.error_s(&sync, 60.0).abs() < 0.03);
}

#[test]
fn samples_with_a_long_round_trip_hardly_count() {
    // One way in eight is quick.
    for seed in 0..50 {
        let mut board = Board::new(1.0001, 0.0);
        board.chance = Pcg32::new(seed, 3);
        board.stalls_s = 0.1;
        let mut sync = ClockSync::new(NOMINAL);
        board.run(&mut sync, 0.0, 600.0, |board, sync, now_s| {
            let error_s = board.error_s(sync, now_s);
            let limit_s = if now_s < 60.0 { 0.03 } else { 0.02 };
            assert!(
                !sync.is_settled() || error_s.abs() < limit_s,
                "{error_s} s off at {now_s} s, seed {seed}"
            );
        });
        assert!(sync.is_settled());
    }
}

#[test]
fn a_clock_far_off_its_nominal_frequency_is_found_before_it_counts_as_settled() {
    let mut board = Board::new(1.05, 0.001);
    let mut sync = ClockSync::new(NOMINAL);
    board.run(&mut sync, 0.0, 200.0, |board, sync, now_s| {
        let error_s = board.error_s(sync, now_s + 1.0);
        assert!(!sync.is_settled() || error_s.abs() < 0.01, "{error_s} s off at {now_s} s");
    });
    assert!(sync.is_settled());
    assert!((sync.frequency_ratio() - 1.05).abs() < 1e-4, "{}", sync.frequency_ratio());
}

#[test]
fn times_and_clocks_are_each_others_inverse() {
    let mut board = Board::new(1.0001, 0.0);
    let mut sync = ClockSync::new(NOMINAL);
    board.run(&mut sync, 0.0, 30.0, |_, _, _| {});
    for now_s in [0.0, 29.0, 31.5, 4000.0] {
        let time = sync.time_of(sync.clock_at(Seconds(now_s)));
        assert!((time.0 - now_s).abs() < 1e-6, "{time}");
    }
}

#[test]
fn late_answers_do_not_bend_the_line() {
    let mut board = Board::new(1.0, 0.0002);
    let mut sync = ClockSync::new(NOMINAL);
    board.run(&mut sync, 0.0, 20.0, |_, _, _| {});
    let clock = board.clock(20.3);
    sync.poll(Seconds(21.0));
    sync.clock(Clock32(clock as u32), Some(Seconds(20.0)), Seconds(20.301));
    assert!(board.error_s(&sync, 21.0).abs() < 0.0005);
}

#[test]
fn answers_of_unknown_age_show_life_but_are_no_samples() {
    let mut sync = ClockSync::new(NOMINAL);
    assert!(!sync.is_known());
    sync.poll(Seconds(0.0));
    sync.uptime(1, Clock32(0), Some(Seconds(0.0)), Seconds(0.002));
    let before = sync.clock_at(Seconds(10.0));
    for at in 1..10 {
        sync.poll(Seconds(f64::from(at)));
        sync.clock(Clock32(99), None, Seconds(f64::from(at) + 0.1));
    }
    assert_eq!(sync.clock_at(Seconds(10.0)), before);
    assert!(!sync.is_silent(Seconds(14.0)));
}

#[test]
fn a_silent_board_is_noticed_after_five_seconds() {
    let mut board = Board::new(1.0, 0.0);
    let mut sync = ClockSync::new(NOMINAL);
    board.run(&mut sync, 0.0, 20.0, |_, _, _| {});
    let (mut now_s, mut questions) = (sync.next_wake().0, 0);
    let start_s = now_s;
    while !sync.is_silent(Seconds(now_s)) {
        questions += usize::from(sync.poll(Seconds(now_s)).is_some());
        now_s = sync.next_wake().0;
    }
    assert!((5.0..5.5).contains(&(now_s - start_s)), "{now_s}");
    assert!((15..30).contains(&questions), "{questions}");
    // Who has been silent so long is asked for the whole clock: the low half may have wrapped.
    assert_eq!(sync.poll(Seconds(now_s + 1.0)), Some(ClockRequest::Uptime));
}

#[test]
fn a_board_that_restarted_is_followed() {
    let mut board = Board::new(1.0, 0.0);
    let mut sync = ClockSync::new(NOMINAL);
    board.run(&mut sync, 0.0, 20.0, |_, _, _| {});
    sync.uptime(0, Clock32(1000), Some(Seconds(20.0)), Seconds(20.002));
    assert!(!sync.is_settled());
    assert_eq!(sync.clock_at(Seconds(20.001)), Ticks(1000));
}

#[test]
fn nonsense_is_survived() {
    let mut sync = ClockSync::new(Hertz(0));
    for value in [0, 1, u32::MAX / 2, u32::MAX] {
        for sent in [None, Some(Seconds(-1e300)), Some(Seconds(f64::NAN)), Some(Seconds(1e300))] {
            sync.poll(Seconds(f64::from(value)));
            sync.uptime(value, Clock32(value), sent, Seconds(1.0));
            sync.clock(Clock32(value), sent, Seconds(2.0));
            let _ = sync.time_of(sync.clock_at(Seconds(1e300)));
        }
    }
}
