//! The board's clock as a function of host time: when to ask for it, and a weighted regression over the answers.
//!
//! Knows nothing of bytes or blocks. It only paces the sending and tells when things happen; the clocks of steps
//! come from the plan and the nominal frequency alone.
//!
//! Units: host time in seconds, the board's clock in ticks. Source: the manner of Klipper's clock synchronisation as
//! publicly documented (exponential weights, outliers, half the smallest round trip), with the nominal frequency as
//! a prior for the slope, so that a few early samples close together cannot tilt the line.

use units::{Clock32, Hertz, Seconds, Ticks};

/// How fast old samples lose weight: each new one counts for this part.
const DECAY: f64 = 1.0 / 30.0;
/// Samples taken in quick succession at the start.
const QUICK_SAMPLES: u32 = 8;
/// Their distance, in seconds.
const QUICK_INTERVAL_S: f64 = 0.05;
/// The distance of samples after that until the line has settled, so that a busy computer is soon done with it …
const UNSETTLED_INTERVAL_S: f64 = 0.1;
/// … and from then on, in seconds.
const INTERVAL_S: f64 = 1.0;
/// Responses are never retransmitted, so an unanswered question is asked again after this time, in seconds.
const ASK_AGAIN_S: f64 = 0.25;
/// A board that has not answered for this long, in seconds, is silent …
const SILENT_S: f64 = 5.0;
/// … if it was asked more often than this.
const SILENT_QUESTIONS: u32 = 4;
/// After so long without an answer the 32-bit clock may have wrapped unseen, in seconds.
const UPTIME_AGAIN_S: f64 = 5.0;
/// Samples further from the line than this many standard deviations are outliers …
const OUTLIER_SIGMAS: f64 = 5.0;
/// … if they are also further than this, in seconds.
const OUTLIER_S_MIN: f64 = 0.0005;
/// So many outliers in a row are no outliers: the line is wrong.
const OUTLIERS_IN_A_ROW_MAX: u32 = 4;
/// How far the line may be off a new sample and still count as settled, in seconds, besides half the round trip.
const SETTLED_ERROR_S: f64 = 0.002;
/// So many samples in a row have to be as near as that.
const SETTLED_SAMPLES: u32 = 3;
/// The line has to rest on samples over at least this long, in seconds.
const SETTLED_SPAN_S: f64 = 2.0;
/// With this many samples the line is as good as it gets, however noisy the link.
const SETTLED_SAMPLES_ALWAYS: u32 = 60;
/// The weight of the nominal frequency against the samples: the square of a sample's error (1 ms) over that of the
/// frequency's (0.1 %), in square seconds.
const PRIOR_S2: f64 = 1.0;
/// The smallest round trip is forgotten at this rate, in seconds per second.
const ROUND_TRIP_RISE: f64 = 1e-5;

/// No board runs for centuries: clocks beyond this are nonsense, and sums of clocks below it cannot overflow.
const CLOCK_MAX: u64 = 1 << 60;

/// A question to the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockRequest {
    /// `get_uptime`.
    Uptime,
    /// `get_clock`.
    Clock,
}

/// The line through the samples, relative to the first one.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The first sample.
    base_s: f64,
    base: Ticks,
    samples: u32,
    /// Means and moments, exponentially weighted. Units: seconds and ticks.
    time_mean: f64,
    clock_mean: f64,
    time_variance: f64,
    covariance: f64,
    /// Ticks a second.
    slope: f64,
    /// Mean square of the distance of new samples from the line, in square seconds.
    error_variance: f64,
    near_in_a_row: u32,
    outliers_in_a_row: u32,
    last_s: f64,
}

impl Line {
    fn new(at_s: f64, clock: Ticks, nominal: f64) -> Self {
        Self {
            base_s: at_s,
            base: clock,
            samples: 1,
            time_mean: 0.0,
            clock_mean: 0.0,
            time_variance: 0.0,
            covariance: 0.0,
            slope: nominal,
            error_variance: 0.0,
            near_in_a_row: 0,
            outliers_in_a_row: 0,
            last_s: at_s,
        }
    }

    fn relative_clock_at(&self, at_s: f64) -> f64 {
        self.clock_mean + self.slope * (at_s - self.base_s - self.time_mean)
    }

    fn clock_at(&self, at_s: f64) -> Ticks {
        // `as` saturates; a time before the board's start is its start.
        Ticks(self.base.0.saturating_add_signed(self.relative_clock_at(at_s) as i64).min(CLOCK_MAX))
    }

    fn time_of(&self, clock: Ticks) -> f64 {
        let relative = clock.0 as i128 - self.base.0 as i128;
        self.base_s + self.time_mean + (relative as f64 - self.clock_mean) / self.slope
    }

    fn add(&mut self, at_s: f64, clock: Ticks, nominal: f64) {
        let time = at_s - self.base_s;
        let relative = (clock.0 as i128 - self.base.0 as i128) as f64;
        self.samples = self.samples.saturating_add(1);
        let weight = DECAY.max(1.0 / f64::from(self.samples));
        let (time_off, clock_off) = (time - self.time_mean, relative - self.clock_mean);
        self.time_mean += weight * time_off;
        self.clock_mean += weight * clock_off;
        self.time_variance = (1.0 - weight) * (self.time_variance + weight * time_off * time_off);
        self.covariance = (1.0 - weight) * (self.covariance + weight * time_off * clock_off);
        let prior = PRIOR_S2 * weight;
        self.slope = (self.covariance + nominal * prior) / (self.time_variance + prior);
        self.last_s = at_s;
    }
}

/// Keeps host time and the board's clock together.
#[derive(Clone, Debug)]
pub struct ClockSync {
    nominal: f64,
    line: Option<Line>,
    round_trip_min: Option<f64>,
    asked_s: Option<f64>,
    answered_s: Option<f64>,
    /// Questions since the last answer, and when the first of them was asked.
    unanswered: u32,
    unanswered_since_s: f64,
    answers: u32,
}

impl ClockSync {
    /// For a board with this nominal frequency.
    pub fn new(nominal: Hertz) -> Self {
        Self {
            nominal: f64::from(nominal.0.max(1)),
            line: None,
            round_trip_min: None,
            asked_s: None,
            answered_s: None,
            unanswered: 0,
            unanswered_since_s: 0.0,
            answers: 0,
        }
    }

    /// When the next question is due.
    pub fn next_wake(&self) -> Seconds {
        let Some(asked_s) = self.asked_s else { return Seconds(f64::NEG_INFINITY) };
        let interval = match (self.unanswered, self.answers) {
            (1.., _) => ASK_AGAIN_S,
            (_, ..=QUICK_SAMPLES) => QUICK_INTERVAL_S,
            _ if !self.is_settled() => UNSETTLED_INTERVAL_S,
            _ => INTERVAL_S,
        };
        Seconds(asked_s + interval)
    }

    /// The question to ask now, if one is due.
    pub fn poll(&mut self, now: Seconds) -> Option<ClockRequest> {
        if now < self.next_wake() {
            return None;
        }
        self.asked_s = Some(now.0);
        if self.unanswered == 0 {
            self.unanswered_since_s = now.0;
        }
        self.unanswered = self.unanswered.saturating_add(1);
        let lapsed = self.answered_s.is_none_or(|answered_s| now.0 - answered_s > UPTIME_AGAIN_S);
        Some(if self.line.is_none() || lapsed { ClockRequest::Uptime } else { ClockRequest::Clock })
    }

    /// The board's answer to `get_uptime`; `sent` is when the question left, where that is known.
    pub fn uptime(&mut self, high: u32, low: Clock32, sent: Option<Seconds>, received: Seconds) {
        let clock = Ticks(u64::from(high) << 32 | u64::from(low.0));
        self.answered(received);
        if clock.0 > CLOCK_MAX {
            return;
        }
        match &self.line {
            // A first sample of unknown age still gives the high half; later ones put the rest right.
            None => self.line = Some(Line::new(sent.unwrap_or(received).0, clock, self.nominal)),
            Some(line) => {
                let predicted = line.clock_at(received.0);
                if (predicted.0.abs_diff(clock.0) as f64) > self.nominal {
                    // The board restarted, or the host slept: start again.
                    self.line = Some(Line::new(sent.unwrap_or(received).0, clock, self.nominal));
                    self.answers = 1;
                } else {
                    self.sample(clock, sent, received);
                }
            }
        }
    }

    /// The board's answer to `get_clock`; `sent` is when the question left, where that is known.
    pub fn clock(&mut self, low: Clock32, sent: Option<Seconds>, received: Seconds) {
        self.answered(received);
        let Some(line) = &self.line else { return };
        let clock = line.clock_at(received.0).nearest(low);
        self.sample(clock, sent, received);
    }

    fn answered(&mut self, received: Seconds) {
        self.unanswered = 0;
        self.answers = self.answers.saturating_add(1);
        self.answered_s = Some(received.0);
    }

    fn sample(&mut self, clock: Ticks, sent: Option<Seconds>, received: Seconds) {
        let (Some(sent), Some(line)) = (sent, &mut self.line) else { return };
        let round_trip = received.0 - sent.0;
        // A question that was never sent after its answer came, nor before the last sample: a mistake somewhere.
        if !(0.0..=SILENT_S).contains(&round_trip) || sent.0 < line.last_s {
            return;
        }
        let aged = self.round_trip_min.map(|min| min + ROUND_TRIP_RISE * (sent.0 - line.last_s));
        let shortest = aged.map_or(round_trip, |min| min.min(round_trip));
        self.round_trip_min = Some(shortest);
        let at_s = sent.0 + shortest / 2.0;
        let error_s = at_s - line.time_of(clock);
        let limit_s = (OUTLIER_SIGMAS * line.error_variance.sqrt()).max(OUTLIER_S_MIN);
        if line.samples > QUICK_SAMPLES
            && error_s.abs() > limit_s
            && line.outliers_in_a_row < OUTLIERS_IN_A_ROW_MAX
        {
            line.outliers_in_a_row += 1;
            return;
        }
        line.outliers_in_a_row = 0;
        let near = error_s.abs() <= SETTLED_ERROR_S + shortest / 2.0;
        line.near_in_a_row = if near { line.near_in_a_row.saturating_add(1) } else { 0 };
        line.error_variance +=
            (error_s * error_s - line.error_variance) * DECAY.max(1.0 / f64::from(line.samples));
        line.add(at_s, clock, self.nominal);
    }

    /// Whether the board's clock is known at all.
    pub const fn is_known(&self) -> bool {
        self.line.is_some()
    }

    /// Whether the line is good enough to move by.
    pub fn is_settled(&self) -> bool {
        self.line.as_ref().is_some_and(|line| {
            let near = line.near_in_a_row >= SETTLED_SAMPLES && line.last_s - line.base_s >= SETTLED_SPAN_S;
            line.samples > QUICK_SAMPLES && (near || line.samples > SETTLED_SAMPLES_ALWAYS)
        })
    }

    /// The board's clock at a host time, as far as is known; zero before the first answer. Later samples may move
    /// it either way.
    pub fn clock_at(&self, now: Seconds) -> Ticks {
        self.line.as_ref().map_or(Ticks(0), |line| line.clock_at(now.0))
    }

    /// The host time of a clock; zero before the first answer.
    pub fn time_of(&self, clock: Ticks) -> Seconds {
        Seconds(self.line.as_ref().map_or(0.0, |line| line.time_of(clock)))
    }

    /// The board's frequency in ticks per second of host time.
    pub fn frequency(&self) -> f64 {
        self.line.as_ref().map_or(self.nominal, |line| line.slope)
    }

    /// The frequency as a part of the nominal one: 1.0 for a perfect board.
    pub fn frequency_ratio(&self) -> f64 {
        self.frequency() / self.nominal
    }

    /// Whether the board has left more than a few questions unanswered for about five seconds.
    pub fn is_silent(&self, now: Seconds) -> bool {
        self.unanswered > SILENT_QUESTIONS && now.0 - self.unanswered_since_s >= SILENT_S
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::{Pcg32, rand_core::Rng};

    use super::*;

    const NOMINAL: Hertz = Hertz(12_000_000);

    /// A board whose crystal is off, behind a line that delays each way by 1 ms and a chance amount.
    struct Board {
        start: u64,
        frequency: f64,
        jitter_s: f64,
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
                chance: Pcg32::new(1, 2),
            }
        }

        fn clock(&self, now_s: f64) -> u64 {
            self.start + (now_s * self.frequency) as u64
        }

        fn delay_s(&mut self) -> f64 {
            0.001 + self.jitter_s * f64::from(self.chance.next_u32()) / f64::from(u32::MAX)
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
                        sync.uptime(
                            (clock >> 32) as u32,
                            Clock32(clock as u32),
                            Some(Seconds(now_s)),
                            received,
                        );
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
                        assert!(
                            error_s.abs() < 0.001,
                            "{error_s} s off at {now_s} + {ahead_s} s, ratio {ratio}"
                        );
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
        assert_eq!(sync.clock_at(Seconds(20.0)), Ticks(1000));
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
}
