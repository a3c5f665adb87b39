//! Commands do not depend on how many steps are taken at a time, and looking ahead keeps every bound.

use super::*;
use crate::Segment;
use crate::crossing::Grid;
use proptest::prelude::*;

/// The commands for pieces of the given speeds, taken by pieces and one by one.
fn both_ways(search: StepSearch, velocities: &[f64], bend: f64) -> [Compressor; 2] {
    let grid = Grid { steps_per_mm: 100.0, ticks_per_s: 12e6 };
    let [mut together, mut alone] = [0; 2].map(|motor| Compressor::new(motor, 12e6, Seconds(25e-6), search));
    let (mut start_time, mut start, mut count) = (1.0, 0.0, 0);
    for &velocity in velocities {
        let powers = [velocity, bend * velocity, 0.0, 0.0, 0.0];
        let mut segment = Segment { start_time, duration: 2.0, start, end: 0.0, powers };
        segment.end = start + segment.way(2.0);
        (start_time, start) = (start_time + 2.0, segment.end);
        grid.split(&segment, &mut count, &mut |mut piece| {
            let mut times = Vec::new();
            let mut copy = piece;
            copy.append_times(piece.steps as u32, &mut times);
            for time in times {
                alone.step(time, copy.forward);
            }
            while piece.steps > 0 {
                together.take_from(&mut piece);
            }
        });
    }
    together.end();
    alone.end();
    [together, alone]
}

#[test]
fn steps_taken_together_are_packed_as_one_by_one() {
    // From 3000 steps a second down to one in 140 ms, in turns that are quick, too long for a command, and held back.
    for search in [StepSearch::Usual, StepSearch::Ahead] {
        let [together, alone] = both_ways(search, &[30.0, 10.0, 5.0, 2.5, 1.0, 0.5, 0.07_f64, 4.0], -0.02);
        assert!(together.out.len() > 20 && together.tally.queue_steps > 20);
        assert_eq!(together.out, alone.out);
    }
}

proptest! {
    #[test]
    fn a_turn_may_come_at_any_time(
        velocities in proptest::collection::vec(-20.0..20.0_f64, 1..12),
        bend in -0.6..0.6_f64,
        search in prop_oneof![Just(StepSearch::Usual), Just(StepSearch::Ahead)],
    ) {
        let [together, alone] = both_ways(search, &velocities, bend);
        prop_assert!(together.tally.error_max <= 25e-6 * 12e6 + 7.0);
        prop_assert_eq!(&together.out, &alone.out);
        let steps = |compressor: &Compressor| compressor.tally.steps;
        prop_assert_eq!(steps(&together), steps(&alone));
    }
}
