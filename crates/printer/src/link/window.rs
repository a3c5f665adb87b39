//! What has been sent and not yet acknowledged: acknowledgements, losses and sending again.
//!
//! The board takes blocks in order only. Every block it sends carries the sequence number it expects next; an empty
//! one is an acknowledgement, and one that repeats the last number says that something else arrived than what was
//! expected. So a loss is repaired by sending again everything that is unacknowledged. Knows nothing of what is in
//! the blocks but the motion clocks that it is given.

use std::collections::VecDeque;

use units::Ticks;
use wire::block::{Block, SEQUENCE_MASK, SYNC};

use super::{
    MOTION_LANES_MAX,
    rtt::{Loss, RoundTrip},
};

/// The board sends four bits of a sequence number that the host counts in full.
const SEQUENCES: u64 = SEQUENCE_MASK as u64 + 1;

/// The motion in a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionClocks {
    /// The earliest clock at which any of it is due; `None` where there is none.
    pub(super) due: Option<Ticks>,
    /// For each lane, the clock of the last step.
    pub(super) ends: [Ticks; MOTION_LANES_MAX],
}

impl MotionClocks {
    pub(super) const NONE: Self = Self { due: None, ends: [Ticks(0); MOTION_LANES_MAX] };
}

/// A block that has been sent.
#[derive(Clone, Debug)]
struct Sent {
    block: Block,
    first_s: f64,
    last_s: f64,
    transmissions: u32,
    motion: MotionClocks,
}

/// What a frame from the board means for the window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Verdict {
    /// When the block that this one answers was sent, where that is beyond doubt.
    pub(super) sent_s: Option<f64>,
    /// The number is none that the board could expect.
    pub(super) absurd: bool,
}

/// The sending side of the sequence numbers.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// The board's number is known.
    adopted: bool,
    probes: u32,
    probe_s: f64,
    /// The number that the board expects, in full: that of the front of `sent`.
    expected: u64,
    sent: VecDeque<Sent>,
    sent_bytes: usize,
    /// The number in the last empty block.
    last_answer: u64,
    /// Blocks below this number have been sent again; the board may have had some of them already.
    resent_below: u64,
    /// Repeated answers that are explained by such blocks.
    forgiven: u64,
    send_again: bool,
    last_progress_s: f64,
    /// When the block of a number modulo 16 was sent, where it was sent once.
    sent_at: [Option<f64>; SEQUENCES as usize],
    motion_ends: [Ticks; MOTION_LANES_MAX],
    pub(super) round_trip: RoundTrip,
    pub(super) loss: Loss,
}

impl Window {
    pub(super) fn new() -> Self {
        Self {
            adopted: false,
            probes: 0,
            probe_s: 0.0,
            expected: 0,
            sent: VecDeque::with_capacity(SEQUENCES as usize),
            sent_bytes: 0,
            last_answer: 0,
            resent_below: 0,
            forgiven: 0,
            send_again: false,
            last_progress_s: 0.0,
            sent_at: [None; SEQUENCES as usize],
            motion_ends: [Ticks(0); MOTION_LANES_MAX],
            round_trip: RoundTrip::new(),
            loss: Loss::new(),
        }
    }

    /// Whether the board's sequence number is known.
    pub(super) const fn is_adopted(&self) -> bool {
        self.adopted
    }

    /// Blocks on the way.
    pub(super) fn blocks(&self) -> usize {
        self.sent.len()
    }

    /// Their bytes.
    pub(super) const fn bytes(&self) -> usize {
        self.sent_bytes
    }

    /// For each lane, the clock of the last step that the board has acknowledged.
    pub(super) const fn motion_ends(&self) -> &[Ticks; MOTION_LANES_MAX] {
        &self.motion_ends
    }

    /// The earliest clock at which motion is due that is on the way.
    pub(super) fn motion_due(&self) -> Option<Ticks> {
        self.sent.iter().filter_map(|sent| sent.motion.due).min()
    }

    /// Asks the board for its number with an empty block. It is answered with the number that the board expects
    /// next whether it is taken or refused, and nothing is lost either way. Returns its length.
    pub(super) fn probe(&mut self, now_s: f64, out: &mut Vec<u8>) -> usize {
        // The numbers of successive probes lie far apart: a late answer to one cannot be taken for a later one's.
        const STRIDE: u32 = 7;
        let sequence = (1 + self.probes * STRIDE) as u8 & SEQUENCE_MASK;
        let block = Block::new(sequence, &[]);
        out.push(SYNC);
        out.extend_from_slice(block.as_bytes());
        if self.probes > 0 {
            self.round_trip.timed_out();
        }
        self.probes = self.probes.wrapping_add(1);
        self.probe_s = now_s;
        1 + block.as_bytes().len()
    }

    /// When to probe, if the number is not known.
    pub(super) fn probe_due_s(&self) -> f64 {
        if self.probes == 0 { f64::NEG_INFINITY } else { self.probe_s + self.round_trip.timeout_s() }
    }

    /// Frames and sends a payload. Returns its length.
    pub(super) fn send(
        &mut self,
        payload: &[u8],
        motion: MotionClocks,
        now_s: f64,
        out: &mut Vec<u8>,
    ) -> usize {
        let sequence = self.expected + self.sent.len() as u64;
        let block = Block::new(sequence as u8, payload);
        let len = block.as_bytes().len();
        out.extend_from_slice(block.as_bytes());
        self.sent_at[(sequence % SEQUENCES) as usize] = Some(now_s);
        if self.sent.is_empty() {
            self.last_progress_s = now_s;
        }
        self.sent.push_back(Sent { block, first_s: now_s, last_s: now_s, transmissions: 1, motion });
        self.sent_bytes += len;
        len
    }

    /// When everything unacknowledged has to be sent again.
    pub(super) fn resend_due_s(&self) -> Option<f64> {
        let front = self.sent.front()?;
        if self.send_again {
            return Some(f64::NEG_INFINITY);
        }
        Some(front.last_s.max(self.last_progress_s) + self.round_trip.timeout_s())
    }

    /// Sends everything unacknowledged again where that is due. Returns how many bytes that was.
    pub(super) fn resend(&mut self, now_s: f64, out: &mut Vec<u8>) -> usize {
        if self.resend_due_s().is_none_or(|due| now_s < due) {
            return 0;
        }
        if !self.send_again {
            self.round_trip.timed_out();
        }
        self.loss.lost();
        self.send_again = false;
        let before = out.len();
        out.push(SYNC);
        for (sequence, sent) in (self.expected..).zip(&mut self.sent) {
            out.extend_from_slice(sent.block.as_bytes());
            sent.last_s = now_s;
            sent.transmissions = sent.transmissions.saturating_add(1);
            self.sent_at[(sequence % SEQUENCES) as usize] = None;
        }
        self.resent_below = self.expected + self.sent.len() as u64;
        self.forgiven = 0;
        out.len() - before
    }

    /// Takes the number of a valid block from the board.
    pub(super) fn answer(&mut self, sequence: u8, empty: bool, now_s: f64) -> Verdict {
        if !self.adopted {
            if empty && self.probes > 0 {
                self.adopt(sequence, now_s);
            }
            return Verdict::default();
        }
        let ahead = u64::from(sequence).wrapping_sub(self.expected) & u64::from(SEQUENCE_MASK);
        if ahead > self.sent.len() as u64 {
            return Verdict { sent_s: None, absurd: true };
        }
        let number = self.expected + ahead;
        if ahead > 0 {
            self.acknowledge(ahead as usize, now_s);
        }
        if empty {
            self.judge(number, now_s);
        }
        let answered = number.wrapping_sub(1) % SEQUENCES;
        Verdict { sent_s: self.sent_at[answered as usize], absurd: false }
    }

    fn adopt(&mut self, sequence: u8, now_s: f64) {
        if self.probes == 1 {
            self.round_trip.sample(now_s - self.probe_s);
        }
        self.adopted = true;
        // Numbers start a whole turn above zero, so that there is always one before.
        self.expected = SEQUENCES + u64::from(sequence);
        self.last_answer = self.expected;
        self.resent_below = self.expected;
    }

    fn acknowledge(&mut self, count: usize, now_s: f64) {
        for (at, sent) in self.sent.drain(..count).enumerate() {
            self.sent_bytes -= sent.block.as_bytes().len();
            for (end, lane) in self.motion_ends.iter_mut().zip(sent.motion.ends) {
                *end = (*end).max(lane);
            }
            if sent.transmissions == 1 && at + 1 == count {
                // The last one is what caused this answer; those before it lost theirs.
                self.round_trip.sample(now_s - sent.first_s);
            }
        }
        self.expected += count as u64;
        self.last_progress_s = now_s;
        self.send_again = false;
        self.round_trip.progress(count as u32);
        self.loss.arrived(count as u32);
    }

    /// Tells a nak from an acknowledgement.
    fn judge(&mut self, number: u64, now_s: f64) {
        let jump = number.saturating_sub(self.last_answer);
        if jump > 0 {
            // A board that had already taken some of what was sent again answers each of those with this number.
            self.forgiven = if number <= self.resent_below { jump - 1 } else { 0 };
            self.last_answer = number;
            return;
        }
        let Some(front) = self.sent.front() else { return };
        if self.forgiven > 0 {
            self.forgiven -= 1;
            return;
        }
        // An answer that comes too soon was caused by a block sent before the last transmission of this one.
        if now_s - front.last_s >= self.round_trip.answer_s_min() {
            self.send_again = true;
        }
    }
}
