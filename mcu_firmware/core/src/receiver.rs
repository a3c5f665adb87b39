//! The board's side of the block protocol: which block is expected, whether it is sound, acknowledgements, and sending.
//!
//! The number of the next block outlives everything but a restart: a host that starts anew learns it from the first
//! refusal, which is an acknowledgement that asks for the expected number again. So does the block check
//! (docs/block-check.md), until such a host asks who it speaks to.

use wire::{
    Command, Response,
    block::{Block, PAYLOAD_BYTES_MAX, SEQUENCE_MASK},
    check::BlockCheck,
    messages::{CommandKind, ResponseKind},
    vlq::SliceSink,
};

use crate::board::Board;

pub(crate) struct Receiver {
    /// The number of the block that is expected; its low four bits travel.
    expected: u8,
    /// An acknowledgement found no room.
    ack_pending: bool,
    /// It knows the block check at all.
    has_check: bool,
    /// Blocks without a valid check are refused.
    is_checking: bool,
    /// The block that is to be answered was sound but for the check: whoever sent it may not know of checks.
    answer_plainly: bool,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self { expected: 0, ack_pending: false, has_check: true, is_checking: false, answer_plainly: false }
    }

    /// As a board that knows no block check.
    pub(crate) const fn without_check(&mut self) {
        self.has_check = false;
    }

    /// The messages of a block where it is the expected one and, once that is asked for, carries its check. It counts as
    /// received from then on.
    pub(crate) fn accept<'a>(&mut self, sequence: u8, payload: &'a [u8]) -> Option<&'a [u8]> {
        let is_expected = sequence == self.expected;
        let mut messages = payload;
        if self.is_checking {
            let checked = to_board().open(sequence, payload);
            self.answer_plainly = checked.is_none();
            match checked {
                Some(checked) => messages = checked,
                None if is_expected && is_greeting(payload) => self.is_checking = false,
                None => return None,
            }
        }
        if is_expected {
            self.expected = (sequence + 1) & SEQUENCE_MASK;
        }
        is_expected.then_some(messages)
    }

    /// What came was no block.
    pub(crate) fn garbage(&mut self) {
        self.answer_plainly = false;
    }

    /// A check was met among the messages of an accepted block, and `rest` behind it. A valid one at the block's end is
    /// the host's wish that all blocks are checked from now on. `false` where there is no such message.
    pub(crate) fn met_check(&mut self, sequence: u8, payload: &[u8], rest: &[u8]) -> bool {
        if self.has_check && rest.is_empty() && to_board().open(sequence, payload).is_some() {
            self.is_checking = true;
            self.answer_plainly = false;
        }
        self.has_check
    }

    /// Tells the host which block is expected: an acknowledgement, or a refusal when it says nothing new.
    pub(crate) fn acknowledge(&mut self, board: &mut impl Board) {
        self.ack_pending = !self.transmit(board, &[], self.is_checking && !self.answer_plainly);
    }

    pub(crate) const fn is_ack_pending(&self) -> bool {
        self.ack_pending
    }

    /// Sends one message; `false` when there was no room.
    pub(crate) fn send(&self, board: &mut impl Board, message: &Response<'_>) -> bool {
        let mut payload = [0; PAYLOAD_BYTES_MAX];
        let room = if self.is_checking { PAYLOAD_BYTES_MAX - from_board().len() } else { PAYLOAD_BYTES_MAX };
        let mut sink = SliceSink::new(&mut payload[..room]);
        // Everything that the firmware says fits a block by construction.
        let fits = message.encode(&mut sink);
        debug_assert!(fits, "a message that fits no block");
        let len = sink.len();
        !fits || self.transmit(board, &payload[..len], self.is_checking)
    }

    fn transmit(&self, board: &mut impl Board, payload: &[u8], checked: bool) -> bool {
        let block = if checked {
            from_board().seal(self.expected, payload)
        } else {
            Block::new(self.expected, payload)
        };
        board.transmit(block.as_bytes())
    }
}

fn to_board() -> BlockCheck {
    BlockCheck::new(CommandKind::BlockCheck.spec().id)
}

fn from_board() -> BlockCheck {
    BlockCheck::new(ResponseKind::BlockChecked.spec().id)
}

/// Whether this is what every host says first, and no host later: the question for the dictionary's beginning, alone.
fn is_greeting(mut payload: &[u8]) -> bool {
    matches!(Command::decode(&mut payload), Ok(Command::Identify { offset: 0, .. })) && payload.is_empty()
}
