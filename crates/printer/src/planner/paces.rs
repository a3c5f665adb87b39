//! The paces of moves that have been pushed and not yet planned. Knows moves by their numbers.

use std::collections::VecDeque;

use crate::pace::Pace;

/// No more of them than there are such moves, and one: each holds from its move on.
#[derive(Clone, Debug, Default)]
pub(super) struct Paces(VecDeque<(u64, Pace)>);

impl Paces {
    /// From this move on.
    pub(super) fn push(&mut self, from: u64, pace: Pace) {
        if self.0.back().is_none_or(|(_, last)| *last != pace) {
            self.0.push_back((from, pace));
        }
    }

    /// Of a move, after those before it.
    pub(super) fn take(&mut self, of: u64) -> Pace {
        while self.0.get(1).is_some_and(|(from, _)| *from <= of) {
            self.0.pop_front();
        }
        self.0.front().map_or_else(Pace::default, |(_, pace)| *pace)
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_move_has_the_pace_that_it_was_pushed_with() {
        let mut paces = Paces::default();
        assert_eq!(paces.take(0), Pace::default());
        let of = |number: u64| Pace { factor: 1.0 + (number / 3) as f64, changes: (number / 5) as u32 };
        let mut planned = 0;
        for number in 0..200 {
            paces.push(number, of(number));
            assert!(paces.0.len() as u64 <= number - planned + 1);
            while planned + 17 < number {
                assert_eq!(paces.take(planned), of(planned));
                planned += 1;
            }
        }
        for number in planned..200 {
            assert_eq!(paces.take(number), of(number));
        }
        assert_eq!(paces.0.len(), 1);
    }
}
