//! The host's end of the line to the board: blocks, acknowledgements, retransmission, and what is sent when.
//!
//! Sans-I/O: [`Link::receive`] takes bytes, [`Link::poll`] gives bytes and says when it wants to be called again;
//! both are told the time. Messages wait in lanes and go out in full blocks, motion no earlier than the board's clock
//! and move queue allow. Knows nothing of what messages mean.
//!
//! Units: host time in seconds of any monotonic clock, the board's clock in ticks.

mod clocks;
mod lanes;
mod message;
mod rtt;
mod window;

#[cfg(test)]
mod check_tests;
#[cfg(test)]
mod late_tests;
#[cfg(test)]
mod lossy_line;
#[cfg(test)]
mod tests;

use units::{Hertz, Seconds, Ticks};
use wire::{
    block::{BLOCK_BYTES_MAX, Deframer, Frame},
    dictionary::BlockChecks,
};

pub use self::{
    clocks::Clocks,
    lanes::{CONTROL_MESSAGES_MAX, IMMEDIATE_MESSAGES_MAX, MOTION_MESSAGES_MAX},
    message::{Lane, MOTION_LANES_MAX, Outgoing, SCHEDULE_AHEAD_TICKS_MAX},
};
use self::{
    lanes::{Draft, Gate, Lanes},
    rtt::RTO_S_MIN,
    window::Window,
};
use crate::move_queue::MoveQueue;

/// The most blocks on the way at once.
pub const WINDOW_BLOCKS_MAX: usize = 12;
/// The same for the immediate lane, which does not wait for the rest; fewer than the sixteen sequence numbers.
pub const WINDOW_BLOCKS_IMMEDIATE_MAX: usize = 15;
/// How far ahead motion is sent unless the session asks for something else, in seconds.
pub const HORIZON_DEFAULT: Seconds = Seconds(4.0);
/// How long motion may wait for a block to fill, counted from when it comes within the horizon, in seconds.
const FILL_WAIT_S: f64 = 0.25;
/// Motion that is due sooner than this does not wait for a block to fill, in seconds.
const URGENT_S: f64 = 0.35;
/// Once entries of the move queue come free again, this long is waited for more of them, in seconds.
const ENTRIES_WAIT_S: f64 = 0.01;
/// An entry of the move queue counts as free this long after its clock, which is only estimated, in seconds.
const ENTRY_MARGIN_S: f64 = 0.01;
/// The link never asks to be called again sooner than this, in seconds.
const WAKE_S_MIN: f64 = 0.001;

/// A lane has no room: the message was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the queue for {0:?} messages is full")]
pub struct LaneFull(pub Lane);

/// Messages from the board, with what is needed to reckon its clock.
#[derive(Clone, Copy, Debug)]
pub struct Payload<'a> {
    /// One or more messages, for the dictionary to read.
    pub bytes: &'a [u8],
    /// When they arrived.
    pub received: Seconds,
    /// When the block that they answer was sent; `None` when it was sent more than once.
    pub sent: Option<Seconds>,
}

/// Counts since the link was made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkStats {
    /// Everything handed to the port.
    pub bytes_sent: u64,
    /// Of these, what was sent again.
    pub bytes_retransmitted: u64,
    /// Everything that came from the port.
    pub bytes_received: u64,
    /// Blocks sent for the first time.
    pub blocks_sent: u64,
    /// Times that something was sent again.
    pub retransmissions: u64,
    /// Of these, how often because no answer came in time.
    pub timeouts: u64,
    /// Valid blocks received.
    pub blocks_received: u64,
    /// Stretches of received bytes that were no block.
    pub garbage: u64,
    /// Valid blocks with a number that the board cannot expect.
    pub absurd: u64,
    /// Blocks that the framing took for valid and the block check did not.
    pub unchecked: u64,
    /// Whether the board sends none without that check.
    pub checked: bool,
    /// The smoothed round-trip time.
    pub round_trip: Option<Seconds>,
    /// When the last valid block arrived.
    pub last_received: Option<Seconds>,
}

/// What may be sent but waits: motion for its block to fill, or a long message for room at the board.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    /// The next message is too long for the room that the board has left.
    crowded: bool,
    /// Something waits for entries of the move queue to come free.
    starved: bool,
    /// The earliest clock at which any of the motion in the block is due.
    due: Option<Ticks>,
}

/// The host's end of the line.
#[derive(Clone, Debug)]
pub struct Link {
    deframer: Deframer,
    /// When the first of the bytes came that may become a block.
    pending_since_s: f64,
    window: Window,
    checks: Option<BlockChecks>,
    /// The board has sent a block with a valid check: from then on it sends none without.
    is_checked: bool,
    lanes: Lanes,
    moves: MoveQueue,
    receive_window: usize,
    clock: Hertz,
    horizon: Ticks,
    stats: LinkStats,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A link that knows nothing of the board yet: it asks for the board's sequence number with empty blocks before it
    /// sends anything else. Motion waits until [`set_board`](Self::set_board).
    pub fn new() -> Self {
        Self::greeting(&[])
    }

    /// The same, with these messages in the blocks that ask for the number. The board may take them any number of times,
    /// and in this order before all others.
    pub fn greeting(payload: &[u8]) -> Self {
        Self {
            deframer: Deframer::new(),
            pending_since_s: 0.0,
            window: Window::new(payload.to_vec()),
            checks: None,
            is_checked: false,
            lanes: Lanes::default(),
            moves: MoveQueue::new(0, Ticks(0)),
            receive_window: usize::MAX,
            clock: Hertz(1),
            horizon: Ticks(0),
            stats: LinkStats::default(),
        }
    }

    /// The most unacknowledged bytes that the board has room for (`RECEIVE_WINDOW` in its dictionary).
    pub fn set_receive_window(&mut self, bytes: usize) {
        self.receive_window = bytes.max(BLOCK_BYTES_MAX);
    }

    /// The board knows the block check: from now on blocks carry it, and from the board's first one that does on, those
    /// that do not are dropped.
    pub fn set_checks(&mut self, checks: BlockChecks) {
        self.window.set_check(checks.to_board);
        self.checks = Some(checks);
    }

    /// The board's nominal clock and the size of its move queue. Forgets what was in that queue.
    pub fn set_board(&mut self, clock: Hertz, move_count: u16) {
        self.clock = clock;
        self.moves = MoveQueue::new(usize::from(move_count), clock.ticks_in(Seconds(ENTRY_MARGIN_S)));
        self.set_horizon(HORIZON_DEFAULT);
    }

    /// How far ahead of the board's clock motion is sent.
    pub fn set_horizon(&mut self, horizon: Seconds) {
        self.horizon = self.clock.ticks_in(horizon);
    }

    /// Takes bytes from the port and hands on the messages in them, block by block.
    pub fn receive(&mut self, bytes: &[u8], now: Seconds, mut each: impl FnMut(Payload<'_>)) {
        let Self { deframer, window, checks, is_checked, stats, pending_since_s, .. } = self;
        stats.bytes_received += bytes.len() as u64;
        let pending_s_max = window.round_trip.answer_s_max().max(RTO_S_MIN);
        let mut take = |frame: Frame<'_>| {
            let Frame::Block { sequence, mut payload } = frame else {
                stats.garbage += 1;
                return;
            };
            if let Some(checks) = checks {
                match checks.from_board.open(sequence, payload) {
                    Some(messages) => (payload, *is_checked) = (messages, true),
                    // A board that has just started checks no more, and its numbers mean nothing.
                    None if *is_checked && payload == checks.starting => {
                        each(Payload { bytes: payload, received: now, sent: None });
                        return;
                    }
                    None if *is_checked => {
                        stats.unchecked += 1;
                        return;
                    }
                    None => {}
                }
            }
            stats.blocks_received += 1;
            stats.last_received = Some(now);
            let verdict = window.answer(sequence, payload.is_empty(), now.0);
            stats.absurd += u64::from(verdict.absurd);
            if !payload.is_empty() {
                each(Payload { bytes: payload, received: now, sent: verdict.sent_s.map(Seconds) });
            }
        };
        if now.0 - *pending_since_s > pending_s_max {
            deframer.give_up(&mut take);
            *pending_since_s = now.0;
        }
        deframer.push(bytes, take);
        if deframer.pending() <= bytes.len() {
            *pending_since_s = now.0;
        }
    }

    /// Puts a message into its lane.
    pub fn queue(&mut self, message: Outgoing) -> Result<(), LaneFull> {
        let lane = message.lane();
        if self.lanes.push(message) { Ok(()) } else { Err(LaneFull(lane)) }
    }

    /// How many messages wait in a lane, not yet sent.
    pub fn waiting(&self, lane: Lane) -> usize {
        self.lanes.len(lane)
    }

    /// How many more messages a lane takes.
    pub fn room(&self, lane: Lane) -> usize {
        self.lanes.room(lane)
    }

    /// Whether nothing waits and everything sent has been acknowledged.
    pub fn is_idle(&self) -> bool {
        self.lanes.is_empty() && self.window.blocks() == 0
    }

    /// Whether the board has ever answered.
    pub fn is_connected(&self) -> bool {
        self.window.is_adopted()
    }

    /// Blocks and bytes on the way, not yet acknowledged.
    pub fn unacknowledged(&self) -> (usize, usize) {
        (self.window.blocks(), self.window.bytes())
    }

    /// The clock before which all motion that was queued here has been acknowledged by the board: the earliest at
    /// which anything is due that waits or is on the way. `None` when there is nothing left to acknowledge.
    pub fn motion_covered(&self) -> Option<Ticks> {
        self.window.uncovered().into_iter().chain(self.lanes.uncovered()).min()
    }

    /// The earliest clock at which any motion is due that has not been sent.
    pub fn motion_waiting(&self) -> Option<Ticks> {
        self.lanes.uncovered()
    }

    /// The clock of the last step of a motion lane that the board has acknowledged; zero before the first.
    pub fn motion_acknowledged(&self, lane: u8) -> Ticks {
        self.window.motion_ends().get(usize::from(lane)).copied().unwrap_or_default()
    }

    /// The entries of the board's move queue that are taken.
    pub const fn moves(&self) -> &MoveQueue {
        &self.moves
    }

    /// Throws away what waits in a motion lane and gives its entries of the move queue back: its stepper was stopped
    /// by a trigger, and the board has dropped its queue.
    pub fn forget_motion(&mut self, lane: u8) {
        let lane = usize::from(lane);
        if lane < MOTION_LANES_MAX {
            self.lanes.clear_motion(lane);
            self.moves.forget_motion(lane);
        }
    }

    /// Throws away everything that waits but for the immediate lane, and all entries of the move queue: the board has
    /// shut down.
    pub fn forget_all(&mut self) {
        (0..MOTION_LANES_MAX).for_each(|lane| self.lanes.clear_motion(lane));
        self.lanes.clear_control();
        self.moves.forget_all();
    }

    /// Counts.
    pub fn stats(&self) -> LinkStats {
        let round_trip = self.window.round_trip.smoothed_s().map(Seconds);
        LinkStats { round_trip, checked: self.is_checked, ..self.stats }
    }

    /// Appends what is to be sent now, and says when to call again if nothing arrives before. `clocks` are the
    /// board's as far as they are known: what waits in motion lanes is due by the motion clock.
    pub fn poll(&mut self, now: Seconds, clocks: impl Into<Clocks>, out: &mut Vec<u8>) -> Option<Seconds> {
        let clocks = clocks.into();
        let before = out.len();
        let wake = if self.window.is_adopted() {
            if let Some(resent) = self.window.resend(now.0, out) {
                self.stats.retransmissions += 1;
                self.stats.timeouts += u64::from(resent.timed_out);
                self.stats.bytes_retransmitted += resent.bytes as u64;
            }
            self.moves.release(clocks);
            let held = self.send_blocks(now, clocks, out);
            self.next_wake(now, clocks, held)
        } else {
            self.probe(now, out)
        };
        self.stats.bytes_sent += (out.len() - before) as u64;
        wake.map(|wake| Seconds(wake.max(now.0 + WAKE_S_MIN)))
    }

    fn probe(&mut self, now: Seconds, out: &mut Vec<u8>) -> Option<f64> {
        if self.lanes.is_empty() {
            return None;
        }
        if now.0 >= self.window.probe_due_s() {
            self.window.probe(now.0, out);
        }
        Some(self.window.probe_due_s())
    }

    /// Sends blocks while the window has room.
    fn send_blocks(&mut self, now: Seconds, clocks: Clocks, out: &mut Vec<u8>) -> Held {
        // Every turn sends a block or ends the loop, and the window bounds the blocks.
        for _ in 0..WINDOW_BLOCKS_IMMEDIATE_MAX {
            let Some((payload_bytes, immediate_only)) = self.room_on_the_line() else { break };
            let gate = Gate {
                clocks,
                horizon: Ticks(clocks.motion.0.saturating_add(self.horizon.0)),
                payload_bytes,
                immediate_only,
            };
            let draft = self.lanes.draft(&gate, &self.moves);
            if draft.is_empty() || !self.goes_now(&draft, clocks.motion) {
                return Held { starved: draft.starved, due: draft.motion.due, crowded: false };
            }
            // Short blocks may hold one long message. The immediate lane waits for nobody.
            let waits_for_room = self.lanes.len(Lane::Immediate) == 0;
            if waits_for_room && !self.has_room_for(draft.payload().len()) {
                return Held { crowded: true, ..Held::default() };
            }
            self.lanes.commit(&draft, &mut self.moves);
            self.window.send(draft.payload(), draft.motion, now.0, out);
            self.stats.blocks_sent += 1;
        }
        Held::default()
    }

    /// The most message bytes for the next block, and whether only the immediate lane may send.
    fn room_on_the_line(&self) -> Option<(usize, bool)> {
        let payload_bytes = self.window.payload_bytes();
        let blocks = self.window.blocks();
        if blocks < self.window.loss.window_blocks() && self.has_room_for(payload_bytes) {
            Some((payload_bytes, false))
        } else if blocks < WINDOW_BLOCKS_IMMEDIATE_MAX && self.lanes.len(Lane::Immediate) > 0 {
            Some((payload_bytes, true))
        } else {
            None
        }
    }

    /// Whether the board has room for a block with so many message bytes.
    fn has_room_for(&self, payload_bytes: usize) -> bool {
        let room = self.receive_window.saturating_sub(self.window.bytes());
        self.window.blocks() == 0 || self.window.overhead_bytes() + payload_bytes <= room
    }

    /// How long before it is due motion is sent even in a block that is not full.
    fn urgent_lead(&self, starved: bool) -> Ticks {
        let urgent = self.clock.ticks_in(Seconds(URGENT_S));
        if starved {
            return urgent;
        }
        self.horizon.saturating_sub(self.clock.ticks_in(Seconds(FILL_WAIT_S))).max(urgent)
    }

    fn goes_now(&self, draft: &Draft, motion_now: Ticks) -> bool {
        let lead = self.urgent_lead(draft.starved);
        draft.full
            || draft.is_urgent()
            || draft.motion.due.is_some_and(|due| due.saturating_sub(lead) <= motion_now)
    }

    /// When something is to be done, if nothing arrives before.
    fn next_wake(&self, now: Seconds, clocks: Clocks, held: Held) -> Option<f64> {
        let resend = self.window.resend_due_s();
        if held.crowded || self.room_on_the_line().is_none() {
            return resend;
        }
        let send = if held.starved {
            let urgent = held.due.map(|due| due.saturating_sub(self.urgent_lead(true)));
            let urgent = urgent.and_then(|clock| clocks.until_motion(clock));
            let released = self.moves.next_release(clocks);
            let released = released.map(|ahead| ahead + self.clock.ticks_in(Seconds(ENTRIES_WAIT_S)));
            urgent.into_iter().chain(released).chain(self.lanes.until_control(clocks)).min()
        } else {
            self.lanes.until_next(self.urgent_lead(false), clocks)
        };
        let send = send.map(|ahead| now.0 + self.clock.duration_of(ahead).0);
        resend.into_iter().chain(send).min_by(f64::total_cmp)
    }
}
