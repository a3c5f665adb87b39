//! The messages that wait to be sent, and which of them go into the next block.
//!
//! Immediate before control before motion. The motion lanes are merged by the clock at which their messages are due,
//! so that the move queue's entries always go to what is needed first; within a lane the order is kept. Units: the
//! board's clock, in ticks.

use std::collections::VecDeque;

use units::Ticks;
use wire::block::PAYLOAD_BYTES_MAX;

use super::{
    clocks::Clocks,
    message::{Lane, MOTION_LANES_MAX, Outgoing},
    window::MotionClocks,
};
use crate::move_queue::MoveQueue;

/// The most messages that wait in a motion lane.
pub const MOTION_MESSAGES_MAX: usize = 4096;
/// The most messages that wait in the control lane: a whole configuration fits.
pub const CONTROL_MESSAGES_MAX: usize = 512;
/// The most messages that wait in the immediate lane.
pub const IMMEDIATE_MESSAGES_MAX: usize = 8;

/// What may be sent now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    /// The board's clocks.
    pub(super) clocks: Clocks,
    /// Motion that is due later than this is held back.
    pub(super) horizon: Ticks,
    /// The most message bytes in the block.
    pub(super) payload_bytes: usize,
    /// Only the immediate lane may send.
    pub(super) immediate_only: bool,
}

/// What would go into the next block.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    payload: [u8; PAYLOAD_BYTES_MAX],
    len: usize,
    immediate: usize,
    control: usize,
    motion_taken: [usize; MOTION_LANES_MAX],
    entries: usize,
    /// The next message did not fit: the block is as full as it gets.
    pub(super) full: bool,
    /// Something is held up for lack of free entries in the board's move queue.
    pub(super) starved: bool,
    pub(super) motion: MotionClocks,
}

impl Draft {
    fn new() -> Self {
        Self {
            payload: [0; PAYLOAD_BYTES_MAX],
            len: 0,
            immediate: 0,
            control: 0,
            motion_taken: [0; MOTION_LANES_MAX],
            entries: 0,
            full: false,
            starved: false,
            motion: MotionClocks::NONE,
        }
    }

    pub(super) fn payload(&self) -> &[u8] {
        &self.payload[..self.len]
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether it holds anything that must not wait for the block to fill.
    pub(super) const fn is_urgent(&self) -> bool {
        self.immediate > 0 || self.control > 0
    }

    /// Adds the message where it fits.
    fn add(&mut self, message: &Outgoing, payload_bytes: usize) -> bool {
        let payload = message.payload();
        let end = self.len + payload.len();
        // A message longer than a shortened block still goes, alone.
        if end > payload_bytes && !(self.len == 0 && end <= PAYLOAD_BYTES_MAX) {
            self.full = true;
            return false;
        }
        self.payload[self.len..end].copy_from_slice(payload);
        self.len = end;
        self.entries += usize::from(message.entry_until.is_some());
        true
    }
}

/// The queues.
#[derive(Clone, Debug, Default)]
pub(super) struct Lanes {
    immediate: VecDeque<Outgoing>,
    control: VecDeque<Outgoing>,
    motion: [VecDeque<Outgoing>; MOTION_LANES_MAX],
}

impl Lanes {
    /// How many messages wait in a lane.
    pub(super) fn len(&self, lane: Lane) -> usize {
        match lane {
            Lane::Immediate => self.immediate.len(),
            Lane::Control => self.control.len(),
            Lane::Motion(at) => self.motion.get(usize::from(at)).map_or(0, VecDeque::len),
        }
    }

    /// How many more a lane takes.
    pub(super) fn room(&self, lane: Lane) -> usize {
        let most = match lane {
            Lane::Immediate => IMMEDIATE_MESSAGES_MAX,
            Lane::Control => CONTROL_MESSAGES_MAX,
            Lane::Motion(at) if usize::from(at) < MOTION_LANES_MAX => MOTION_MESSAGES_MAX,
            Lane::Motion(_) => 0,
        };
        most - self.len(lane)
    }

    /// Puts a message at its lane's end; `false` when the lane is full.
    pub(super) fn push(&mut self, message: Outgoing) -> bool {
        if self.room(message.lane) == 0 {
            return false;
        }
        match message.lane {
            Lane::Immediate => self.immediate.push_back(message),
            Lane::Control => self.control.push_back(message),
            Lane::Motion(at) => self.motion[usize::from(at)].push_back(message),
        }
        true
    }

    pub(super) fn is_empty(&self) -> bool {
        self.immediate.is_empty() && self.control.is_empty() && self.motion.iter().all(VecDeque::is_empty)
    }

    pub(super) fn clear_motion(&mut self, lane: usize) {
        self.motion[lane].clear();
    }

    pub(super) fn clear_control(&mut self) {
        self.control.clear();
    }

    /// The clock before which no motion waits; what only goes along with it does not count.
    pub(super) fn uncovered(&self) -> Option<Ticks> {
        self.motion_fronts().filter(|(_, front)| front.covers).map(|(_, front)| front.req_clock).min()
    }

    fn motion_fronts(&self) -> impl Iterator<Item = (usize, &Outgoing)> {
        self.motion.iter().enumerate().filter_map(|(at, lane)| Some((at, lane.front()?)))
    }

    /// What goes into the next block; nothing is taken yet.
    pub(super) fn draft(&self, gate: &Gate, moves: &MoveQueue) -> Draft {
        let mut draft = Draft::new();
        for message in &self.immediate {
            if !draft.add(message, gate.payload_bytes) {
                return draft;
            }
            draft.immediate += 1;
        }
        if gate.immediate_only {
            return draft;
        }
        for message in &self.control {
            let no_entry = message.entry_until.is_some() && draft.entries >= moves.free();
            if message.min_clock > gate.clocks.hardware || no_entry {
                draft.starved |= no_entry;
                break;
            }
            if !draft.add(message, gate.payload_bytes) {
                return draft;
            }
            draft.control += 1;
        }
        while let Some(lane) = self.next_motion(&mut draft, gate, moves) {
            let message = &self.motion[lane][draft.motion_taken[lane]];
            if !draft.add(message, gate.payload_bytes) {
                break;
            }
            draft.motion_taken[lane] += 1;
            let earlier =
                |of: Option<Ticks>| Some(of.map_or(message.req_clock, |of| of.min(message.req_clock)));
            draft.motion.due = earlier(draft.motion.due);
            if message.covers {
                draft.motion.uncovered = earlier(draft.motion.uncovered);
            }
            if let Some(end) = message.entry_until {
                draft.motion.ends[lane] = draft.motion.ends[lane].max(end);
            }
        }
        draft
    }

    /// The lane whose next message is due first, of those that may be sent.
    fn next_motion(&self, draft: &mut Draft, gate: &Gate, moves: &MoveQueue) -> Option<usize> {
        let mut first: Option<(Ticks, usize)> = None;
        let entry_free = draft.entries < moves.free_for_motion();
        let mut starved = false;
        for (at, lane) in self.motion.iter().enumerate() {
            let Some(message) = lane.get(draft.motion_taken[at]) else { continue };
            if message.min_clock > gate.clocks.motion || message.req_clock > gate.horizon {
                continue;
            }
            if message.entry_until.is_some() && !entry_free {
                starved = true;
                continue;
            }
            if first.is_none_or(|(due, _)| message.req_clock < due) {
                first = Some((message.req_clock, at));
            }
        }
        draft.starved |= starved;
        Some(first?.1)
    }

    /// Takes what is in the draft off the queues.
    pub(super) fn commit(&mut self, draft: &Draft, moves: &mut MoveQueue) {
        self.immediate.drain(..draft.immediate);
        for message in self.control.drain(..draft.control) {
            if let Some(end) = message.entry_until {
                moves.take_other(end);
            }
        }
        for (at, (lane, &taken)) in self.motion.iter_mut().zip(&draft.motion_taken).enumerate() {
            for message in lane.drain(..taken) {
                if let Some(end) = message.entry_until {
                    moves.take_motion(at, end);
                }
            }
        }
    }

    /// How long the control lane waits for its clock, where that is ahead.
    pub(super) fn until_control(&self, clocks: Clocks) -> Option<Ticks> {
        let clock = self.control.front().map(|front| front.min_clock)?;
        (clock > clocks.hardware).then(|| clock.saturating_sub(clocks.hardware))
    }

    /// How long until the first of the lanes' fronts may be sent and has waited long enough for company.
    pub(super) fn until_next(&self, urgent_lead: Ticks, clocks: Clocks) -> Option<Ticks> {
        let motion = self
            .motion_fronts()
            .map(|(_, front)| front.req_clock.saturating_sub(urgent_lead).max(front.min_clock))
            .filter_map(|clock| clocks.until_motion(clock));
        let control = self.control.front().map(|front| front.min_clock.saturating_sub(clocks.hardware));
        motion.chain(control).min()
    }
}
