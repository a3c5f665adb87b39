//! The motion clock: the time that steps are planned in, which the board may slow down and stop.
//!
//! It goes through **slices** of constant rate. Inside a slice `motion = m0 + (f + (c - c0)·r) / 2¹⁶`, rounded down, with
//! `c` the hardware clock, `r` the rate in 1/65536 and `f` the fraction that the slice before left over: exact in
//! integers, so that nothing drifts. At the full rate it is the hardware clock and an offset, and slices have no end.
//!
//! The rate is never above 1: from one tick to the next the motion clock moves by one tick or not at all, so that what
//! is apart in motion ticks is at least as far apart in hardware ticks.
//!
//! Cost on a Cortex-M0+, which multiplies 32 by 32 bits in hardware and divides in software: at the full rate a compare
//! and an addition; inside a ramp a division of 64 by 32 bits for each step (a few hundred cycles).
//!
//! Knows nothing of why the rate changes.

use units::Clock32;

/// The full rate.
pub(crate) const RATE_ONE: u32 = 1 << RATE_BITS;
const RATE_BITS: u32 = 16;
/// The longest slice below the full rate: distances within it are far below what 64 bits hold once multiplied.
pub(crate) const SLICE_TICKS_MAX: u32 = 1 << 26;

pub(crate) struct MotionClock {
    /// In 1/65536, 1 at most.
    rate: u32,
    /// At the full rate, and only there: motion less hardware clock.
    offset: u32,
    /// Where the slice begins, on both clocks, with the fraction of a motion tick in 1/65536.
    start: Clock32,
    motion: Clock32,
    fraction: u32,
    /// Motion ticks until the end of the slice.
    reach: u32,
}

impl MotionClock {
    /// The hardware clock itself.
    pub(crate) const fn new() -> Self {
        Self { rate: RATE_ONE, offset: 0, start: Clock32(0), motion: Clock32(0), fraction: 0, reach: 0 }
    }

    pub(crate) const fn rate(&self) -> u32 {
        self.rate
    }

    /// Begins a slice of `ticks` (at most [`SLICE_TICKS_MAX`]) at the clock `at`; at the full rate it has no end.
    pub(crate) fn begin(&mut self, at: Clock32, rate: u32, ticks: u32) {
        (self.motion, self.fraction) = self.read(at);
        self.start = at;
        self.rate = rate;
        self.offset = self.motion.0.wrapping_sub(at.0);
        self.reach = (self.scaled(ticks) >> RATE_BITS) as u32;
    }

    /// The motion clock when the hardware clock is `clock`, which is not before the slice.
    pub(crate) fn motion(&self, clock: Clock32) -> Clock32 {
        self.read(clock).0
    }

    fn read(&self, clock: Clock32) -> (Clock32, u32) {
        if self.rate == RATE_ONE {
            return (clock.wrapping_add(self.offset), self.fraction);
        }
        let scaled = self.scaled(clock.0.wrapping_sub(self.start.0));
        (self.motion.wrapping_add((scaled >> RATE_BITS) as u32), scaled as u32 % RATE_ONE)
    }

    /// Motion ticks after so many hardware ticks of the slice, in 1/65536.
    fn scaled(&self, ticks: u32) -> u64 {
        u64::from(self.fraction) + u64::from(ticks) * u64::from(self.rate)
    }

    /// The first hardware clock at which the motion clock has reached `motion`; `None` where that is not in this slice.
    ///
    /// What was reached before the slice is taken as if the rate had been 1, for lateness to be judged by.
    #[inline]
    pub(crate) fn when(&self, motion: Clock32) -> Option<Clock32> {
        if self.rate == RATE_ONE {
            return Some(motion.wrapping_add(self.offset.wrapping_neg()));
        }
        self.when_slow(motion)
    }

    #[inline(never)]
    fn when_slow(&self, motion: Clock32) -> Option<Clock32> {
        let ahead = motion.since(self.motion);
        let Ok(wanted) = u32::try_from(ahead) else { return Some(self.start.wrapping_add(ahead as u32)) };
        if wanted == 0 {
            return Some(self.start);
        }
        if wanted > self.reach {
            return None;
        }
        // The rate is not 0, else nothing would be within reach; the fraction is below one tick.
        let scaled = (u64::from(wanted) << RATE_BITS) - u64::from(self.fraction);
        Some(self.start.wrapping_add(scaled.div_ceil(u64::from(self.rate)) as u32))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Slices as they come, both clocks anywhere.
        #[test]
        fn it_goes_by_one_tick_or_none_and_its_inverse_is_the_first_clock(
            start: u32,
            lead in 0..5000_u32,
            slices in prop::collection::vec((0..=RATE_ONE, 1..300_u32), 1..8),
        ) {
            let mut clock = MotionClock::new();
            // An offset from an earlier hold.
            clock.begin(Clock32(start), 0, lead);
            let mut now = Clock32(start).wrapping_add(lead);
            let mut ideal = u64::from(start) << RATE_BITS;
            let mut last = clock.motion(now);
            prop_assert_eq!(last, Clock32(start));
            for (rate, ticks) in slices {
                clock.begin(now, rate, ticks);
                for _ in 0..ticks {
                    now = now.wrapping_add(1);
                    ideal += u64::from(rate);
                    let motion = clock.motion(now);
                    prop_assert_eq!(motion, Clock32((ideal >> RATE_BITS) as u32));
                    let moved = motion.since(last);
                    prop_assert!(moved == 0 || moved == 1);
                    if moved == 1 {
                        prop_assert_eq!(clock.when(motion), Some(now));
                    }
                    last = motion;
                }
                if rate != RATE_ONE {
                    prop_assert_eq!(clock.when(last.wrapping_add(1)), None);
                }
            }
        }
    }

    #[test]
    fn what_is_past_is_as_late_as_it_is_in_motion() {
        let mut clock = MotionClock::new();
        clock.begin(Clock32(1000), RATE_ONE / 2, 100);
        assert_eq!(clock.when(Clock32(1000)), Some(Clock32(1000)));
        assert_eq!(clock.when(Clock32(990)), Some(Clock32(990)));
        assert_eq!(clock.when(Clock32(1050)), Some(Clock32(1100)));
        assert_eq!(clock.when(Clock32(1051)), None);
    }
}
