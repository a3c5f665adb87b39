//! A sensor's curve: from sums of readings to temperatures, by straight lines between points that the host gave.
//!
//! Knows no sensor and no converter. Temperatures in 1/1000 °C.

use wire::ShutdownReason;

/// The most points of a curve.
pub(crate) const POINTS_MAX: usize = 32;
/// What a point may say.
const MILLI_RANGE: core::ops::RangeInclusive<i32> = -300_000..=2_000_000;

pub(crate) struct Table {
    sums: [u16; POINTS_MAX],
    milli: [i32; POINTS_MAX],
    len: u8,
}

impl Table {
    pub(crate) const fn new() -> Self {
        Self { sums: [0; POINTS_MAX], milli: [0; POINTS_MAX], len: 0 }
    }

    /// Whether there is a line to read from.
    pub(crate) const fn is_complete(&self) -> bool {
        self.len >= 2
    }

    fn points(&self) -> (&[u16], &[i32]) {
        let len = usize::from(self.len);
        (&self.sums[..len], &self.milli[..len])
    }

    /// Adds a point: at a higher sum than the last, and the curve goes only up or only down.
    pub(crate) fn add(&mut self, sum: u16, milli: i32) -> Result<(), ShutdownReason> {
        const WRONG: ShutdownReason = ShutdownReason::InvalidHeater;
        let at = usize::from(self.len);
        if at >= POINTS_MAX || !MILLI_RANGE.contains(&milli) {
            return Err(WRONG);
        }
        let (sums, known) = self.points();
        if let (Some(&last_sum), Some(&last)) = (sums.last(), known.last()) {
            let turns = known.first().is_some_and(|&first| first != last && (first < last) != (last < milli));
            if sum <= last_sum || milli == last || turns {
                return Err(WRONG);
            }
        }
        self.sums[at] = sum;
        self.milli[at] = milli;
        self.len += 1;
        Ok(())
    }

    /// The temperature of a sum; nothing outside of the curve.
    pub(crate) fn read(&self, sum: u16) -> Option<i32> {
        let (sums, milli) = self.points();
        let above = sums.partition_point(|&point| point < sum);
        let (&high_sum, &high) = sums.get(above).zip(milli.get(above))?;
        if high_sum == sum {
            return Some(high);
        }
        let below = above.checked_sub(1)?;
        let (low_sum, low) = (sums[below], milli[below]);
        let part = i64::from(high - low) * i64::from(sum - low_sum) / i64::from(high_sum - low_sum);
        Some(low + part as i32)
    }

    /// Whether a temperature lies on the curve.
    pub(crate) fn contains(&self, milli: i32) -> bool {
        let (_, known) = self.points();
        match (known.first(), known.last()) {
            (Some(&one), Some(&other)) => (one.min(other)..=one.max(other)).contains(&milli),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn table(points: &[(u16, i32)]) -> Result<Table, ShutdownReason> {
        let mut table = Table::new();
        points.iter().try_for_each(|&(sum, milli)| table.add(sum, milli))?;
        Ok(table)
    }

    #[test]
    fn between_its_points_it_is_straight_and_beyond_them_it_says_nothing() {
        let table = table(&[(100, 200_000), (300, 100_000), (65_535, -300_000)]).unwrap();
        assert_eq!([100, 200, 300].map(|sum| table.read(sum)), [200_000, 150_000, 100_000].map(Some));
        assert_eq!((table.read(99), table.read(65_535)), (None, Some(-300_000)));
        assert!(table.contains(150_000) && !table.contains(200_001));
        assert_eq!(Table::new().read(0), None);
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        for points in [
            &[(1, 0), (1, 5)][..],
            &[(2, 0), (1, 5)],
            &[(1, 5), (2, 5)],
            &[(1, 5), (2, 6), (3, 5)],
            &[(1, 5), (2, 4), (3, 7)],
            &[(1, 2_000_001)],
            &[(1, -300_001)],
        ] {
            assert!(table(points).is_err(), "{points:?}");
        }
        let many: Vec<_> = (0..=POINTS_MAX as i32).map(|at| (at as u16, at)).collect();
        assert!(table(&many[..POINTS_MAX]).is_ok() && table(&many).is_err());
    }

    proptest! {
        #[test]
        fn it_is_monotone_and_never_beyond_its_points(
            mut sums in prop::collection::vec(any::<u16>(), 2..POINTS_MAX),
            mut milli in prop::collection::vec(-300_000..2_000_000_i32, 2..POINTS_MAX),
            falls: bool,
        ) {
            sums.sort_unstable();
            sums.dedup();
            milli.sort_unstable();
            milli.dedup();
            if falls {
                milli.reverse();
            }
            let points: Vec<_> = sums.into_iter().zip(milli).collect();
            let table = table(&points).unwrap();
            let (first, last) = (points[0], points[points.len() - 1]);
            let mut before = first.1;
            for sum in (first.0..=last.0).step_by(7) {
                let read = table.read(sum).unwrap();
                prop_assert!(read == before || (read < before) == falls);
                prop_assert!(table.contains(read));
                before = read;
            }
        }
    }
}
