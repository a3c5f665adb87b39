//! Rows of steps, as a board counts them and as a plan has them. Units: ticks, on the motion clock or from a run's start.

use units::{Clock32, Ticks};

use crate::machine::MOTORS;

/// What a board says of one motor's rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MotorQueue {
    pub(crate) received: u32,
    pub(crate) done: u32,
    /// Steps of the row after those that are done that have not begun.
    pub(crate) left: u16,
    /// The motion clock of the next step.
    pub(crate) next: Clock32,
    /// The level of the direction pin for the steps that are left.
    pub(crate) dir: bool,
    /// Steps counted since power-up.
    pub(crate) position: i32,
    pub(crate) crc: u32,
}

/// What a board says of all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BoardQueue {
    /// The number under which it counts.
    pub(crate) id: u32,
    /// Motion was brought to rest where it is; else it has come to its end by itself.
    pub(crate) is_held: bool,
    pub(crate) motors: [MotorQueue; MOTORS],
}

/// Steps of one motor that are to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) interval: u32,
    pub(crate) count: u16,
    pub(crate) add: i16,
    /// Towards larger positions.
    pub(crate) forward: bool,
    /// When the step before the first was due.
    pub(crate) start: Ticks,
    /// When the last is due.
    pub(crate) end: Ticks,
}

impl Row {
    /// The last `left` steps of it.
    pub(crate) fn tail(self, left: u16) -> Self {
        let made = i64::from(self.count - left);
        if made == 0 {
            return self;
        }
        let (interval, add) = (i64::from(self.interval), i64::from(self.add));
        let before = made * interval + add * (made * (made - 1) / 2);
        Self {
            interval: (interval + add * made) as u32,
            count: left,
            start: Ticks(self.start.0.saturating_add_signed(before)),
            ..self
        }
    }

    /// When its first step is due.
    pub(crate) fn first(&self) -> Ticks {
        // A single step after a long rest has an interval modulo 2³²: its own clock is what counts.
        if self.count == 1 { self.end } else { self.start + Ticks(u64::from(self.interval)) }
    }

    pub(super) const fn counted(&self, steps: u16) -> i32 {
        if self.forward { steps as i32 } else { -(steps as i32) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_rest_of_a_row_has_its_last_steps(
            interval in 1000_u32..100_000, count in 1_u16..50, add in -10_i16..10, made in 0_u16..50
        ) {
            let made = made % count;
            let clocks = |row: &Row| -> Vec<u64> {
                let steps = (0..i64::from(row.count)).map(|at| i64::from(row.interval) + at * i64::from(row.add));
                let due = steps.scan(row.start.0, |clock, gap| {
                    *clock = clock.saturating_add_signed(gap);
                    Some(*clock)
                });
                due.collect()
            };
            let whole = Row { interval, count, add, forward: true, start: Ticks(77), end: Ticks(0) };
            let whole = Row { end: Ticks(*clocks(&whole).last().unwrap()), ..whole };
            let rest = whole.tail(count - made);
            prop_assert_eq!(&clocks(&rest)[..], &clocks(&whole)[usize::from(made)..]);
            prop_assert_eq!(rest.first(), Ticks(clocks(&rest)[0]));
            prop_assert_eq!(rest.counted(rest.count) + whole.counted(made), whole.counted(count));
        }
    }
}
