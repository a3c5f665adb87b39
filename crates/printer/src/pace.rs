//! With which speed factor a move is planned, and how motion that was planned before the user changed it follows: by its rate
//! on the board's motion clock, which is never above 1.
//!
//! Knows no board. Factors as of `M220`, 1 is as written.

/// The full rate, in the unit of the wire.
pub(crate) const RATE_ONE: u16 = 4096;

/// A speed factor, and how often the user had set it by then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// The file may have changed it meanwhile.
    pub factor: f64,
    /// Of the user alone.
    pub changes: u32,
}

impl Default for Pace {
    fn default() -> Self {
        Self { factor: 1.0, changes: 0 }
    }
}

impl Pace {
    /// The rate, in 1/[`RATE_ONE`], at which motion that was planned so goes no faster than the user `wants` it. What was
    /// planned since the user's last word is as it should be, and nothing goes faster than it was planned.
    pub(crate) fn rate(self, wanted: Self) -> u16 {
        if self.changes == wanted.changes {
            return RATE_ONE;
        }
        let one = f64::from(RATE_ONE);
        let rate = wanted.factor / self.factor * one;
        if rate.is_nan() { RATE_ONE } else { rate.clamp(1.0, one) as u16 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn pace(factor: f64, changes: u32) -> Pace {
        Pace { factor, changes }
    }

    #[test]
    fn what_was_planned_before_is_slowed_and_never_hurried() {
        let wanted = pace(0.5, 2);
        assert_eq!(pace(1.0, 1).rate(wanted), 2048);
        assert_eq!(pace(0.8, 0).rate(wanted), 2560);
        assert_eq!(pace(0.4, 1).rate(wanted), RATE_ONE);
        assert_eq!(pace(10.0, 1).rate(pace(0.01, 2)), 4);
        assert_eq!(pace(f64::INFINITY, 1).rate(wanted), 1);
        assert_eq!(pace(0.0, 1).rate(pace(0.0, 2)), RATE_ONE);
        // What the file set since is the file's.
        assert_eq!(pace(1.0, 2).rate(wanted), RATE_ONE);
    }
}
