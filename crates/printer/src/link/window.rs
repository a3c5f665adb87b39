//! What has been sent and not yet acknowledged: acknowledgements, losses and sending again.
//!
//! The board takes blocks in order only. Every block it sends carries the sequence number it expects next; an empty
//! one is an acknowledgement, and one that repeats the last number says that something else arrived than what was
//! expected. So a loss is repaired by sending again everything that is unacknowledged.
//!
//! Every transmission gets one answer, in order. Those that were on the way behind a lost block all repeat its
//! number, and so do the answers to what was sent again in vain: taken for new losses, each would cause more of the
//! same. So transmissions and answers are counted against each other, and a repeated number is a loss only when it
//! answers the last transmission of the block in question, or a later one.
//!
//! Knows nothing of what is in the blocks but the motion clocks that it is given.

use std::collections::VecDeque;

use units::Ticks;
use wire::{
    block::{BLOCK_BYTES_MIN, Block, PAYLOAD_BYTES_MAX, SEQUENCE_MASK, SYNC},
    check::BlockCheck,
};

use super::{
    MOTION_LANES_MAX,
    rtt::{Loss, RoundTrip},
};

/// How many of the last transmissions are remembered, to tell which one an answer belongs to.
const TRANSMISSIONS_REMEMBERED: usize = 64;

/// The board sends four bits of a sequence number that the host counts in full.
const SEQUENCES: u64 = SEQUENCE_MASK as u64 + 1;

/// The motion in a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionClocks {
    /// The earliest clock at which any of it is due, which says when to send it; `None` where there is none.
    pub(super) due: Option<Ticks>,
    /// The same without what only goes along with the motion: until the board has it, motion lasts so long.
    pub(super) uncovered: Option<Ticks>,
    /// For each lane, the clock of the last step.
    pub(super) ends: [Ticks; MOTION_LANES_MAX],
}

impl MotionClocks {
    pub(super) const NONE: Self = Self { due: None, uncovered: None, ends: [Ticks(0); MOTION_LANES_MAX] };
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

/// The latest transmission of a sequence number.
#[derive(Clone, Copy, Debug, Default)]
struct Transmission {
    /// When, where there was only one.
    sent_s: Option<f64>,
    /// Its place among all transmissions.
    place: u64,
}

/// Something was sent again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Resent {
    pub(super) bytes: usize,
    /// No answer came in time; otherwise the board asked for it.
    pub(super) timed_out: bool,
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
    /// The payload of the blocks by which it is found out.
    greeting: Vec<u8>,
    /// The check that blocks carry once the board is known to understand it.
    check: Option<BlockCheck>,
    probes: u32,
    probe_s: f64,
    /// The number that the board gave, while it is not settled.
    candidate: Option<u8>,
    /// The number that the board expects, in full: that of the front of `sent`.
    expected: u64,
    sent: VecDeque<Sent>,
    sent_bytes: usize,
    /// The number in the last empty block, and when that came.
    last_answer: u64,
    last_answer_s: f64,
    /// Blocks below this number have been sent again; the board may have had some of them already.
    resent_below: u64,
    /// Transmissions so far.
    transmissions: u64,
    /// The place of the transmission that the next answer belongs to.
    unanswered: u64,
    /// So many answers were given up and may come after all.
    late_answers: u64,
    /// The board asked for the front again.
    send_again: bool,
    /// The board asked for the front, but perhaps before it was sent for the last time.
    suspect: bool,
    last_progress_s: f64,
    /// By sequence number modulo 16.
    latest: [Transmission; SEQUENCES as usize],
    /// The sequence numbers of the last transmissions, by place.
    log: [u64; TRANSMISSIONS_REMEMBERED],
    motion_ends: [Ticks; MOTION_LANES_MAX],
    pub(super) round_trip: RoundTrip,
    pub(super) loss: Loss,
}

impl Window {
    /// Nothing sent yet. `greeting` is what the board is asked until its number is known: messages that it may take
    /// any number of times.
    pub(super) fn new(greeting: Vec<u8>) -> Self {
        Self {
            adopted: false,
            greeting,
            check: None,
            probes: 0,
            probe_s: 0.0,
            candidate: None,
            expected: 0,
            sent: VecDeque::with_capacity(SEQUENCES as usize),
            sent_bytes: 0,
            last_answer: 0,
            last_answer_s: 0.0,
            resent_below: 0,
            transmissions: 0,
            unanswered: 0,
            late_answers: 0,
            send_again: false,
            suspect: false,
            last_progress_s: 0.0,
            latest: [Transmission::default(); SEQUENCES as usize],
            log: [0; TRANSMISSIONS_REMEMBERED],
            motion_ends: [Ticks(0); MOTION_LANES_MAX],
            round_trip: RoundTrip::new(),
            loss: Loss::new(),
        }
    }

    /// From now on blocks carry this check.
    pub(super) const fn set_check(&mut self, check: BlockCheck) {
        self.check = Some(check);
    }

    /// What a block has besides its messages, in bytes.
    pub(super) fn overhead_bytes(&self) -> usize {
        BLOCK_BYTES_MIN + self.check.map_or(0, |check| check.len())
    }

    /// The most message bytes to put into a block.
    pub(super) fn payload_bytes(&self) -> usize {
        let room = PAYLOAD_BYTES_MAX - self.check.map_or(0, |check| check.len());
        self.loss.payload_bytes().min(room)
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

    /// The clock before which no motion is on the way; what only goes along with it does not count.
    pub(super) fn uncovered(&self) -> Option<Ticks> {
        self.sent.iter().filter_map(|sent| sent.motion.uncovered).min()
    }

    /// Asks the board for its number with a block that does no harm, whether it is taken or refused: the number in the
    /// empty block that answers it tells.
    ///
    /// One answer is not enough. A probe may be refused together with noise before it and be taken nevertheless: two
    /// answers with different numbers. So the number that was given is probed too. If the board is still there, it
    /// takes that block; if it was already one further, it refuses it: either way it is one further then, and says so.
    pub(super) fn probe(&mut self, now_s: f64, out: &mut Vec<u8>) {
        // The numbers of successive probes lie far apart, so that the board does not take two in a row.
        const STRIDE: u32 = 7;
        let sequence = self.candidate.unwrap_or(self.probes.wrapping_mul(STRIDE) as u8);
        out.push(SYNC);
        out.extend_from_slice(Block::new(sequence, &self.greeting).as_bytes());
        if self.probes > 0 {
            self.round_trip.timed_out();
        }
        self.probes = self.probes.wrapping_add(1);
        self.probe_s = now_s;
    }

    /// When to probe (again).
    pub(super) fn probe_due_s(&self) -> f64 {
        if self.probes == 0 { f64::NEG_INFINITY } else { self.probe_s + self.round_trip.timeout_s() }
    }

    /// Takes the answer to a probe.
    fn probed(&mut self, sequence: u8, now_s: f64) {
        let next = |candidate: u8| (candidate + 1) & SEQUENCE_MASK;
        match self.candidate {
            Some(candidate) if sequence == next(candidate) => self.adopt(sequence, now_s),
            Some(candidate) if sequence == candidate => {}
            _ => {
                // The next probe belongs to this number, and goes at once.
                self.candidate = Some(sequence);
                self.probes = 0;
            }
        }
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

    /// Frames and sends a payload. Returns its length.
    pub(super) fn send(
        &mut self,
        payload: &[u8],
        motion: MotionClocks,
        now_s: f64,
        out: &mut Vec<u8>,
    ) -> usize {
        let sequence = self.expected + self.sent.len() as u64;
        let block = match &self.check {
            Some(check) => check.seal(sequence as u8, payload),
            None => Block::new(sequence as u8, payload),
        };
        let len = block.as_bytes().len();
        out.extend_from_slice(block.as_bytes());
        self.transmitted(sequence, Some(now_s));
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
        let timeout_s = front.last_s.max(self.last_progress_s) + self.round_trip.timeout_s();
        let silence_s = self.last_answer_s + 0.5 * self.round_trip.answer_s_max();
        let suspicion_s = silence_s.max(front.last_s + self.round_trip.answer_s_max());
        Some(if self.suspect { timeout_s.min(suspicion_s) } else { timeout_s })
    }

    /// Sends everything unacknowledged again where that is due.
    pub(super) fn resend(&mut self, now_s: f64, out: &mut Vec<u8>) -> Option<Resent> {
        if self.resend_due_s().is_none_or(|due| now_s < due) {
            return None;
        }
        let timed_out = !self.send_again && !self.suspect;
        if timed_out {
            self.round_trip.timed_out();
        }
        if !self.send_again {
            // Whatever has not been answered by now will not be, or late: the line may only hold bytes up. Such an answer
            // looks as if what is sent now had been lost; taken so, it fills the line with repetitions, and what is
            // answered then comes later still.
            self.late_answers = self.transmissions - self.unanswered;
            self.unanswered = self.transmissions;
        }
        self.loss.lost();
        self.send_again = false;
        self.suspect = false;
        let before = out.len();
        out.push(SYNC);
        for at in 0..self.sent.len() {
            let sent = &mut self.sent[at];
            out.extend_from_slice(sent.block.as_bytes());
            sent.last_s = now_s;
            sent.transmissions = sent.transmissions.saturating_add(1);
            self.transmitted(self.expected + at as u64, None);
        }
        self.resent_below = self.expected + self.sent.len() as u64;
        Some(Resent { bytes: out.len() - before, timed_out })
    }

    fn transmitted(&mut self, sequence: u64, sent_s: Option<f64>) {
        self.latest[(sequence % SEQUENCES) as usize] = Transmission { sent_s, place: self.transmissions };
        self.log[self.transmissions as usize % TRANSMISSIONS_REMEMBERED] = sequence;
        self.transmissions += 1;
    }

    fn latest(&self, sequence: u64) -> Transmission {
        self.latest[(sequence % SEQUENCES) as usize]
    }

    /// Takes the number of a valid block from the board.
    pub(super) fn answer(&mut self, sequence: u8, empty: bool, now_s: f64) -> Verdict {
        if !self.adopted {
            if empty && self.probes > 0 {
                self.probed(sequence, now_s);
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
        Verdict { sent_s: self.latest(number - 1).sent_s, absurd: false }
    }

    fn acknowledge(&mut self, count: usize, now_s: f64) {
        for (at, sent) in self.sent.drain(..count).enumerate() {
            self.sent_bytes -= sent.block.as_bytes().len();
            for (end, lane) in self.motion_ends.iter_mut().zip(sent.motion.ends) {
                *end = (*end).max(lane);
            }
            // The last one is what caused this answer; those before it lost theirs.
            if at + 1 < count {
                continue;
            }
            if sent.transmissions == 1 {
                self.round_trip.sample(now_s - sent.first_s);
            } else {
                self.round_trip.bound(now_s - sent.last_s);
            }
        }
        self.expected += count as u64;
        self.last_progress_s = now_s;
        self.send_again = false;
        self.suspect = false;
        self.loss.arrived(count as u32);
    }

    /// Tells a refusal from an acknowledgement.
    fn judge(&mut self, number: u64, now_s: f64) {
        self.last_answer_s = now_s;
        if number > self.last_answer {
            // A board that already had some of what was sent again answers the first of it with a number far ahead,
            // and so does one whose answers were lost on the way; the former leaves more answers to come.
            let answered = if number <= self.resent_below { self.last_answer } else { number - 1 };
            self.unanswered = self.place_of(answered) + 1;
            self.last_answer = number;
            return;
        }
        let Some(front) = self.sent.front() else { return };
        let place = self.unanswered;
        self.unanswered = (place + 1).min(self.transmissions);
        let age_s = now_s - front.last_s;
        let is_late = self.late_answers > 0 && age_s < self.round_trip.usual_answer_s_min();
        self.late_answers = if is_late { self.late_answers - 1 } else { 0 };
        let answers_front =
            place >= self.latest(self.expected).place && age_s >= self.round_trip.answer_s_min() && !is_late;
        if answers_front {
            self.send_again = true;
        } else {
            self.suspect = true;
        }
    }

    /// The place of the transmission of a block that an answer to it most likely belongs to: the one that is nearest
    /// to where the count of answers stands. Noise makes the board answer too often, and answers get lost; this
    /// brings the count back into step.
    fn place_of(&self, sequence: u64) -> u64 {
        let remembered =
            self.transmissions.saturating_sub(TRANSMISSIONS_REMEMBERED as u64)..self.transmissions;
        remembered
            .filter(|&place| self.log[place as usize % TRANSMISSIONS_REMEMBERED] == sequence)
            .min_by_key(|&place| place.abs_diff(self.unanswered))
            .unwrap_or_else(|| self.latest(sequence).place)
    }
}
