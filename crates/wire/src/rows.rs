//! The check over rows of steps, by which host and board know that they speak of the same ones.
//!
//! CRC-32/ISO-HDLC (reflected 0x04c11db7, start and final xor all ones) over nine bytes a row, little-endian, in the order
//! in which the board took the rows: `interval` (4), `count` (2), `add` (2), direction (1: 0 or 1). No rows give 0.

use crate::check::CRC_32;

const ROW_BYTES: usize = 9;

/// The check over the rows so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RowCheck(u32);

impl RowCheck {
    /// The check over no rows.
    pub const fn new() -> Self {
        Self(0)
    }

    /// Goes on from a value that [`Self::value`] gave.
    pub const fn from_value(value: u32) -> Self {
        Self(value)
    }

    /// Adds a row: a `queue_step` and the direction of the `set_next_step_dir` before it.
    pub fn add(&mut self, interval: u32, count: u16, add: i16, forward: bool) {
        let mut row = [0; ROW_BYTES];
        row[..4].copy_from_slice(&interval.to_le_bytes());
        row[4..6].copy_from_slice(&count.to_le_bytes());
        row[6..8].copy_from_slice(&add.to_le_bytes());
        row[8] = forward.into();
        // The register is the value without its final xor, in the order of bits in which the algorithm states it.
        let mut digest = CRC_32.digest_with_initial((!self.0).reverse_bits());
        digest.update(&row);
        self.0 = digest.finalize();
    }

    /// The check's value.
    pub const fn value(self) -> u32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn row_by_row_it_is_the_check_of_all_bytes(rows: Vec<(u32, u16, i16, bool)>) {
            let mut check = RowCheck::new();
            let mut bytes = Vec::new();
            for &(interval, count, add, forward) in &rows {
                check.add(interval, count, add, forward);
                bytes.extend(interval.to_le_bytes());
                bytes.extend(count.to_le_bytes());
                bytes.extend(add.to_le_bytes());
                bytes.push(forward.into());
                check = RowCheck::from_value(check.value());
            }
            prop_assert_eq!(check.value(), CRC_32.checksum(&bytes));
        }
    }
}
