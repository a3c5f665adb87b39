//! The board's side of the block protocol: which block is expected, acknowledgements, and sending.
//!
//! The number of the next block outlives everything but a restart: a host that starts anew learns it from the first
//! refusal, which is an acknowledgement that asks for the expected number again.

use wire::{
    Response,
    block::{Block, PAYLOAD_BYTES_MAX},
    vlq::SliceSink,
};

use crate::board::Board;

pub(crate) struct Receiver {
    /// The number of the block that is expected; its low four bits travel.
    expected: u8,
    /// An acknowledgement found no room.
    ack_pending: bool,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self { expected: 0, ack_pending: false }
    }

    /// Whether this is the expected block, which counts as received from then on.
    pub(crate) fn accept(&mut self, sequence: u8) -> bool {
        let is_expected = sequence == self.expected;
        if is_expected {
            self.expected = (sequence + 1) & wire::block::SEQUENCE_MASK;
        }
        is_expected
    }

    /// Tells the host which block is expected: an acknowledgement, or a refusal when it says nothing new.
    pub(crate) fn acknowledge(&mut self, board: &mut impl Board) {
        self.ack_pending = !board.transmit(Block::new(self.expected, &[]).as_bytes());
    }

    pub(crate) const fn is_ack_pending(&self) -> bool {
        self.ack_pending
    }

    /// Sends one message; `false` when there was no room.
    pub(crate) fn send(&self, board: &mut impl Board, message: &Response<'_>) -> bool {
        let mut payload = [0; PAYLOAD_BYTES_MAX];
        let mut sink = SliceSink::new(&mut payload);
        // Everything that the firmware says fits a block by construction.
        let fits = message.encode(&mut sink);
        debug_assert!(fits, "a message that fits no block");
        let len = sink.len();
        !fits || board.transmit(Block::new(self.expected, &payload[..len]).as_bytes())
    }
}
