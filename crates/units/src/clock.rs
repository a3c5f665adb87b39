//! The board's clock: 64 bits in the host, 32 bits on the wire and in the firmware.

use core::ops::{Add, AddAssign, Sub};

/// A point on, or a stretch of, the board's 64-bit clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Ticks(pub u64);

impl Ticks {
    /// The low 32 bits, as sent on the wire.
    pub const fn low(self) -> Clock32 {
        Clock32(self.0 as u32)
    }

    /// The difference, or zero where `other` is later.
    #[must_use]
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// The 64-bit clock nearest to `self` whose low 32 bits are `low`: right as long as the two are less than
    /// 2³¹ ticks apart.
    #[must_use]
    pub const fn nearest(self, low: Clock32) -> Self {
        let diff = low.0.wrapping_sub(self.0 as u32) as i32;
        Self(self.0.wrapping_add_signed(diff as i64))
    }
}

impl Add for Ticks {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl AddAssign for Ticks {
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}

impl Sub for Ticks {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

/// The low 32 bits of the board's clock. It wraps; only differences below 2³¹ have a meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Clock32(pub u32);

impl Clock32 {
    /// Whether this clock comes before `other`.
    pub const fn is_before(self, other: Self) -> bool {
        (self.0.wrapping_sub(other.0) as i32) < 0
    }

    /// `self` moved on by `ticks`, wrapping.
    #[must_use]
    pub const fn wrapping_add(self, ticks: u32) -> Self {
        Self(self.0.wrapping_add(ticks))
    }

    /// Ticks from `earlier` to `self`, negative where `self` comes first.
    pub const fn since(self, earlier: Self) -> i32 {
        self.0.wrapping_sub(earlier.0) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_survives_the_wrap() {
        assert!(Clock32(u32::MAX).is_before(Clock32(5)));
        assert!(!Clock32(5).is_before(Clock32(u32::MAX)));
        assert!(!Clock32(7).is_before(Clock32(7)));
        assert_eq!(Clock32(5).since(Clock32(u32::MAX)), 6);
    }

    #[test]
    fn the_nearest_clock_is_found_on_both_sides_of_a_wrap() {
        let reference = Ticks(0x3_0000_0005);
        assert_eq!(reference.nearest(Clock32(0xffff_fff0)), Ticks(0x2_ffff_fff0));
        assert_eq!(reference.nearest(Clock32(0x10)), Ticks(0x3_0000_0010));
    }
}
