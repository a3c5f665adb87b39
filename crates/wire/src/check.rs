//! The block check: a message at the end of a block that holds a CRC-32 over all of the block before it.
//!
//! The framing's own CRC has 16 bits, so that about one damaged block in 65536 passes it. This one is a message like any
//! other to whoever knows it from the dictionary, of a fixed length: its number, then five bytes, although smaller values
//! would do with fewer. Knows nothing of who asks for it and when; docs/block-check.md says that.
//!
//! CRC-32/ISO-HDLC (reflected 0x04c11db7, start and final xor all ones) over the block's length byte, its sequence byte
//! and the messages before the check.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use crate::{
    block::{BLOCK_BYTES_MIN, Block, PAYLOAD_BYTES_MAX, sequence_byte},
    vlq::{self, SliceSink},
};

/// The one table of this CRC; the check over rows uses it too.
pub(crate) static CRC_32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// The bytes of the value: always the longest encoding.
const VALUE_BYTES: usize = vlq::VLQ_BYTES_MAX;
/// The longest encoding of a message's number, which has 16 bits.
const NUMBER_BYTES_MAX: usize = 3;
/// The longest check. Messages no longer than [`MESSAGE_BYTES_MAX`] fit a block with any.
pub const CHECK_BYTES_MAX: usize = NUMBER_BYTES_MAX + VALUE_BYTES;
/// The longest message that fits a block beside a check.
pub const MESSAGE_BYTES_MAX: usize = PAYLOAD_BYTES_MAX - CHECK_BYTES_MAX;

/// The check message of one direction, by the number that the board gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockCheck {
    number: [u8; NUMBER_BYTES_MAX],
    number_bytes: usize,
}

impl BlockCheck {
    /// The check whose message has this number.
    pub fn new(id: u16) -> Self {
        let mut number = [0; NUMBER_BYTES_MAX];
        let mut sink = SliceSink::new(&mut number);
        vlq::encode(i32::from(id), &mut sink);
        let number_bytes = sink.len();
        Self { number, number_bytes }
    }

    /// How long it is.
    #[expect(clippy::len_without_is_empty, reason = "no check is empty")]
    pub const fn len(&self) -> usize {
        self.number_bytes + VALUE_BYTES
    }

    /// Frames `payload` with the low four bits of `sequence` and a check behind it.
    ///
    /// # Panics
    /// When payload and check are longer than [`PAYLOAD_BYTES_MAX`]: a mistake of the caller, who leaves room for it.
    pub fn seal(&self, sequence: u8, payload: &[u8]) -> Block {
        let mut whole = [0; PAYLOAD_BYTES_MAX];
        let (head, tail) = whole.split_at_mut(payload.len());
        head.copy_from_slice(payload);
        let tail = &mut tail[..self.len()];
        tail[..self.number_bytes].copy_from_slice(&self.number[..self.number_bytes]);
        tail[self.number_bytes..].copy_from_slice(&self.value(sequence, payload));
        let len = payload.len() + self.len();
        Block::new(sequence, &whole[..len])
    }

    /// The messages before the check; `None` where the payload of a block with this sequence number does not end in a
    /// valid one.
    pub fn open<'a>(&self, sequence: u8, payload: &'a [u8]) -> Option<&'a [u8]> {
        let (messages, check) = payload.split_at_checked(payload.len().checked_sub(self.len())?)?;
        let (number, value) = check.split_at_checked(self.number_bytes)?;
        let is_valid =
            number == &self.number[..self.number_bytes] && value == self.value(sequence, messages).as_slice();
        is_valid.then_some(messages)
    }

    /// The value's bytes for these messages.
    fn value(&self, sequence: u8, messages: &[u8]) -> [u8; VALUE_BYTES] {
        let len = messages.len() + self.len() + BLOCK_BYTES_MIN;
        let mut digest = CRC_32.digest();
        digest.update(&[len as u8, sequence_byte(sequence)]);
        digest.update(messages);
        long_vlq(digest.finalize())
    }
}

/// The value in as many bytes as any takes, so that the length of a block does not depend on it.
const fn long_vlq(value: u32) -> [u8; VALUE_BYTES] {
    const MORE: u8 = 0x80;
    let value = value as i32;
    [
        (value >> 28) as u8 | MORE,
        (value >> 21) as u8 | MORE,
        (value >> 14) as u8 | MORE,
        (value >> 7) as u8 | MORE,
        value as u8 & !MORE,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Deframer, Frame};
    use alloc::vec::Vec;
    use proptest::prelude::*;

    const CHECK_ID: u16 = 42;

    fn opened(stream: &[u8], check: BlockCheck) -> Vec<(u8, Vec<u8>)> {
        let mut found = Vec::new();
        Deframer::new().push(stream, |frame| {
            if let Frame::Block { sequence, payload } = frame
                && let Some(messages) = check.open(sequence, payload)
            {
                found.push((sequence, messages.to_vec()));
            }
        });
        found
    }

    #[test]
    fn the_crc_is_the_published_one() {
        assert_eq!(CRC_32.checksum(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn an_acknowledgement_is_eleven_bytes_and_empty() {
        let check = BlockCheck::new(CHECK_ID);
        let block = check.seal(7, &[]);
        assert_eq!(block.as_bytes().len(), 11);
        assert_eq!(opened(block.as_bytes(), check), [(7, Vec::new())]);
    }

    #[test]
    fn another_sequence_number_is_another_block() {
        let check = BlockCheck::new(CHECK_ID);
        let block = check.seal(3, b"messages");
        let payload = &block.as_bytes()[2..block.as_bytes().len() - 3];
        assert_eq!(check.open(3, payload), Some(&b"messages"[..]));
        assert_eq!(check.open(4, payload), None);
        assert_eq!(BlockCheck::new(CHECK_ID + 1).open(3, payload), None);
    }

    #[test]
    fn what_is_too_short_for_a_check_has_none() {
        let check = BlockCheck::new(CHECK_ID);
        for len in 0..check.len() {
            assert_eq!(check.open(0, &[0; CHECK_BYTES_MAX][..len]), None);
        }
    }

    #[derive(Clone, Debug)]
    enum Damage {
        Replace(usize, u8),
        Flip(usize, u8),
        Drop(usize),
        Double(usize),
        Swap(usize, usize),
        Insert(usize, u8),
    }

    fn damage() -> impl Strategy<Value = Damage> {
        prop_oneof![
            (any::<usize>(), any::<u8>()).prop_map(|(at, to)| Damage::Replace(at, to)),
            (any::<usize>(), 0_u8..8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
            any::<usize>().prop_map(Damage::Drop),
            any::<usize>().prop_map(Damage::Double),
            (any::<usize>(), any::<usize>()).prop_map(|(at, with)| Damage::Swap(at, with)),
            (any::<usize>(), any::<u8>()).prop_map(|(at, byte)| Damage::Insert(at, byte)),
        ]
    }

    fn apply(damage: &[Damage], stream: &mut Vec<u8>) {
        for one in damage {
            let len = stream.len();
            if len == 0 {
                return;
            }
            match *one {
                Damage::Replace(at, to) => stream[at % len] = to,
                Damage::Flip(at, bit) => stream[at % len] ^= 1 << bit,
                Damage::Drop(at) => drop(stream.remove(at % len)),
                Damage::Double(at) => stream.insert(at % len, stream[at % len]),
                Damage::Swap(at, with) => stream.swap(at % len, with % len),
                Damage::Insert(at, byte) => stream.insert(at % len, byte),
            }
        }
    }

    /// Gives the framing's own CRC its right value again, as a chance in 65536 would.
    fn reframe(block: &[u8], sequence: u8) -> Option<Vec<u8>> {
        let payload = block.get(2..block.len().checked_sub(3)?)?;
        (payload.len() <= PAYLOAD_BYTES_MAX).then(|| Block::new(sequence, payload).as_bytes().to_vec())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn what_is_sealed_is_opened(
            id: u16, sequence: u8, payload in prop::collection::vec(any::<u8>(), 0..=MESSAGE_BYTES_MAX),
        ) {
            let check = BlockCheck::new(id);
            let block = check.seal(sequence, &payload);
            prop_assert_eq!(block.as_bytes().len(), BLOCK_BYTES_MIN + payload.len() + check.len());
            prop_assert_eq!(opened(block.as_bytes(), check), [(sequence & 0x0f, payload)]);
        }

        #[test]
        fn the_long_encoding_is_read_as_any_other(value: u32) {
            let bytes = long_vlq(value);
            let mut rest = &bytes[..];
            prop_assert_eq!(vlq::decode(&mut rest), Some(value as i32));
            prop_assert!(rest.is_empty());
        }

        #[test]
        fn damage_that_passes_the_framing_does_not_pass_the_check(
            sequence in 0_u8..16,
            payload in prop::collection::vec(any::<u8>(), 0..=MESSAGE_BYTES_MAX),
            damage in prop::collection::vec(damage(), 1..6),
            other in 0_u8..16,
        ) {
            let check = BlockCheck::new(CHECK_ID);
            let sent = check.seal(sequence, &payload);
            let mut stream = sent.as_bytes().to_vec();
            apply(&damage, &mut stream);
            // With the framing's CRC made right for what the damage left, only the check stands in the way.
            for sequence in [sequence, other] {
                let Some(reframed) = reframe(&stream, sequence) else { continue };
                for (sequence, messages) in opened(&reframed, check) {
                    prop_assert_eq!(check.seal(sequence, &messages), sent);
                }
            }
        }
    }
}
