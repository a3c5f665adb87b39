//! Plans with a limited jerk: what holds at every moment, and what it costs.

use crate::{ExtruderLimits, Limits, LookAhead, MoveRequest, PlannedMove, Profile};
use proptest::prelude::*;
use units::{Mm, MmPerS, MmPerS2, MmPerS3, Seconds};

fn limits(accel: f64) -> Limits {
    Limits {
        max_velocity: MmPerS(300.0),
        max_accel: MmPerS2(accel),
        square_corner_velocity: MmPerS(5.0),
        minimum_cruise_ratio: 0.0,
        max_z_velocity: MmPerS(15.0),
        max_z_accel: MmPerS2(200.0),
        max_xy_velocity: Limits::ANY_VELOCITY,
        max_xy_accel: Limits::ANY_ACCEL,
        junction_deviation: None,
        extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(300.0), MmPerS2(accel)),
    }
}

fn plan(points: &[([f64; 4], f64)], limits: Limits, jerk: Option<f64>) -> Vec<PlannedMove> {
    let points: Vec<_> = points.iter().map(|&(to, feed)| (to, feed, limits)).collect();
    plan_each(&points, jerk, true)
}

/// The same with limits for each move; taken as they come, or all at the end.
fn plan_each(points: &[([f64; 4], f64, Limits)], jerk: Option<f64>, at_once: bool) -> Vec<PlannedMove> {
    let profile = Profile { motors: Vec::new(), max_jerk: jerk.map(MmPerS3) };
    let mut look_ahead = LookAhead::with_profile(points[0].2, profile).unwrap();
    let mut from = [0.0; 4];
    let mut planned = Vec::new();
    for (tag, &(to, feed, limits)) in points.iter().enumerate() {
        look_ahead.set_limits(limits).unwrap();
        look_ahead.push(&MoveRequest { from, to, feed: MmPerS(feed), tag: tag as u32 }).unwrap();
        if at_once {
            planned.extend(std::iter::from_fn(|| look_ahead.pop()));
        }
        from = to;
    }
    look_ahead.flush();
    planned.extend(std::iter::from_fn(|| look_ahead.pop()));
    assert!(look_ahead.is_empty());
    assert_eq!(look_ahead.print_time(), Seconds(planned.last().map_or(0.0, PlannedMove::end_time)));
    planned
}

/// Asserts that speed and acceleration go on without a jump, within their limits and below the trapezoids' speeds.
fn check(made: &[PlannedMove], trapezoids: &[PlannedMove], jerk: f64) {
    assert_eq!(made.len(), trapezoids.len());
    let (mut time, mut speed, mut accel) = (0.0, 0.0, 0.0);
    let mut direction: Option<[f64; 4]> = None;
    for (one, limit) in made.iter().zip(trapezoids) {
        assert_eq!((one.tag, one.from, one.to, one.length), (limit.tag, limit.from, limit.to, limit.length));
        assert!((one.start_time - time).abs() < 1e-9);
        time = one.end_time();
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-5 * scale;
        let mut distance = 0.0;
        let turn: f64 =
            direction.map_or(1.0, |before| (0..3).map(|axis| before[axis] * one.direction[axis]).sum());
        direction = Some(one.direction);
        if turn < 0.9962 && speed > 0.0 {
            accel = one.phases().next().unwrap().accel;
        }
        for phase in one.phases() {
            assert!(phase.jerk.abs() <= jerk * (1.0 + 1e-9), "{phase:?}");
            assert!(near(phase.velocity, speed, 100.0), "{phase:?} after {speed}");
            assert!(near(phase.accel, accel, limit.accel), "{phase:?} after {accel}");
            assert!(near(phase.start_distance, distance, 1.0));
            distance = phase.distance_at(phase.duration);
            assert!(near(phase.end_distance, distance, 1.0), "{phase:?} {distance}");
            speed = phase.velocity_at(phase.duration);
            accel = phase.accel + phase.jerk * phase.duration;
            for part in 0..=4 {
                let at = phase.velocity_at(phase.duration * f64::from(part) / 4.0);
                assert!(at >= -1e-6 && at <= limit.cruise_velocity * (1.0 + 1e-6) + 1e-6, "{at} {limit:?}");
                let pull = phase.accel + phase.jerk * phase.duration * f64::from(part) / 4.0;
                assert!(pull.abs() <= limit.accel * (1.0 + 1e-6), "{pull} of {}", limit.accel);
            }
        }
        assert!(near(distance, one.length, 1.0));
        assert!(one.end_velocity <= limit.end_velocity * (1.0 + 1e-6) + 1e-6, "{one:?} {limit:?}");
    }
    assert!(speed.abs() < 1e-3 && accel.abs() < 1.0, "{speed} {accel}");
}

#[test]
fn a_long_move_has_seven_phases() {
    let made = plan(&[([100.0, 0.0, 0.0, 0.0], 200.0)], limits(3000.0), Some(1e5));
    let phases: Vec<_> = made[0].phases().collect();
    assert_eq!(phases.len(), 7);
    // Δ/a + a/j both ways, and the rest along.
    assert!((made[0].accel_time - (200.0 / 3000.0 + 0.03)).abs() < 1e-9);
    assert!((made[0].decel_time - made[0].accel_time).abs() < 1e-9);
    assert!((made[0].cruise_velocity - 200.0).abs() < 1e-9);
    check(&made, &plan(&[([100.0, 0.0, 0.0, 0.0], 200.0)], limits(3000.0), None), 1e5);
}

#[test]
fn a_ramp_over_many_straight_pieces_is_that_of_one_move() {
    let whole = plan(&[([50.0, 0.0, 0.0, 0.0], 200.0)], limits(3000.0), Some(1e5));
    let pieces: Vec<_> = (1..=500).map(|index| ([0.1 * f64::from(index), 0.0, 0.0, 0.0], 200.0)).collect();
    let made = plan(&pieces, limits(3000.0), Some(1e5));
    let (a, b) = (whole[0].duration(), made.last().unwrap().end_time());
    assert!((a - b).abs() < 1e-6, "{a} {b}");
}

#[test]
fn a_smooth_path_longer_than_the_window_is_not_stopped_on() {
    // A straight one, and a circle of 100 mm, in pieces of a tenth of a millimetre.
    let straight: Vec<_> = (1..=6000).map(|index| ([0.1 * f64::from(index), 0.0, 0.0, 0.0], 200.0)).collect();
    let circle: Vec<_> = (1..=6000)
        .map(|index| {
            let angle = 0.001 * f64::from(index);
            ([100.0 * libm::sin(angle), 100.0 - 100.0 * libm::cos(angle), 0.0, 0.0], 200.0)
        })
        .collect();
    for points in [straight, circle] {
        let made = plan(&points, limits(3000.0), Some(1e5));
        check(&made, &plan(&points, limits(3000.0), None), 1e5);
        let slowest = made[500..5500].iter().map(|one| one.start_velocity).fold(f64::INFINITY, f64::min);
        assert!(slowest > 199.0, "{slowest}");
        let (whole, time) = (600.0 / 200.0 + 200.0 / 3000.0 + 0.03, made.last().unwrap().end_time());
        assert!((time / whole - 1.0).abs() < 0.001, "{time} {whole}");
    }
}

#[test]
fn long_moves_do_not_wait_for_hundreds_of_others() {
    let profile = Profile { motors: Vec::new(), max_jerk: Some(MmPerS3(1e5)) };
    let mut look_ahead = LookAhead::with_profile(limits(3000.0), profile).unwrap();
    let mut from = [0.0; 4];
    for index in 0..100 {
        let to = [f64::from(index % 2) * 100.0, f64::from(index), 0.0, 0.0];
        look_ahead.push(&MoveRequest { from, to, feed: MmPerS(100.0), tag: 0 }).unwrap();
        while look_ahead.pop().is_some() {}
        from = to;
    }
    assert!(look_ahead.len() < 25, "{}", look_ahead.len());
}

#[test]
fn a_jerk_without_bounds_costs_nothing() {
    let points: Vec<_> = (0..200)
        .map(|index| ([f64::from(index % 7) * 9.0, f64::from(index % 5) * 11.0, 0.0, 0.0], 150.0))
        .skip(1)
        .collect();
    let time = |jerk| plan(&points, limits(3000.0), jerk).last().unwrap().end_time();
    let ratio = time(Some(1e9)) / time(None);
    assert!((1.0..1.001).contains(&ratio), "{ratio}");
}

/// Moves of one kind: how many, their length, the turn between two, feed rate and acceleration.
type Part = (usize, f64, f64, f64, f64);

fn path(parts: &[Part], minimum_cruise_ratio: f64) -> Vec<([f64; 4], f64, Limits)> {
    let (mut at, mut heading) = ([0.0; 4], 0.0);
    let moves = parts.iter().flat_map(|part| std::iter::repeat_n(*part, part.0));
    moves
        .map(|(_, length, turn, feed, accel)| {
            heading += turn;
            at[0] += length * libm::cos(heading);
            at[1] += length * libm::sin(heading);
            (at, feed, Limits { minimum_cruise_ratio, ..limits(accel) })
        })
        .collect()
}

/// Plans and checks a path; gives the moves with a limited jerk.
fn checked(points: &[([f64; 4], f64, Limits)], jerk: f64) -> Vec<PlannedMove> {
    let made = plan_each(points, Some(jerk), true);
    check(&made, &plan_each(points, None, true), jerk);
    made
}

#[test]
fn a_curve_of_short_pieces_can_be_braked_on() {
    for (jerk, accel, length, radius) in
        [(1e5, 5000.0, 0.1, 5.0), (2e4, 3000.0, 0.03, 15.0), (5e5, 10_000.0, 0.2, 40.0)]
    {
        for slow in [20.0, 60.0] {
            let turn = length / radius;
            let points = path(&[(600, length, turn, 250.0, accel), (600, length, turn, slow, accel)], 0.5);
            let made = checked(&points, jerk);
            // It does not stop anywhere, and it does not creep.
            let slowest = made[100..1100].iter().map(|one| one.end_velocity).fold(f64::INFINITY, f64::min);
            assert!(slowest > 0.9 * slow, "{slowest} of {slow}, jerk {jerk}");
            let cruise = plan_each(&points, None, true).last().unwrap().end_time();
            let time = made.last().unwrap().end_time();
            assert!(time < 1.1 * cruise + 4.0 * accel / jerk, "{time} {cruise}");
        }
    }
}

#[test]
fn a_short_move_of_less_acceleration_is_met() {
    let moves = [
        (1, 310.0, 0.0, 100.0, 3000.0),
        (1, 5.0, 0.0, 100.0, 3000.0),
        (1, 0.5, 0.0, 100.0, 500.0),
        (1, 1.0, 0.0, 100.0, 3000.0),
    ];
    checked(&path(&moves, 0.0), 1e5);
    for length in [0.1, 0.5, 1.0, 3.0] {
        for accel in [18.0, 200.0, 500.0] {
            for before in [1.0, 2.0, 5.0, 10.0] {
                let parts = [
                    (1, 250.0, 0.0, 80.0, 3000.0),
                    (1, before, 0.0, 80.0, 3000.0),
                    (1, length, 0.0, 80.0, accel),
                    (1, 10.0, 0.0, 80.0, 3000.0),
                ];
                checked(&path(&parts, 0.0), 1e5);
            }
        }
    }
}

#[test]
fn a_window_of_few_long_moves_keeps_what_the_last_one_relied_on() {
    let limits = |accel| Limits {
        max_velocity: MmPerS(400.0),
        square_corner_velocity: MmPerS(18.67),
        ..limits(accel)
    };
    let mut at = [0.0; 4];
    let mut points = Vec::new();
    let deltas = [(374.72, -149.57), (107.998, -41.644), (649.95, -256.977), (147.27, -58.458)];
    for (index, (x, y)) in deltas.into_iter().enumerate() {
        (at[0], at[1]) = (at[0] + x, at[1] + y);
        points.push((at, 326.74, limits(if index == 0 { 2826.85 } else { 58.5486 })));
    }
    checked(&points, 137.56);
    for jerk in [100.0, 1e3, 1e4] {
        for last in [5.0, 20.0, 100.0] {
            let parts =
                [(2, 300.0, 0.0, 300.0, 500.0), (1, last, 0.0, 300.0, 500.0), (2, 310.0, 0.0, 60.0, 500.0)];
            checked(&path(&parts, 0.0), jerk);
        }
    }
}

#[test]
fn moves_that_wait_are_bounded_also_with_the_least_jerk() {
    let profile = Profile { motors: Vec::new(), max_jerk: Some(MmPerS3(100.0)) };
    let mut look_ahead = LookAhead::with_profile(limits(3000.0), profile).unwrap();
    let points = path(&[(4000, 0.1, 0.001, 300.0, 3000.0)], 0.0);
    let mut from = [0.0; 4];
    for &(to, feed, _) in &points {
        look_ahead.push(&MoveRequest { from, to, feed: MmPerS(feed), tag: 0 }).unwrap();
        while look_ahead.pop().is_some() {}
        assert!(look_ahead.len() < 2 * crate::jerk::WINDOW_MOVES + 1100, "{}", look_ahead.len());
        from = to;
    }
    checked(&points, 100.0);
}

fn any_parts() -> impl Strategy<Value = Vec<Part>> {
    let logarithmic = |low: f64, high: f64| (libm::log(low)..libm::log(high)).prop_map(libm::exp);
    let turn = prop_oneof![2 => Just(0.0), 3 => -0.08..0.08_f64, 1 => -3.0..3.0_f64];
    let count = prop_oneof![3 => 1..6_usize, 2 => 6..100_usize, 2 => 100..1200_usize];
    let part = (count, logarithmic(0.02, 2.0), turn, logarithmic(5.0, 400.0), logarithmic(50.0, 20_000.0));
    // Single moves may be long.
    let part = (part, logarithmic(1.0, 200.0)).prop_map(|((count, length, turn, feed, accel), stretch)| {
        (count, if count < 6 { length * stretch } else { length }, turn, feed, accel)
    });
    proptest::collection::vec(part, 1..12)
}

fn any_points() -> impl Strategy<Value = Vec<([f64; 4], f64)>> {
    let step = (0.0..core::f64::consts::TAU, 0.01..1.0_f64, 0.0..1.0_f64, 5.0..300.0_f64);
    proptest::collection::vec(step, 1..1500).prop_map(|steps| {
        let mut at = [0.0; 4];
        let mut heading = 0.0;
        let mut speed = 100.0;
        let point = |(turn, length, kind, feed): (f64, f64, f64, f64)| {
            heading += if kind < 0.9 { 0.05 * (turn - 3.0) } else { turn };
            let length = if kind < 0.7 { length } else { 20.0 * length };
            if kind > 0.8 {
                speed = feed;
            }
            let z = if kind > 0.99 { 0.3 } else { 0.0 };
            at = [
                at[0] + length * libm::cos(heading),
                at[1] + length * libm::sin(heading),
                at[2] + z,
                at[3] + 0.03 * length,
            ];
            (at, speed)
        };
        steps.into_iter().map(point).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn no_jerk_is_above_its_limit_and_no_speed_above_the_trapezoids(
        points in any_points(),
        accel in 500.0..20_000.0_f64,
        jerk in prop_oneof![1e3..1e5_f64, 1e5..1e7_f64],
    ) {
        let limits = limits(accel);
        check(&plan(&points, limits, Some(jerk)), &plan(&points, limits, None), jerk);
    }

    #[test]
    fn changes_of_feed_rate_acceleration_and_curves_keep_every_limit(
        parts in any_parts(),
        ratio in prop_oneof![Just(0.0), Just(0.5)],
        jerk in (2.0..7.0_f64).prop_map(|power| libm::pow(10.0, power)),
    ) {
        let points = path(&parts, ratio);
        let made = checked(&points, jerk);
        // Whoever takes them, and when, changes nothing. (All of them do not wait for that.)
        if points.len() < 4000 {
            prop_assert_eq!(made, plan_each(&points, Some(jerk), false));
        }
    }
}
