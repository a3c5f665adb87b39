//! What has been sent and not yet acknowledged: acknowledgements, losses and sending again.
//!
//! The board takes blocks in order only. Every block it sends carries the sequence number it expects next; an empty
//! one is an acknowledgement, and one that repeats the last number says that something else arrived than what was
//! expected. Such a refusal is repaired by sending again everything that is unacknowledged.
//!
//! Every transmission gets one answer, in order. Those that were on the way behind a lost block all repeat its
//! number, and so do the answers to what was sent again in vain: taken for new losses, each would cause more of the
//! same. So transmissions and answers are counted against each other, and a repeated number is a refusal only when it
//! answers the last transmission of the block in question, or a later one.
//!
//! Silence is no refusal: answers may be lost, or the line may only hold bytes up. Then the first unacknowledged block
//! alone is sent again, which has the board say what it expects, and at worst is one answer too many. Late answers
//! keep their places in the count: none is given up.
//!
//! Knows nothing of what is in the blocks but the motion clocks that it is given.

use std::{collections::VecDeque, ops::Range};

use units::Ticks;
use wire::{
    block::{BLOCK_BYTES_MAX, BLOCK_BYTES_MIN, Block, PAYLOAD_BYTES_MAX, SEQUENCE_MASK, SYNC},
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

/// What is sent as noise has no number; those of blocks are greater.
const NOISE: u64 = 0;

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

/// The latest transmission of a sequence number, but for those that only asked.
#[derive(Clone, Copy, Debug, Default)]
struct Transmission {
    at_s: f64,
    /// It was the only one.
    only: bool,
    /// Its place among all transmissions.
    place: u64,
}

/// A transmission.
#[derive(Clone, Copy, Debug, Default)]
struct Logged {
    sequence: u64,
    at_s: f64,
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
    /// Transmissions so far.
    transmissions: u64,
    /// The next answer belongs to the transmission at this place or, where answers were lost, to a later one.
    unanswered: u64,
    /// The place of the last transmission that only asked, and when that was.
    asked: u64,
    asked_s: f64,
    /// The board asked for the front again.
    send_again: bool,
    /// The board asked for the front, but perhaps before it was sent for the last time.
    suspect: bool,
    last_progress_s: f64,
    /// By sequence number modulo 16.
    latest: [Transmission; SEQUENCES as usize],
    /// The last transmissions, by place.
    log: [Logged; TRANSMISSIONS_REMEMBERED],
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
            transmissions: 0,
            unanswered: 0,
            asked: 0,
            asked_s: f64::NEG_INFINITY,
            send_again: false,
            suspect: false,
            last_progress_s: 0.0,
            latest: [Transmission::default(); SEQUENCES as usize],
            log: [Logged::default(); TRANSMISSIONS_REMEMBERED],
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
        self.transmitted(sequence, true, now_s);
        if self.sent.is_empty() {
            self.last_progress_s = now_s;
        }
        self.sent.push_back(Sent { block, first_s: now_s, last_s: now_s, transmissions: 1, motion });
        self.sent_bytes += len;
        len
    }

    /// When something unacknowledged has to be sent again.
    pub(super) fn resend_due_s(&self) -> Option<f64> {
        let front = self.sent.front()?;
        if self.send_again {
            return Some(f64::NEG_INFINITY);
        }
        let timeout_s = front.last_s.max(self.last_progress_s) + self.round_trip.timeout_s();
        // To ask costs little, so it is not waited for the very last that could still come.
        let answer_s = 0.6 * self.round_trip.answer_s_max();
        let suspicion_s = (self.last_answer_s + 0.5 * answer_s).max(front.last_s + answer_s);
        Some(if self.suspect { timeout_s.min(suspicion_s) } else { timeout_s })
    }

    /// Sends again what is due: after a refusal everything unacknowledged, after silence the first of it.
    pub(super) fn resend(&mut self, now_s: f64, out: &mut Vec<u8>) -> Option<Resent> {
        if self.resend_due_s().is_none_or(|due| now_s < due) {
            return None;
        }
        let refused = self.send_again;
        let timed_out = !refused && !self.suspect;
        if timed_out {
            self.round_trip.timed_out();
        }
        self.loss.lost();
        self.send_again = false;
        self.suspect = false;
        let before = out.len();
        let blocks = if refused { self.sent.len() } else { 1 };
        let is_silent = timed_out && self.asked > self.latest(self.expected).place;
        if is_silent {
            // A board that takes noise for the beginning of a block is silent until so many bytes have come; these are none
            // that a block ends with.
            out.resize(before + BLOCK_BYTES_MAX, 0);
            self.log(NOISE, now_s);
        }
        out.push(SYNC);
        for at in 0..blocks {
            let sent = &mut self.sent[at];
            out.extend_from_slice(sent.block.as_bytes());
            sent.last_s = now_s;
            sent.transmissions = sent.transmissions.saturating_add(1);
            let sequence = self.expected + at as u64;
            if refused {
                self.transmitted(sequence, false, now_s);
            } else {
                self.asked(sequence, now_s);
            }
        }
        Some(Resent { bytes: out.len() - before, timed_out })
    }

    fn transmitted(&mut self, sequence: u64, only: bool, at_s: f64) {
        let place = self.log(sequence, at_s);
        self.latest[(sequence % SEQUENCES) as usize] = Transmission { at_s, only, place };
    }

    /// A refusal of what was sent before still is one: everything behind it is lost as well.
    fn asked(&mut self, sequence: u64, at_s: f64) {
        self.latest[(sequence % SEQUENCES) as usize].only = false;
        (self.asked, self.asked_s) = (self.log(sequence, at_s), at_s);
    }

    /// Something was sent that gets an answer. Gives its place.
    fn log(&mut self, sequence: u64, at_s: f64) -> u64 {
        let place = self.transmissions;
        self.log[place as usize % TRANSMISSIONS_REMEMBERED] = Logged { sequence, at_s };
        self.transmissions += 1;
        place
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
        let cause = self.latest(number - 1);
        Verdict { sent_s: cause.only.then_some(cause.at_s), absurd: false }
    }

    fn acknowledge(&mut self, count: usize, now_s: f64) {
        let latest = self.latest(self.expected + count as u64 - 1);
        for (at, sent) in self.sent.drain(..count).enumerate() {
            self.sent_bytes -= sent.block.as_bytes().len();
            for (end, lane) in self.motion_ends.iter_mut().zip(sent.motion.ends) {
                *end = (*end).max(lane);
            }
            // The last one is what caused this answer; those before it lost theirs.
            if at + 1 < count {
                continue;
            }
            // An answer that skips some may be the one to a question that was asked behind the block.
            if sent.transmissions == 1 && (count == 1 || latest.place > self.asked) {
                self.round_trip.sample(now_s - sent.first_s);
            } else {
                self.round_trip.bound(now_s - sent.last_s.max(self.asked_s));
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
        let front = self.latest(self.expected);
        let answerable = self.answerable(now_s);
        if number > self.last_answer {
            self.last_answer = number;
            self.unanswered = self.place_of(number - 1, answerable) + 1;
            // Where this answers a question, all that was sent before and is still on the way was refused.
            self.suspect |= !self.sent.is_empty() && front.place < self.asked;
            return;
        }
        let place = self.unanswered;
        let is_counted = place < answerable;
        self.unanswered += u64::from(is_counted);
        if self.sent.is_empty() {
            return;
        }
        if is_counted && place >= front.place {
            self.send_again = true;
        } else {
            self.suspect = true;
        }
    }

    fn logged(&self, place: u64) -> Logged {
        self.log[place as usize % TRANSMISSIONS_REMEMBERED]
    }

    /// The place of the first transmission that was too short a time ago to have been answered.
    fn answerable(&self, now_s: f64) -> u64 {
        let until_s = now_s - self.round_trip.answer_s_min();
        let young = self.remembered().rev().take_while(|&place| self.logged(place).at_s > until_s).count();
        self.transmissions - young as u64
    }

    fn remembered(&self) -> Range<u64> {
        self.transmissions.saturating_sub(TRANSMISSIONS_REMEMBERED as u64)..self.transmissions
    }

    /// The place of the transmission by which the board got a block that it has acknowledged: the first that has not been
    /// answered and can have been by now. Noise makes the board answer too often: then it is in the past, and brings the
    /// count back into step.
    fn place_of(&self, sequence: u64, answerable: u64) -> u64 {
        let is_it = |place: &u64| self.logged(*place).sequence == sequence;
        let remembered = self.remembered();
        (self.unanswered.max(remembered.start)..answerable)
            .find(is_it)
            .or_else(|| (remembered.start..self.unanswered).rev().find(is_it))
            .unwrap_or_else(|| self.latest(sequence).place)
    }
}
