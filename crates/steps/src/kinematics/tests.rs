//! Motors against axes over the whole volume: there and back, along stretches, and step by step.

use super::*;
use crate::filter_tests::{all_filters, commands, generator, plan, state};
use crate::tests::{CLOCK, STEP_DISTANCES, decompress};
use crate::{Advance, Filters};
use proptest::prelude::*;
use units::{Mm, StepCount};

const NONE: Advance = Advance::NONE;

fn core_xy() -> Geometry {
    let shares = [[1.0, 1.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    Geometry::Linear(Linear::new(shares).unwrap())
}

fn hybrid_core_xz() -> Geometry {
    let shares = [[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    Geometry::Linear(Linear::new(shares).unwrap())
}

/// A delta of a usual size whose towers and arms are not quite alike.
fn uneven() -> Delta {
    let tower = |angle, arm| Tower { angle, arm_length: Mm(arm) };
    Delta::new(Mm(134.0), [tower(210.3, 270.0), tower(329.6, 270.8), tower(90.1, 269.5)]).unwrap()
}

/// A place within reach: a share of the radius, an angle, a height.
fn place([share, angle, z]: [f64; 3]) -> [f64; 3] {
    let radius = uneven().reach() * share;
    [radius * libm::cos(angle), radius * libm::sin(angle), z]
}

fn any_place() -> impl Strategy<Value = [f64; 3]> {
    [0.0..1.0_f64, 0.0..6.3_f64, -5.0..300.0_f64].prop_map(place)
}

fn any_segment() -> impl Strategy<Value = Segment> {
    (-200.0..200.0_f64, [-80.0..80.0_f64, -60.0..60.0, -30.0..30.0, -20.0..20.0, -9.0..9.0]).prop_map(
        |(start, powers)| {
            let segment = Segment { start_time: 3.0, duration: 0.7, start, end: 0.0, powers };
            Segment { end: start + segment.way(0.7), ..segment }
        },
    )
}

/// The segments of a motor follow each other, from the stretch's start to its end, and are where the motor has to be.
fn follows(geometry: &Geometry, motor: usize, stretch: &[Segment; AXES], error: f64) {
    let mut segments = Vec::new();
    geometry.motor_segments(motor, stretch, &mut segments);
    let (first, last) = (segments[0], segments[segments.len() - 1]);
    assert_eq!(first.start_time, stretch[0].start_time);
    assert!((last.end_time() - stretch[0].end_time()).abs() < 1e-12);
    let ends = stretch.each_ref().map(|segment| segment.end);
    assert!((last.end - geometry.motor_position(motor, &ends)).abs() < 1e-9);
    for pair in segments.windows(2) {
        assert!((pair[0].end_time() - pair[1].start_time).abs() < 1e-12);
        assert_eq!(pair[0].end, pair[1].start);
        let [c1, c2, c3, c4, c5] = pair[0].powers;
        let t = pair[0].duration;
        let speed = c1 + (2.0 * c2 + (3.0 * c3 + (4.0 * c4 + 5.0 * c5 * t) * t) * t) * t;
        assert!((speed - pair[1].powers[0]).abs() < 1e-6, "{speed} {}", pair[1].powers[0]);
    }
    for segment in &segments {
        for part in 0..=20 {
            let t = segment.duration * f64::from(part) / 20.0;
            let since = segment.start_time + t - stretch[0].start_time;
            let at = stretch.each_ref().map(|axis| axis.start + axis.way(since));
            let off = segment.start + segment.way(t) - geometry.motor_position(motor, &at);
            assert!(off.abs() <= error, "{off} mm at {since} s of {} pieces", segments.len());
        }
    }
}

/// Every motor ends where its moves do, and each step comes when the motor's exact path is half-way.
fn steps_as_exact(geometry: &Geometry, points: &[([f64; 4], f64)], filters: &Filters) {
    let mut generator = generator(*geometry, filters, &NONE);
    let planned = plan(points[0].0, &points[1..], generator.lead());
    let late = commands(&mut generator, &planned, false);
    assert_eq!(late, commands(&mut generator, &planned, true));
    let (start, end) = (points[0].0, planned[planned.len() - 1].to);
    for (motor, distance) in STEP_DISTANCES.iter().enumerate() {
        let count_at =
            |at: &[f64; 4]| (geometry.motor_position(motor, at) * (1.0 / distance) + 0.5).floor() as i64;
        let mut count = count_at(&start);
        let steps = decompress(&late, motor);
        let stride = (steps.len() / 200).max(1);
        for (index, &(clock, forward)) in steps.iter().enumerate() {
            let sign = if forward { 1.0 } else { -1.0 };
            let edge = (count as f64 + 0.5 * sign) * distance;
            count += sign as i64;
            if filters != &Filters::default() || index % stride != 0 {
                continue;
            }
            let at = |off: f64| {
                let time = clock as f64 / f64::from(CLOCK.0) + off;
                let head = core::array::from_fn(|axis| state(&planned, axis, time).0);
                geometry.motor_position(motor, &head)
            };
            let ends = [at(-25.5e-6), at(0.0), at(25.5e-6)];
            let low = ends.iter().copied().fold(f64::INFINITY, f64::min) - 2e-5;
            let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 2e-5;
            assert!((low..=high).contains(&edge), "step {index} of {motor}: {edge} not in {low} ..= {high}");
        }
        assert_eq!(count, count_at(&end), "motor {motor}");
        assert_eq!(generator.motor_steps(motor), StepCount(count));
    }
}

proptest! {
    #[test]
    fn linear_machines_find_their_head_from_their_motors(at in [-400.0..400.0_f64, -400.0..400.0_f64, -9.0..400.0_f64, -1e4..1e4_f64]) {
        for geometry in [core_xy(), hybrid_core_xz()] {
            let back = geometry.position(&geometry.motor_positions(&at)).unwrap();
            for axis in 0..AXES {
                prop_assert!((back[axis] - at[axis]).abs() < 1e-9, "{:?} {:?}", at, back);
            }
        }
    }

    #[test]
    fn a_delta_finds_its_head_from_its_carriages([x, y, z] in any_place(), e in -1e3..1e3_f64) {
        let at = [x, y, z, e];
        let delta = Geometry::Delta(uneven());
        let back = delta.position(&delta.motor_positions(&at)).unwrap();
        for axis in 0..AXES {
            prop_assert!((back[axis] - at[axis]).abs() < 1e-9, "{:?} {:?}", at, back);
        }
        for tower in 0..3 {
            prop_assert!(uneven().stretch_ratio(tower, x, y) <= STRETCH_RATIO_MAX + 1e-9);
        }
    }

    #[test]
    fn sums_of_axes_are_exact(stretch in [any_segment(), any_segment(), any_segment(), any_segment()]) {
        for geometry in [core_xy(), hybrid_core_xz()] {
            for motor in 0..AXES {
                follows(&geometry, motor, &stretch, 1e-9);
            }
        }
    }

    #[test]
    fn carriages_are_followed_within_the_stated_error(
        from in any_place(), to in any_place(), bend in -9.0..9.0_f64, e in any_segment(), duration in 0.001..20.0_f64,
    ) {
        // From place to place, with a bend as a shaper makes it; both stay within the arms' length.
        let axis = |axis: usize| {
            let way = to[axis] - from[axis];
            let bend = if axis == 2 { 0.0 } else { bend };
            let powers = [1.0, 3.0 * way + bend, -2.0 * way - 2.0 * bend, bend - 1.0, 0.0];
            let mut segment = Segment { start_time: 1.0, duration, start: from[axis], end: 0.0, powers };
            let mut scale = 1.0;
            for power in &mut segment.powers {
                scale *= duration;
                *power /= scale;
            }
            Segment { end: segment.start + segment.way(duration), ..segment }
        };
        let stretch = [axis(0), axis(1), axis(2), Segment { start_time: 1.0, duration, ..e }];
        for tower in 0..3 {
            follows(&Geometry::Delta(uneven()), tower, &stretch, 1e-5);
        }
    }

    #[test]
    fn the_highest_place_of_a_carriage_is_known(from in any_place(), to in any_place()) {
        let delta = uneven();
        for tower in 0..3 {
            let highest = delta.highest(tower, from, to);
            let at = |share: f64| {
                let at: [f64; 3] = core::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * share);
                delta.motor_position(tower, &[at[0], at[1], at[2], 0.0])
            };
            let found = (0..=1000).map(|part| at(f64::from(part) / 1000.0)).fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(highest >= found - 1e-9 && highest <= found + 0.01, "{} {}", highest, found);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn steps_are_those_of_the_exact_path(
        places in proptest::collection::vec((any_place(), -5.0..5.0_f64, 5.0..200.0_f64), 2..7),
        filtered in any::<bool>(),
    ) {
        let points: Vec<_> = places.iter().map(|&([x, y, z], e, feed)| ([x, y, z, e], feed)).collect();
        let filters = if filtered { all_filters() } else { Filters::default() };
        for geometry in &[core_xy(), hybrid_core_xz(), Geometry::Delta(uneven())] {
            steps_as_exact(geometry, &points, &filters);
        }
    }
}

#[test]
fn a_motor_whose_axes_cancel_each_other_stands_still() {
    let mut generator = generator(core_xy(), &Filters::default(), &NONE);
    // Half-way between two steps, where rounding alone would make some.
    let half = 0.5 * STEP_DISTANCES[1];
    let points: Vec<_> =
        (1..50).map(|n| ([half + 1.1 * f64::from(n), 1.1 * f64::from(n), 0.0, 0.0], 80.0)).collect();
    let planned = plan([half, 0.0, 0.0, 0.0], &points, generator.lead());
    let made = decompress(&commands(&mut generator, &planned, false), 1);
    assert!(made.len() <= 2, "{} steps", made.len());
}

#[test]
fn axes_that_hang_together_are_named() {
    let only = |axis: usize| core::array::from_fn(|it| it == axis);
    assert_eq!(core_xy().coupled(only(0)), [true, true, false, false]);
    assert_eq!(core_xy().coupled(only(2)), only(2));
    assert_eq!(core_xy().motors_of(1), [true, true, false, false]);
    assert_eq!(hybrid_core_xz().motors_of(0), only(0));
    assert_eq!(hybrid_core_xz().motors_of(2), [true, false, true, false]);
    assert_eq!(hybrid_core_xz().coupled(only(0)), [true, false, true, false]);
    assert_eq!(Geometry::Delta(uneven()).coupled(only(1)), [true, true, true, false]);
    assert_eq!(Geometry::Cartesian.coupled(only(3)), only(3));
}

#[test]
fn what_cannot_hold_a_head_is_no_machine() {
    let tower = |angle, arm| Tower { angle, arm_length: Mm(arm) };
    let usual = [tower(210.0, 270.0), tower(330.0, 270.0), tower(90.0, 270.0)];
    assert!(Delta::new(Mm(134.0), usual).is_some());
    assert!(Delta::new(Mm(271.0), usual).is_none());
    assert!(Delta::new(Mm(f64::NAN), usual).is_none());
    assert!(Delta::new(Mm(134.0), [usual[0], usual[0], usual[1]]).is_none());
    assert!(Linear::new([[1.0, 1.0, 0.0, 0.0]; 4]).is_none());
    let delta = Geometry::Delta(uneven());
    assert!(delta.motor_position(0, &[500.0, 0.0, 0.0, 0.0]).is_nan());
    assert_eq!(delta.position(&[0.0, 1000.0, 0.0, 0.0]), None);
}
