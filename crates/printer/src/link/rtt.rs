//! How long the board takes to answer and how many blocks get lost: when to send again, how much at once.
//!
//! The retransmission time-out is that of RFC 6298. Units: seconds, blocks, bytes.

use wire::block::PAYLOAD_BYTES_MAX;

use super::WINDOW_BLOCKS_MAX;

/// The shortest retransmission time-out, in seconds.
pub(super) const RTO_S_MIN: f64 = 0.025;
/// The longest, in seconds.
pub(super) const RTO_S_MAX: f64 = 5.0;
/// Doubling ends here, in seconds: nobody else waits for the line to a board, so there is nothing to be gained by
/// holding back further, and on a line that garbles nearly everything each attempt counts.
const RTO_S_DOUBLED_MAX: f64 = 0.5;
/// Doublings beyond this exceed [`RTO_S_DOUBLED_MAX`] anyway.
const BACKOFF_MAX: u32 = 5;

/// Round-trip times and the time-out that follows from them.
#[derive(Clone, Debug)]
pub(super) struct RoundTrip {
    smoothed: Option<f64>,
    variation: f64,
    /// The shortest of late.
    floor: f64,
    backoff: u32,
}

impl RoundTrip {
    pub(super) const fn new() -> Self {
        Self { smoothed: None, variation: 0.0, floor: 0.0, backoff: 0 }
    }

    /// A block that was sent once was answered after `rtt` seconds (RFC 6298, 2.2 and 2.3).
    pub(super) fn sample(&mut self, rtt: f64) {
        const ALPHA: f64 = 1.0 / 8.0;
        const BETA: f64 = 1.0 / 4.0;
        const FLOOR_RISE: f64 = 1.0 / 64.0;
        let rtt = rtt.clamp(0.0, RTO_S_MAX);
        let smoothed = match self.smoothed {
            None => {
                self.variation = rtt / 2.0;
                self.floor = rtt;
                rtt
            }
            Some(smoothed) => {
                self.variation += BETA * ((smoothed - rtt).abs() - self.variation);
                smoothed + ALPHA * (rtt - smoothed)
            }
        };
        self.floor = rtt.min(self.floor + FLOOR_RISE * (smoothed - self.floor).max(0.0));
        self.smoothed = Some(smoothed);
        self.backoff = 0;
    }

    /// A block that was sent more than once was answered, at least `since_last` seconds after what caused the answer.
    ///
    /// RFC 6298 would neither time it nor take the back-off back. But a line to a board is slow because it garbles
    /// blocks, hardly ever because it is crowded, and where it garbles every second one few are sent only once.
    pub(super) fn bound(&mut self, since_last: f64) {
        let backoff = self.backoff.saturating_sub(1);
        if self.smoothed.is_none_or(|smoothed| since_last > smoothed) {
            self.sample(since_last);
        }
        self.backoff = backoff;
    }

    /// Nothing came in time: the next time-out is twice as long.
    pub(super) fn timed_out(&mut self) {
        self.backoff = (self.backoff + 1).min(BACKOFF_MAX);
    }

    /// The retransmission time-out now, in seconds.
    pub(super) fn timeout_s(&self) -> f64 {
        let single = self.answer_s_max().clamp(RTO_S_MIN, RTO_S_MAX);
        let doubled = single * f64::from(1_u32 << self.backoff);
        doubled.min(RTO_S_DOUBLED_MAX).max(single)
    }

    /// No answer comes sooner than this after what caused it, in seconds.
    pub(super) fn answer_s_min(&self) -> f64 {
        // The shortest of late was that of a full block behind others; the next may be short and have the line to itself.
        const ALLOWANCE: f64 = 0.6;
        ALLOWANCE * self.floor
    }

    /// No answer comes later than this after what caused it, in seconds.
    pub(super) fn answer_s_max(&self) -> f64 {
        self.smoothed.map_or(RTO_S_MIN, |smoothed| smoothed + 4.0 * self.variation)
    }

    /// The smoothed round-trip time, in seconds.
    pub(super) const fn smoothed_s(&self) -> Option<f64> {
        self.smoothed
    }
}

/// The share of blocks that are lost, and what to do about it: send fewer at once, since all that follow a lost block
/// are sent again; and make them shorter, since a long block is hit more often.
#[derive(Clone, Debug)]
pub(super) struct Loss {
    share: f64,
    payload_bytes: f64,
}

/// Blocks that the estimate of the loss looks back on.
const LOSS_MEMORY_BLOCKS: f64 = 32.0;
/// The shortest blocks that are made on a bad line.
const PAYLOAD_BYTES_LOWEST: f64 = 12.0;

impl Loss {
    pub(super) const fn new() -> Self {
        Self { share: 0.0, payload_bytes: PAYLOAD_BYTES_MAX as f64 }
    }

    /// A block did not arrive.
    pub(super) fn lost(&mut self) {
        const TOO_MANY: f64 = 0.35;
        self.share += (1.0 - self.share) / LOSS_MEMORY_BLOCKS;
        if self.share > TOO_MANY {
            self.payload_bytes = (self.payload_bytes * 0.9).max(PAYLOAD_BYTES_LOWEST);
        }
    }

    /// Blocks arrived.
    pub(super) fn arrived(&mut self, blocks: u32) {
        const FEW: f64 = 0.2;
        for _ in 0..blocks {
            self.share -= self.share / LOSS_MEMORY_BLOCKS;
            if self.share < FEW {
                self.payload_bytes = (self.payload_bytes + 1.0).min(PAYLOAD_BYTES_MAX as f64);
            }
        }
    }

    /// The most blocks to have on the way: about half as many again as arrive before one is lost.
    pub(super) fn window_blocks(&self) -> usize {
        const LOSSES_IN_WINDOW: f64 = 1.5;
        const LOWEST: f64 = 2.0;
        let blocks = LOSSES_IN_WINDOW / self.share.max(f64::MIN_POSITIVE);
        blocks.clamp(LOWEST, WINDOW_BLOCKS_MAX as f64) as usize
    }

    /// The most message bytes to put into a block.
    pub(super) const fn payload_bytes(&self) -> usize {
        self.payload_bytes as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_out_follows_the_standard() {
        let mut round_trip = RoundTrip::new();
        assert_eq!(round_trip.timeout_s(), RTO_S_MIN);
        round_trip.sample(0.02);
        assert!((round_trip.timeout_s() - 0.06).abs() < 1e-12);
        round_trip.timed_out();
        assert!((round_trip.timeout_s() - 0.12).abs() < 1e-12);
        round_trip.sample(0.02);
        assert!((round_trip.timeout_s() - 0.05).abs() < 1e-12);
    }

    #[test]
    fn the_time_out_has_bounds() {
        let mut round_trip = RoundTrip::new();
        (0..40).for_each(|_| round_trip.timed_out());
        assert_eq!(round_trip.timeout_s(), RTO_S_DOUBLED_MAX);
        round_trip.sample(1e-6);
        assert_eq!(round_trip.timeout_s(), RTO_S_MIN);
        round_trip.sample(1e6);
        (0..40).for_each(|_| round_trip.timed_out());
        assert_eq!(round_trip.timeout_s(), RTO_S_MAX);
    }

    #[test]
    fn an_answer_to_a_block_sent_twice_takes_back_off_back_and_can_only_lengthen_the_time_out() {
        let mut round_trip = RoundTrip::new();
        round_trip.sample(0.02);
        let before = round_trip.timeout_s();
        round_trip.timed_out();
        round_trip.bound(0.01);
        assert_eq!(round_trip.timeout_s(), before);
        round_trip.timed_out();
        round_trip.bound(0.03);
        assert!((before..2.0 * before).contains(&round_trip.timeout_s()));
    }

    #[test]
    fn a_line_slower_than_its_time_out_is_found_to_be_so() {
        // Every block is sent again until its answer comes after 0.1 s; soon none needs to be.
        let mut round_trip = RoundTrip::new();
        round_trip.sample(0.003);
        let mut resent = [0; 100];
        for resent in &mut resent {
            let (mut sent_s, mut times) = (0.0, 0_u32);
            while sent_s + round_trip.timeout_s() < 0.1 {
                sent_s += round_trip.timeout_s();
                round_trip.timed_out();
                times += 1;
            }
            match times {
                0 => round_trip.sample(0.1),
                _ => round_trip.bound(0.1 - sent_s),
            }
            *resent = times;
        }
        assert_eq!(resent[50..], [0; 50], "{resent:?}");
    }

    #[test]
    fn a_bad_line_gets_fewer_and_shorter_blocks_and_a_good_one_full_ones() {
        let mut loss = Loss::new();
        assert_eq!((loss.window_blocks(), loss.payload_bytes()), (WINDOW_BLOCKS_MAX, PAYLOAD_BYTES_MAX));
        for _ in 0..100 {
            loss.lost();
        }
        assert_eq!((loss.window_blocks(), loss.payload_bytes()), (2, 12));
        loss.arrived(300);
        assert_eq!((loss.window_blocks(), loss.payload_bytes()), (WINDOW_BLOCKS_MAX, PAYLOAD_BYTES_MAX));
    }
}
