//! Blocks: how messages are framed, checked and told apart from noise.
//!
//! `length, 0x10 | sequence, payload …, CRC high, CRC low, 0x7e`. The CRC is CRC-16/MCRF4XX over all that precedes it.

use crc::{CRC_16_MCRF4XX, Crc, Table};

/// The shortest block, which is an acknowledgement: length, sequence, CRC, sync.
pub const BLOCK_BYTES_MIN: usize = 5;
/// The longest block.
pub const BLOCK_BYTES_MAX: usize = 64;
/// The most message bytes in a block.
pub const PAYLOAD_BYTES_MAX: usize = BLOCK_BYTES_MAX - BLOCK_BYTES_MIN;
/// The byte that ends every block, and by which a receiver finds its place again.
pub const SYNC: u8 = 0x7e;
/// The high nibble of every sequence byte.
const SEQUENCE_TAG: u8 = 0x10;
/// Sequence numbers count modulo 16.
pub const SEQUENCE_MASK: u8 = 0x0f;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MCRF4XX);

/// A block's second byte.
pub(crate) const fn sequence_byte(sequence: u8) -> u8 {
    SEQUENCE_TAG | (sequence & SEQUENCE_MASK)
}

/// A whole block, ready to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    bytes: [u8; BLOCK_BYTES_MAX],
}

impl Block {
    /// Frames `payload` with the low four bits of `sequence`.
    ///
    /// # Panics
    /// When the payload is longer than [`PAYLOAD_BYTES_MAX`]: a mistake of the caller, who fills payloads to that size.
    pub fn new(sequence: u8, payload: &[u8]) -> Self {
        assert!(payload.len() <= PAYLOAD_BYTES_MAX, "a block's payload is at most {PAYLOAD_BYTES_MAX} bytes");
        let len = payload.len() + BLOCK_BYTES_MIN;
        let mut bytes = [0; BLOCK_BYTES_MAX];
        bytes[0] = len as u8;
        bytes[1] = sequence_byte(sequence);
        bytes[2..len - 3].copy_from_slice(payload);
        let crc = CRC.checksum(&bytes[..len - 3]);
        bytes[len - 3..len - 1].copy_from_slice(&crc.to_be_bytes());
        bytes[len - 1] = SYNC;
        Self { bytes }
    }

    /// The bytes to send.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.bytes[0])]
    }
}

/// What a receiver finds in a stream of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame<'a> {
    /// A block whose length, tag, CRC and sync byte are right.
    Block {
        /// The low four bits of the sender's sequence number.
        sequence: u8,
        /// The messages; empty in an acknowledgement.
        payload: &'a [u8],
    },
    /// Bytes that are no block were thrown away, up to and including a sync byte.
    Garbage,
}

/// What the front of a buffer is.
enum Front {
    /// A whole, valid block of this many bytes.
    Block(usize),
    /// Perhaps a block, but not all of it is here yet.
    Partial,
    /// A lone sync byte between blocks, which senders use to wake a receiver.
    LoneSync,
    /// Not a block.
    Invalid,
}

fn front(bytes: &[u8]) -> Front {
    let Some(&len) = bytes.first() else { return Front::Partial };
    if len == SYNC {
        return Front::LoneSync;
    }
    let len = usize::from(len);
    if !(BLOCK_BYTES_MIN..=BLOCK_BYTES_MAX).contains(&len) {
        return Front::Invalid;
    }
    match bytes.get(1) {
        None => return Front::Partial,
        Some(tag) if tag & !SEQUENCE_MASK != SEQUENCE_TAG => return Front::Invalid,
        Some(_) => {}
    }
    if bytes.len() < len {
        return Front::Partial;
    }
    let crc = u16::from_be_bytes([bytes[len - 3], bytes[len - 2]]);
    if bytes[len - 1] == SYNC && CRC.checksum(&bytes[..len - 3]) == crc {
        Front::Block(len)
    } else {
        Front::Invalid
    }
}

/// Finds blocks in a stream that arrives in pieces and may be damaged. Holds at most one block's bytes.
#[derive(Clone, Debug)]
pub struct Deframer {
    buffer: [u8; BLOCK_BYTES_MAX],
    len: usize,
    /// Garbage has begun: everything up to the next sync byte goes with it.
    lost: bool,
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// An empty receiver.
    pub const fn new() -> Self {
        Self { buffer: [0; BLOCK_BYTES_MAX], len: 0, lost: false }
    }

    /// Takes bytes and hands on each block and each stretch of garbage, in order.
    pub fn push(&mut self, bytes: &[u8], mut found: impl FnMut(Frame<'_>)) {
        for &byte in bytes {
            self.buffer[self.len] = byte;
            self.len += 1;
            // Nothing is decided before the sync byte, the last byte that the length allows, or a bad first byte.
            while self.step(&mut found) {}
        }
    }

    /// Bytes that may become a block, but for which others are still missing.
    pub const fn pending(&self) -> usize {
        self.len
    }

    /// The rest of the block that seems to have begun will not come: its length was damaged, and it has swallowed what came
    /// behind it.
    pub fn give_up(&mut self, mut found: impl FnMut(Frame<'_>)) {
        self.lost |= self.len > 0;
        while self.step(&mut found) {}
    }

    /// Judges the front of the buffer; `true` when it took something off and the rest is to be judged anew.
    fn step(&mut self, found: &mut impl FnMut(Frame<'_>)) -> bool {
        if !self.lost {
            match front(&self.buffer[..self.len]) {
                Front::Partial => return false,
                Front::LoneSync => {
                    self.drop_front(1);
                    return self.len > 0;
                }
                Front::Block(len) => {
                    let payload = &self.buffer[2..len - 3];
                    found(Frame::Block { sequence: self.buffer[1] & SEQUENCE_MASK, payload });
                    self.drop_front(len);
                    return self.len > 0;
                }
                Front::Invalid => self.lost = true,
            }
        }
        if let Some(at) = self.buffer[..self.len].iter().position(|&b| b == SYNC) {
            self.lost = false;
            self.drop_front(at + 1);
            found(Frame::Garbage);
            self.len > 0
        } else {
            self.len = 0;
            false
        }
    }

    fn drop_front(&mut self, count: usize) {
        self.buffer.copy_within(count..self.len, 0);
        self.len -= count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::{vec, vec::Vec};
    use proptest::prelude::*;

    #[derive(Debug, PartialEq)]
    enum Seen {
        Block(u8, Vec<u8>),
        Garbage,
    }

    fn read(stream: &[u8]) -> Vec<Seen> {
        let mut seen = Vec::new();
        Deframer::new().push(stream, |frame| {
            seen.push(match frame {
                Frame::Block { sequence, payload } => Seen::Block(sequence, payload.to_vec()),
                Frame::Garbage => Seen::Garbage,
            });
        });
        seen
    }

    #[test]
    fn the_crc_is_the_published_one() {
        assert_eq!(CRC.checksum(b"123456789"), 0x6f91);
    }

    #[test]
    fn an_acknowledgement_is_five_bytes() {
        let ack = Block::new(1, &[]);
        assert_eq!(ack.as_bytes().len(), 5);
        assert_eq!(read(ack.as_bytes()), vec![Seen::Block(1, vec![])]);
    }

    #[test]
    fn sync_bytes_between_blocks_are_no_garbage() {
        let mut stream = vec![SYNC, SYNC];
        stream.extend(Block::new(3, &[7]).as_bytes());
        assert_eq!(read(&stream), vec![Seen::Block(3, vec![7])]);
    }

    #[test]
    fn blocks_swallowed_by_a_false_length_are_found_once_it_is_given_up() {
        let mut stream = Block::new(3, &[]).as_bytes().to_vec();
        stream[0] = 64;
        stream.extend(Block::new(4, &[]).as_bytes());
        let whole = stream.len();
        stream.extend(&Block::new(5, &[9]).as_bytes()[..3]);
        let (mut deframer, mut seen) = (Deframer::new(), Vec::new());
        deframer.push(&stream, |_| unreachable!("the end of the false block is still to come"));
        assert_eq!(deframer.pending(), stream.len());
        deframer.give_up(|frame| {
            seen.push(match frame {
                Frame::Block { sequence, .. } => Seen::Block(sequence, Vec::new()),
                Frame::Garbage => Seen::Garbage,
            });
        });
        assert_eq!(seen, vec![Seen::Garbage, Seen::Block(4, Vec::new())]);
        assert_eq!(
            deframer.pending(),
            stream.len() - whole,
            "what has begun behind them may still become a block"
        );
    }

    #[test]
    fn a_block_swallowed_by_a_false_length_is_found_again() {
        // The damaged first byte claims 64 bytes; the good block behind it lies inside that claim.
        let mut stream = Block::new(3, &[1, 2, 3]).as_bytes().to_vec();
        stream[0] = 64;
        stream.extend(Block::new(4, &[9; 56]).as_bytes());
        stream.extend(Block::new(5, &[8; 20]).as_bytes());
        assert_eq!(
            read(&stream),
            vec![Seen::Garbage, Seen::Block(4, vec![9; 56]), Seen::Block(5, vec![8; 20])]
        );
    }

    proptest! {
        #[test]
        fn blocks_cut_anywhere_arrive_whole(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..=PAYLOAD_BYTES_MAX), 1..20),
            piece in 1_usize..90,
        ) {
            let mut stream = Vec::new();
            for (i, payload) in payloads.iter().enumerate() {
                stream.extend(Block::new(i as u8, payload).as_bytes());
            }
            let mut deframer = Deframer::new();
            let mut got = Vec::new();
            for chunk in stream.chunks(piece) {
                deframer.push(chunk, |frame| match frame {
                    Frame::Block { payload, .. } => got.push(payload.to_vec()),
                    Frame::Garbage => panic!("garbage in a clean stream"),
                });
            }
            prop_assert_eq!(got, payloads);
        }

        #[test]
        fn after_garbage_it_finds_its_place(noise: Vec<u8>, payload in prop::collection::vec(any::<u8>(), 0..=PAYLOAD_BYTES_MAX)) {
            // Whatever the noise claimed, enough good blocks behind it get through, and the last always does.
            let mut stream = noise;
            for sequence in 0..4 {
                stream.extend(Block::new(sequence, &[0; PAYLOAD_BYTES_MAX]).as_bytes());
            }
            stream.extend(Block::new(4, &payload).as_bytes());
            prop_assert_eq!(read(&stream).pop(), Some(Seen::Block(4, payload)));
        }
    }
}
