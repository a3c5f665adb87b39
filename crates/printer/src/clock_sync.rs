//! The board's clock as a function of host time: when to ask for it, and a weighted regression over the answers.
//!
//! Knows nothing of bytes or blocks. It only paces the sending and tells when things happen; the clocks of steps
//! come from the plan and the nominal frequency alone.
//!
//! Units: host time in seconds, the board's clock in ticks. Source: the manner of Klipper's clock synchronisation as
//! publicly documented (exponential weights, outliers), with the nominal frequency as a prior for the slope, so that a
//! few early samples close together cannot tilt the line. When the board read its clock is known to half the round trip,
//! either way; so samples count by its inverse square, and those that a slow line delayed hardly do (RFC 5905 takes the
//! sample with the shortest).

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
/// Samples with a longer round trip than this count for less, in seconds.
const ROUND_TRIP_GOOD_S: f64 = 0.003;
/// The shortest round trip is forgotten at this rate, half of it in seconds per second.
const DOUBT_RISE: f64 = 5e-6;

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
    /// The samples' weights together; one of a good sample that has just come is 1.
    weight: f64,
    /// Means and moments, weighted, and exponentially by age. Units: seconds and ticks.
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
    fn new(reading: Reading, clock: Ticks, nominal: f64) -> Self {
        Self {
            base_s: reading.at_s,
            base: clock,
            samples: 1,
            weight: reading.weight,
            time_mean: 0.0,
            clock_mean: 0.0,
            time_variance: 0.0,
            covariance: 0.0,
            slope: nominal,
            error_variance: 0.0,
            near_in_a_row: 0,
            outliers_in_a_row: 0,
            last_s: reading.sent_s,
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

    fn add(&mut self, reading: Reading, clock: Ticks, nominal: f64) {
        let time = reading.at_s - self.base_s;
        let relative = (clock.0 as i128 - self.base.0 as i128) as f64;
        self.samples = self.samples.saturating_add(1);
        self.weight += reading.weight - DECAY * self.weight;
        let part = reading.weight / self.weight;
        let (time_off, clock_off) = (time - self.time_mean, relative - self.clock_mean);
        self.time_mean += part * time_off;
        self.clock_mean += part * clock_off;
        self.time_variance = (1.0 - part) * (self.time_variance + part * time_off * time_off);
        self.covariance = (1.0 - part) * (self.covariance + part * time_off * clock_off);
        let prior = PRIOR_S2 / self.weight;
        self.slope = (self.covariance + nominal * prior) / (self.time_variance + prior);
        self.last_s = reading.sent_s;
    }
}

/// When the board read its clock.
#[derive(Clone, Copy, Debug)]
struct Reading {
    sent_s: f64,
    /// In the middle of the round trip.
    at_s: f64,
    /// How far from that it may have been.
    doubt_s: f64,
    /// 1 where that is little.
    weight: f64,
}

impl Reading {
    /// From when the question was sent and its answer came; nothing where that cannot have been.
    fn new(sent: Option<Seconds>, received: Seconds) -> Option<Self> {
        let sent = sent?;
        let round_trip_s = received.0 - sent.0;
        let excess = (round_trip_s / ROUND_TRIP_GOOD_S).max(1.0);
        (0.0..=SILENT_S).contains(&round_trip_s).then(|| Self {
            sent_s: sent.0,
            at_s: sent.0 + 0.5 * round_trip_s,
            doubt_s: 0.5 * round_trip_s,
            weight: 1.0 / (excess * excess),
        })
    }

    /// Some time before.
    const fn before(received: Seconds) -> Self {
        Self { sent_s: received.0, at_s: received.0, doubt_s: SILENT_S, weight: 1e-6 }
    }
}

/// Keeps host time and the board's clock together.
#[derive(Clone, Debug)]
pub struct ClockSync {
    nominal: f64,
    line: Option<Line>,
    /// Half the shortest round trip.
    doubt_s_min: Option<f64>,
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
            doubt_s_min: None,
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
        let reading = Reading::new(sent, received).unwrap_or(Reading::before(received));
        match &self.line {
            // A first sample of unknown age still gives the high half; later ones put the rest right.
            None => self.line = Some(Line::new(reading, clock, self.nominal)),
            Some(line) => {
                let predicted = line.clock_at(received.0);
                if (predicted.0.abs_diff(clock.0) as f64) > self.nominal {
                    // The board restarted, or the host slept: start again.
                    self.line = Some(Line::new(reading, clock, self.nominal));
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
        let (Some(reading), Some(line)) = (Reading::new(sent, received), &mut self.line) else { return };
        // A question that was sent before the last sample: a mistake somewhere.
        if reading.sent_s < line.last_s {
            return;
        }
        let aged = self.doubt_s_min.map(|min| min + DOUBT_RISE * (reading.sent_s - line.last_s));
        let least_s = aged.map_or(reading.doubt_s, |min| min.min(reading.doubt_s));
        self.doubt_s_min = Some(least_s);
        let error_s = (reading.at_s - line.time_of(clock)).abs();
        // What the line's delay does not explain.
        let strange_s = (error_s - (reading.doubt_s - least_s)).max(0.0);
        let limit_s = (OUTLIER_SIGMAS * line.error_variance.sqrt()).max(OUTLIER_S_MIN);
        if line.samples > QUICK_SAMPLES
            && strange_s > limit_s
            && line.outliers_in_a_row < OUTLIERS_IN_A_ROW_MAX
        {
            line.outliers_in_a_row += 1;
            return;
        }
        line.outliers_in_a_row = 0;
        let near = error_s <= SETTLED_ERROR_S + least_s;
        line.near_in_a_row = if near { line.near_in_a_row.saturating_add(1) } else { 0 };
        line.add(reading, clock, self.nominal);
        line.error_variance += (strange_s * strange_s - line.error_variance) * reading.weight / line.weight;
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
mod tests;
