//! Variable-length integers: 7 bits a byte, most significant first, sign-extended from the first byte.
//!
//! One byte covers -32..=95, five bytes every 32-bit value. Unsigned 32-bit values travel as their two's complement.

/// The longest encoding of one integer, in bytes.
pub const VLQ_BYTES_MAX: usize = 5;

/// A place that takes encoded bytes; it says `false` when it is full and takes nothing more.
pub trait Sink {
    /// Takes one byte.
    fn put(&mut self, byte: u8) -> bool;
}

/// A [`Sink`] over a caller's buffer.
#[derive(Debug)]
pub struct SliceSink<'a> {
    buffer: &'a mut [u8],
    len: usize,
}

impl<'a> SliceSink<'a> {
    /// Writes from the start of `buffer`.
    pub const fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, len: 0 }
    }

    /// Bytes written so far.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing has been written.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl Sink for SliceSink<'_> {
    fn put(&mut self, byte: u8) -> bool {
        let Some(slot) = self.buffer.get_mut(self.len) else { return false };
        *slot = byte;
        self.len += 1;
        true
    }
}

#[cfg(any(feature = "dictionary", test))]
impl Sink for alloc::vec::Vec<u8> {
    fn put(&mut self, byte: u8) -> bool {
        self.push(byte);
        true
    }
}

/// Appends `value`; `false` when the sink is full.
pub fn encode(value: i32, sink: &mut impl Sink) -> bool {
    // A value fits n bytes when it lies in -2^(7n-2) ..= 3*2^(7n-2) - 1: the top quarter of the last septet is negative.
    let fits = |quarter: i32| (value.wrapping_add(quarter) as u32) < 4 * quarter as u32;
    let mut shift = if fits(1 << 5) {
        0
    } else if fits(1 << 12) {
        7
    } else if fits(1 << 19) {
        14
    } else if fits(1 << 26) {
        21
    } else {
        28
    };
    while shift > 0 {
        if !sink.put((value >> shift) as u8 | 0x80) {
            return false;
        }
        shift -= 7;
    }
    sink.put((value & 0x7f) as u8)
}

/// Takes one integer off the front of `bytes`; `None` when it is cut off or longer than five bytes.
pub fn decode(bytes: &mut &[u8]) -> Option<i32> {
    let (&first, mut rest) = bytes.split_first()?;
    let mut value = u32::from(first & 0x7f);
    if first & 0x60 == 0x60 {
        value |= !0x1f;
    }
    let mut byte = first;
    let mut taken = 1;
    while byte & 0x80 != 0 {
        if taken == VLQ_BYTES_MAX {
            return None;
        }
        (byte, rest) = rest.split_first().map(|(&b, r)| (b, r))?;
        value = (value << 7) | u32::from(byte & 0x7f);
        taken += 1;
    }
    *bytes = rest;
    Some(value as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn encoded(value: i32) -> Vec<u8> {
        let mut out = Vec::new();
        assert!(encode(value, &mut out));
        out
    }

    #[test]
    fn lengths_change_where_the_protocol_says() {
        for (value, len) in [
            (0, 1),
            (95, 1),
            (96, 2),
            (-32, 1),
            (-33, 2),
            (12287, 2),
            (12288, 3),
            (-4096, 2),
            (-4097, 3),
            (1_572_863, 3),
            (1_572_864, 4),
            (-524_288, 3),
            (-524_289, 4),
            (201_326_591, 4),
            (201_326_592, 5),
            (-67_108_864, 4),
            (-67_108_865, 5),
            (i32::MAX, 5),
            (i32::MIN, 5),
        ] {
            assert_eq!(encoded(value).len(), len, "{value}");
        }
    }

    #[test]
    fn a_full_sink_is_reported() {
        let mut buffer = [0; 2];
        let mut sink = SliceSink::new(&mut buffer);
        assert!(!encode(1_000_000, &mut sink));
        assert_eq!(sink.len(), 2);
    }

    #[test]
    fn cut_off_and_overlong_integers_are_refused() {
        assert_eq!(decode(&mut &[][..]), None);
        assert_eq!(decode(&mut &[0x81][..]), None);
        assert_eq!(decode(&mut &[0x81, 0x80, 0x80, 0x80, 0x80, 0x00][..]), None);
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_decoded(value: i32, tail: Vec<u8>) {
            let mut bytes = encoded(value);
            prop_assert!(bytes.len() <= VLQ_BYTES_MAX);
            bytes.extend(&tail);
            let mut rest = &bytes[..];
            prop_assert_eq!(decode(&mut rest), Some(value));
            prop_assert_eq!(rest, &tail[..]);
        }

        #[test]
        fn garbage_never_panics(bytes: Vec<u8>) {
            let mut rest = &bytes[..];
            while decode(&mut rest).is_some() {}
        }
    }
}
