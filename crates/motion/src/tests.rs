//! What the plan must hold for any moves, and a few plans whose answer is known.

use crate::{
    ExtruderLimits, LOOK_AHEAD_MOVES_MAX, Limits, LookAhead, MoveError, MoveRequest, PlannedMove,
    READY_MOVES_MAX,
};
use proptest::prelude::*;
use units::{Mm, MmPerS, MmPerS2, Seconds};

fn limits() -> Limits {
    Limits {
        max_velocity: MmPerS(300.0),
        max_accel: MmPerS2(3000.0),
        square_corner_velocity: MmPerS(5.0),
        minimum_cruise_ratio: 0.5,
        max_z_velocity: MmPerS(15.0),
        max_z_accel: MmPerS2(200.0),
        max_xy_velocity: Limits::ANY_VELOCITY,
        max_xy_accel: Limits::ANY_ACCEL,
        junction_deviation: None,
        extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(300.0), MmPerS2(3000.0)),
    }
}

/// Moves through `points`, each with its feed.
fn requests(points: &[([f64; 4], f64)]) -> Vec<MoveRequest> {
    let mut from = [0.0; 4];
    let mut out = Vec::new();
    for (tag, &(to, feed)) in points.iter().enumerate() {
        out.push(MoveRequest { from, to, feed: MmPerS(feed), tag: tag as u32 });
        from = to;
    }
    out
}

fn plan_with(limits: Limits, requests: &[MoveRequest]) -> Vec<PlannedMove> {
    let mut look_ahead = LookAhead::new(limits).unwrap();
    let mut out = Vec::new();
    for request in requests {
        look_ahead.push(request).unwrap();
        out.extend(std::iter::from_fn(|| look_ahead.pop()));
    }
    look_ahead.flush();
    out.extend(std::iter::from_fn(|| look_ahead.pop()));
    assert!(look_ahead.is_empty());
    out
}

fn plan(points: &[([f64; 4], f64)]) -> Vec<PlannedMove> {
    plan_with(limits(), &requests(points))
}

fn assert_near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0), "{a} is not {b}");
}

#[test]
fn a_long_move_speeds_up_cruises_and_slows_down() {
    let planned = plan(&[([100.0, 0.0, 0.0, 0.0], 60.0)]);
    let [one] = &planned[..] else { panic!("one move gives one trapezoid") };
    assert_near(one.accel_time, 0.02);
    assert_near(one.decel_time, 0.02);
    assert_near(one.cruise_velocity, 60.0);
    assert_near(one.cruise_time, (100.0 - 1.2) / 60.0);
    assert_near(one.distance_at(0.01), 0.15);
    assert_near(one.distance_at(one.duration() - 0.01), 100.0 - 0.15);
    assert_eq!(one.distance_at(9.0), 100.0);
}

#[test]
fn a_short_move_keeps_below_the_peak_of_the_gentler_profile() {
    // Alone, the virtual profile at half the acceleration peaks at v² = d·a/2.
    let planned = plan(&[([2.0, 0.0, 0.0, 0.0], 300.0)]);
    assert_near(planned[0].cruise_velocity, (2.0_f64 * 1500.0).sqrt());
    let without = Limits { minimum_cruise_ratio: 0.0, ..limits() };
    let planned = plan_with(without, &requests(&[([2.0, 0.0, 0.0, 0.0], 300.0)]));
    assert_near(planned[0].cruise_velocity, (2.0_f64 * 3000.0).sqrt());
    assert_near(planned[0].cruise_time, 0.0);
}

#[test]
fn a_right_angle_is_taken_at_the_corner_velocity() {
    let planned = plan(&[([50.0, 0.0, 0.0, 0.0], 100.0), ([50.0, 50.0, 0.0, 0.0], 100.0)]);
    assert_near(planned[0].end_velocity, 5.0);
    assert_eq!(planned[0].end_velocity, planned[1].start_velocity);
}

#[test]
fn straight_on_nothing_slows_down_and_back_everything_stops() {
    let planned = plan(&[([50.0, 0.0, 0.0, 0.0], 100.0), ([100.0, 0.0, 0.0, 0.0], 100.0)]);
    assert_near(planned[0].end_velocity, 100.0);
    let planned = plan(&[([50.0, 0.0, 0.0, 0.0], 100.0), ([0.0, 0.0, 0.0, 0.0], 100.0)]);
    assert_eq!(planned[0].end_velocity, 0.0);
}

#[test]
fn a_change_of_extrusion_limits_the_junction() {
    // From 0.04 to 0.06 mm of filament a mm: at 50 mm/s the filament jumps by 1 mm/s.
    let planned = plan(&[([50.0, 0.0, 0.0, 2.0], 100.0), ([100.0, 0.0, 0.0, 5.0], 100.0)]);
    assert_near(planned[0].end_velocity, 50.0);
}

#[test]
fn z_and_the_filament_have_their_own_limits() {
    let planned = plan(&[([0.0, 0.0, 5.0, 0.0], 100.0), ([0.0, 0.0, 5.0, 90.0], 500.0)]);
    assert_near(planned[0].cruise_velocity, 15.0);
    assert_near(planned[0].accel, 200.0);
    assert_eq!(planned[0].end_velocity, 0.0);
    let ratio = 4.0 * 0.16 / (std::f64::consts::PI * 0.875 * 0.875);
    assert_near(planned[1].accel, 3000.0 * ratio);
    assert_near(planned[1].cruise_velocity, 300.0 * ratio);
    assert_eq!(planned[1].direction, [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn what_cannot_be_planned_is_refused_and_changes_nothing() {
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let good = MoveRequest { from: [0.0; 4], to: [1.0; 4], feed: MmPerS(10.0), tag: 0 };
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let to = [bad, 0.0, 0.0, 0.0];
        assert_eq!(look_ahead.push(&MoveRequest { to, ..good }), Err(MoveError::Coordinate));
    }
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        assert_eq!(look_ahead.push(&MoveRequest { feed: MmPerS(bad), ..good }), Err(MoveError::Feed));
    }
    assert_eq!(look_ahead.push(&MoveRequest { feed: MmPerS(1e-12), ..good }), Err(MoveError::TooLong));
    assert!(look_ahead.is_empty());
    look_ahead.push(&good).unwrap();
    assert_eq!(look_ahead.push(&good), Err(MoveError::Gap));
    assert!(LookAhead::new(Limits { max_accel: MmPerS2(f64::NAN), ..limits() }).is_err());
    assert!(look_ahead.set_limits(Limits { minimum_cruise_ratio: 1.0, ..limits() }).is_err());
}

#[test]
fn moves_that_go_nowhere_are_dropped_but_not_forgotten() {
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let mut x = 0.0;
    for tag in 0..100_000 {
        let next = x + 0.4e-9;
        let to = [next, 0.0, 0.0, 0.0];
        look_ahead.push(&MoveRequest { from: [x, 0.0, 0.0, 0.0], to, feed: MmPerS(10.0), tag }).unwrap();
        x = next;
        while look_ahead.pop().is_some() {}
    }
    look_ahead.flush();
    let mut end = None;
    while let Some(planned) = look_ahead.pop() {
        end = Some(planned.to[0]);
    }
    assert!((end.unwrap() - x).abs() < 1e-9);
}

#[test]
fn the_window_and_what_is_ready_are_bounded() {
    // Moves so short that none of them can be final before far more are known.
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let mut x = 0.0;
    let mut refused = false;
    for tag in 0..2 * (LOOK_AHEAD_MOVES_MAX + READY_MOVES_MAX) as u32 {
        let to = [x + 1e-4, 0.0, 0.0, 0.0];
        match look_ahead.push(&MoveRequest { from: [x, 0.0, 0.0, 0.0], to, feed: MmPerS(300.0), tag }) {
            Ok(()) => x = to[0],
            Err(error) => {
                assert_eq!(error, MoveError::Full);
                refused = true;
            }
        }
        assert!(look_ahead.len() <= 2 * LOOK_AHEAD_MOVES_MAX + READY_MOVES_MAX);
    }
    assert!(refused);
}

#[test]
fn a_full_window_is_released_within_the_limits() {
    // Pieces of 1 µm towards a stop, at speeds whose braking way is longer than the window.
    let points: Vec<_> = (1..4000).map(|i| ([f64::from(i) * 1e-3, 0.0, 0.0, 0.0], 300.0)).collect();
    let planned = plan(&points);
    assert_eq!(planned.len(), points.len());
    for pair in planned.windows(2) {
        check_move(&pair[0], &limits(), 300.0);
        assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
    }
    let alone = plan(&[([3.999, 0.0, 0.0, 0.0], 300.0)]);
    let (end, best) = (planned[planned.len() - 1].end_time(), alone[0].end_time());
    assert!(end >= best * 0.999 && end < best * 1.3, "{end} s, alone {best} s");
}

#[test]
fn a_pause_moves_print_time_and_a_new_run_starts_at_zero() {
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let [first, second] = requests(&[([1.0; 4], 10.0), ([2.0; 4], 10.0)])[..] else { panic!() };
    look_ahead.push(&first).unwrap();
    look_ahead.dwell(Seconds(2.5));
    look_ahead.push(&second).unwrap();
    look_ahead.flush();
    let [a, b] = [look_ahead.pop().unwrap(), look_ahead.pop().unwrap()];
    assert_eq!((a.end_velocity, b.start_velocity), (0.0, 0.0));
    assert_near(b.start_time, a.end_time() + 2.5);
    look_ahead.begin_run();
    look_ahead.push(&first).unwrap();
    look_ahead.flush();
    assert_eq!(look_ahead.pop().unwrap(), a);
}

/// Points of every kind: travel, lines in small pieces, z, the filament alone.
fn any_points() -> impl Strategy<Value = Vec<([f64; 4], f64)>> {
    let coordinate = || prop_oneof![-100.0..100.0_f64, -0.1..0.1_f64, (-50..50_i32).prop_map(f64::from)];
    let delta = prop_oneof![
        4 => (coordinate(), coordinate(), Just(0.0), 0.0..2.0_f64),
        1 => (coordinate(), coordinate(), coordinate(), Just(0.0)),
        1 => (Just(0.0), Just(0.0), -1.0..1.0_f64, -2.0..2.0_f64),
        1 => (Just(0.0), Just(0.0), Just(0.0), -5.0..5.0_f64),
        3 => (-0.05..0.3_f64, -0.05..0.1_f64, Just(0.0), 0.0..0.02_f64),
    ];
    proptest::collection::vec((delta, 0.5..500.0_f64), 1..120).prop_map(|moves| {
        let mut at = [0.0; 4];
        let step = |((x, y, z, e), feed): ((f64, f64, f64, f64), f64)| {
            at = [at[0] + x, at[1] + y, at[2] + z, at[3] + e];
            (at, feed)
        };
        moves.into_iter().map(step).collect()
    })
}

fn any_limits() -> impl Strategy<Value = Limits> {
    (10.0..500.0_f64, 100.0..20_000.0_f64, 0.0..20.0_f64, 0.0..0.99_f64).prop_map(|(v, a, corner, ratio)| {
        Limits {
            max_velocity: MmPerS(v),
            max_accel: MmPerS2(a),
            square_corner_velocity: MmPerS(corner),
            minimum_cruise_ratio: ratio,
            extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(v), MmPerS2(a)),
            ..limits()
        }
    })
}

/// Everything that must hold for one planned move under its limits.
fn check_move(planned: &PlannedMove, limits: &Limits, feed: f64) {
    let PlannedMove { start_velocity, cruise_velocity, end_velocity, accel, direction, .. } = *planned;
    for time in [planned.accel_time, planned.cruise_time, planned.decel_time] {
        assert!(time >= 0.0 && time.is_finite());
    }
    let slack = 1.0 + 1e-9;
    assert!(start_velocity <= cruise_velocity && end_velocity <= cruise_velocity);
    assert!(cruise_velocity <= feed * slack);
    let travels = direction[..3].iter().any(|&d| d != 0.0);
    if travels {
        assert!(cruise_velocity <= limits.max_velocity.0 * slack && accel <= limits.max_accel.0 * slack);
    }
    let dz = direction[2].abs();
    assert!(
        dz * cruise_velocity <= limits.max_z_velocity.0 * slack && dz * accel <= limits.max_z_accel.0 * slack
    );
    if !travels || direction[3] < 0.0 {
        let de = direction[3].abs();
        assert!(de * cruise_velocity <= limits.extruder.max_extrude_only_velocity.0 * slack);
        assert!(de * accel <= limits.extruder.max_extrude_only_accel.0 * slack);
    }
    // Speeds, times, acceleration and length tell the same story.
    let ramp_error = (start_velocity + accel * planned.accel_time - cruise_velocity).abs();
    assert!(ramp_error <= 1e-6 * cruise_velocity + 1e-9, "speeding up: {planned:?}");
    let ramp_error = (end_velocity + accel * planned.decel_time - cruise_velocity).abs();
    assert!(ramp_error <= 1e-6 * cruise_velocity + 1e-9, "slowing down: {planned:?}");
    let driven: f64 =
        planned.phases().map(|phase| phase.distance_at(phase.duration) - phase.start_distance).sum();
    assert!((driven - planned.length).abs() <= 1e-9 * planned.length + 1e-12, "{driven} of {planned:?}");
    for (axis, ratio) in direction.iter().enumerate() {
        let end = planned.from[axis] + ratio * planned.length;
        let is_moved = travels || axis == 3;
        assert!(!is_moved || (end - planned.to[axis]).abs() < 1e-9);
    }
}

/// The highest speed at which `b` may follow `a`, from the angle between them: an independent way to the same limit.
fn corner_limit(a: &PlannedMove, b: &PlannedMove, limits: &Limits) -> f64 {
    let dot: f64 = (0..3).map(|i| a.direction[i] * b.direction[i]).sum();
    let turn = libm::acos(dot.clamp(-1.0, 1.0));
    // Half the angle between the moves; π/2 where they go straight on.
    let half = 0.5 * (std::f64::consts::PI - turn);
    let ratio = libm::sin(half) / (1.0 - libm::sin(half));
    let corner = limits.square_corner_velocity.0;
    let deviation = corner * corner * (2.0_f64.sqrt() - 1.0) / limits.max_accel.0;
    let of = |m: &PlannedMove| {
        (ratio * deviation * m.accel).min(0.5 * m.length * m.accel * libm::tan(half)).sqrt()
    };
    let jump = (a.direction[3] - b.direction[3]).abs();
    of(a).min(of(b)).min(limits.extruder.instantaneous_corner_velocity.0 / jump)
}

proptest! {
    #[test]
    fn no_limit_is_ever_exceeded(points in any_points(), limits in any_limits()) {
        let requests = requests(&points);
        let planned = plan_with(limits, &requests);
        let mut at = [0.0; 4];
        let mut time = 0.0;
        for one in &planned {
            check_move(one, &limits, points[one.tag as usize].1);
            prop_assert_eq!(one.from, at);
            prop_assert_eq!(one.start_time, time);
            (at, time) = (one.to, one.end_time());
        }
        prop_assert_eq!(planned[0].start_velocity, 0.0);
        prop_assert_eq!(planned[planned.len() - 1].end_velocity, 0.0);
        for pair in planned.windows(2) {
            prop_assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
            let travel = |m: &PlannedMove| m.direction[..3].iter().any(|&d| d != 0.0);
            if travel(&pair[0]) && travel(&pair[1]) {
                let limit = corner_limit(&pair[0], &pair[1], &limits);
                // The sine of nearly straight corners loses half its digits either way.
                prop_assert!(pair[0].end_velocity <= limit * (1.0 + 1e-6) + 1e-6, "{} {}", pair[0].end_velocity, limit);
            } else {
                prop_assert_eq!(pair[0].end_velocity, 0.0);
            }
        }
    }

    #[test]
    fn when_moves_are_taken_does_not_change_the_plan(points in any_points(), limits in any_limits()) {
        let requests = requests(&points);
        let mut look_ahead = LookAhead::new(limits).unwrap();
        for request in &requests {
            look_ahead.push(request).unwrap();
        }
        look_ahead.flush();
        let late: Vec<_> = std::iter::from_fn(|| look_ahead.pop()).collect();
        prop_assert_eq!(late, plan_with(limits, &requests));
    }

    #[test]
    fn what_is_final_early_is_what_the_whole_plan_says(points in any_points(), limits in any_limits()) {
        // One backward pass over everything, against the passes over batches.
        let requests = requests(&points);
        let batches = plan_with(limits, &requests);
        let mut whole = crate::window::Window::default();
        let mut at = [0.0; 4];
        for request in &requests {
            let request = MoveRequest { from: at, ..*request };
            if let Some(entry) = crate::junction::Entry::new(&request, None, &limits, &[]) {
                at = request.to;
                whole.push(entry);
            }
        }
        let (mut time, mut out) = (0.0, std::collections::VecDeque::new());
        whole.release_oldest(usize::MAX, &mut time, &mut out);
        prop_assert_eq!(Vec::from(out), batches);
    }

    #[test]
    fn any_numbers_at_all_are_planned_or_refused(raw: Vec<([u64; 4], u64)>) {
        let mut look_ahead = LookAhead::new(limits()).unwrap();
        let mut from = [0.0; 4];
        for (to, feed) in raw {
            let request =
                MoveRequest { from, to: to.map(f64::from_bits), feed: MmPerS(f64::from_bits(feed)), tag: 0 };
            if look_ahead.push(&request).is_ok() {
                from = request.to;
            }
        }
        look_ahead.flush();
        while let Some(planned) = look_ahead.pop() {
            prop_assert!(planned.end_time().is_finite());
        }
    }

    #[test]
    fn a_change_of_limits_on_the_way_holds_from_its_move_on(
        points in any_points(),
        limits in proptest::collection::vec(any_limits(), 1..6),
        every in 1_usize..20,
    ) {
        let of = |index: usize| limits[index / every % limits.len()];
        let mut look_ahead = LookAhead::new(limits[0]).unwrap();
        for (index, request) in requests(&points).iter().enumerate() {
            look_ahead.set_limits(of(index)).unwrap();
            look_ahead.push(request).unwrap();
        }
        look_ahead.flush();
        let planned: Vec<_> = std::iter::from_fn(|| look_ahead.pop()).collect();
        for one in &planned {
            check_move(one, &of(one.tag as usize), points[one.tag as usize].1);
        }
        for pair in planned.windows(2) {
            prop_assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn thousands_of_short_pieces_fill_the_window_and_keep_the_limits(
        pieces in proptest::collection::vec((0.0..std::f64::consts::TAU, 50_usize..3000, 1e-4..0.02_f64, 1.0..500.0_f64), 1..6),
        limits in proptest::collection::vec(any_limits(), 1..4),
    ) {
        // Straight stretches and curls of tiny pieces: the window is released by force while speeds are high.
        let mut points = Vec::new();
        let mut at = [0.0; 4];
        for &(angle, count, length, feed) in &pieces {
            for index in 0..count {
                let angle = angle + 1e-4 * index as f64;
                at = [at[0] + length * libm::cos(angle), at[1] + length * libm::sin(angle), 0.0, at[3] + 0.04 * length];
                points.push((at, feed));
            }
        }
        let of = |index: usize| limits[index / 700 % limits.len()];
        let mut look_ahead = LookAhead::new(limits[0]).unwrap();
        let mut planned = Vec::new();
        for (index, request) in requests(&points).iter().enumerate() {
            look_ahead.set_limits(of(index)).unwrap();
            look_ahead.push(request).unwrap();
            planned.extend(std::iter::from_fn(|| look_ahead.pop()));
        }
        look_ahead.flush();
        planned.extend(std::iter::from_fn(|| look_ahead.pop()));
        prop_assert_eq!(planned.len(), points.len());
        for one in &planned {
            check_move(one, &of(one.tag as usize), points[one.tag as usize].1);
        }
        for pair in planned.windows(2) {
            prop_assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
        }
        prop_assert_eq!(planned[planned.len() - 1].end_velocity, 0.0);
    }
}
