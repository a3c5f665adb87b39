//! Motors whose strength depends on speed: what is asked of them, and how near to the best that comes.

use crate::motor::{Demand, Torque};
use crate::{Bend, Bound, ExtruderLimits, Limits, LookAhead, MotorAbility, MoveRequest, Phase, PlannedMove};
use core::f64::consts::TAU;
use proptest::prelude::*;
use units::{Mm, MmPerS, MmPerS2};

/// A large frame's motor: 200 full steps and 40 mm a turn.
fn torque() -> Torque {
    Torque {
        pull_out: vec![(0.0, 2.2), (400.0, 2.1), (1000.0, 1.4), (2000.0, 0.7), (4000.0, 0.2)],
        pull_out_slowing: None,
        load: 0.15,
        inertia: 4.0e-4,
        margin: 0.6,
        full_steps: 200,
        turn: Mm(40.0),
        resonances: Vec::new(),
    }
}

fn limits() -> Limits {
    Limits {
        max_velocity: MmPerS(2000.0),
        max_accel: MmPerS2(100_000.0),
        square_corner_velocity: MmPerS(5.0),
        minimum_cruise_ratio: 0.0,
        max_z_velocity: MmPerS(2000.0),
        max_z_accel: MmPerS2(100_000.0),
        max_xy_velocity: Limits::ANY_VELOCITY,
        max_xy_accel: Limits::ANY_ACCEL,
        junction_deviation: None,
        extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(2000.0), MmPerS2(100_000.0)),
    }
}

fn motors(torque: &Torque) -> Vec<Option<MotorAbility>> {
    let ability = torque.ability().unwrap();
    vec![Some(ability.clone()), Some(ability), None, None]
}

fn plan(torque: &Torque, points: &[([f64; 4], f64)], limits: Limits) -> Vec<PlannedMove> {
    let mut look_ahead = LookAhead::with_motors(limits, motors(torque)).unwrap();
    let mut from = [0.0; 4];
    for (tag, &(to, feed)) in points.iter().enumerate() {
        look_ahead.push(&MoveRequest { from, to, feed: MmPerS(feed), tag: tag as u32 }).unwrap();
        from = to;
    }
    look_ahead.flush();
    std::iter::from_fn(|| look_ahead.pop()).collect()
}

/// Torque of the table at a rate.
fn table(torque: &Torque, rate: f64) -> f64 {
    let points = &torque.pull_out;
    let after = points.iter().position(|point| point.0 >= rate).unwrap_or(points.len() - 1).max(1);
    let [(f0, t0), (f1, t1)] = [points[after - 1], points[after]];
    t0 + (t1 - t0) * (rate - f0) / (f1 - f0)
}

/// What the motor of an axis is asked for over what the margin leaves, at a speed and an acceleration of its axis.
fn asked(torque: &Torque, speed: f64, accel: f64) -> f64 {
    let steps_mm = f64::from(torque.full_steps) / torque.turn.0;
    let step_rad = TAU / f64::from(torque.full_steps);
    // Friction helps to slow down, until the axis stands: a zero has the sign of its direction.
    let asked = torque.inertia * accel * steps_mm * step_rad + torque.load.copysign(speed);
    asked.abs() / (torque.margin * table(torque, speed.abs() * steps_mm))
}

/// The most that the motors of the axes x and y are asked for at any moment, over what the margin leaves.
fn most_asked(torque: &Torque, planned: &PlannedMove) -> f64 {
    let mut most: f64 = 0.0;
    for phase in planned.phases() {
        for part in 0..=8 {
            let time = phase.duration * f64::from(part) / 8.0;
            let (speed, share) = (phase.velocity_at(time).max(0.0), phase.distance_at(time) / planned.length);
            for axis in 0..2 {
                let slope = |share| {
                    planned.bend.as_ref().map_or(planned.direction[axis], |bend| bend.slope(axis, share))
                };
                let bend = (slope(share + 1e-3) - slope(share - 1e-3)) / (2e-3 * planned.length);
                let accel = phase.accel * slope(share) + speed * speed * bend;
                most = most.max(asked(torque, speed * slope(share), accel));
            }
        }
    }
    most
}

/// The same where moves meet, on a curve of many of them: its direction changes from the middle of each to that of the next.
fn most_asked_between(torque: &Torque, planned: &[PlannedMove]) -> f64 {
    let mut most: f64 = 0.0;
    for pair in planned.windows(2) {
        let speed = pair[0].end_velocity;
        let ends = [pair[0].phases().last().unwrap(), pair[1].phases().next().unwrap()];
        for axis in 0..2 {
            let bend = (pair[1].direction[axis] - pair[0].direction[axis])
                / (0.5 * (pair[0].length + pair[1].length));
            for (planned, phase) in pair.iter().zip(&ends) {
                let slope = planned.direction[axis];
                most = most.max(asked(torque, speed * slope, phase.accel * slope + speed * speed * bend));
            }
        }
    }
    most
}

/// What the motors of the axes x and y are asked for at every moment: never more than the margin leaves.
fn check_torque(torque: &Torque, planned: &PlannedMove) {
    let most = most_asked(torque, planned);
    assert!(most <= 1.0 + 1e-9, "{most} {planned:?}");
}

/// Plans a circle of so many pieces, each an arc or its chord, from the angle 0.
fn plan_circle(torque: &Torque, radius: f64, turns: f64, pieces: u32, is_arc: bool) -> Vec<PlannedMove> {
    let mut look_ahead = LookAhead::with_motors(limits(), motors(torque)).unwrap();
    let turn = TAU * turns / f64::from(pieces);
    let point = |angle: f64| [radius * libm::cos(angle), radius * libm::sin(angle), 0.0, 0.0];
    for index in 0..pieces {
        let start_angle = turn * f64::from(index);
        let bend = Bend {
            normal: 2,
            centre: [0.0; 2],
            start_angle,
            turn,
            radii: [radius; 2],
            rise: 0.0,
            continues: index > 0,
            arc_length: radius * TAU * turns,
        };
        let [from, to] = [start_angle, turn * f64::from(index + 1)].map(point);
        let request = MoveRequest { from, to, feed: MmPerS(2000.0), tag: index };
        look_ahead.push_along(&request, Some(&bend).filter(|_| is_arc)).unwrap();
    }
    look_ahead.flush();
    std::iter::from_fn(|| look_ahead.pop()).collect()
}

#[test]
fn an_arc_asks_no_motor_for_more_than_it_has_while_it_turns_and_speeds_up() {
    for radius in [1.0, 5.0, 20.0, 100.0, 400.0] {
        let planned = plan_circle(&torque(), radius, 2.0, 600, true);
        let most = planned.iter().map(|one| most_asked(&torque(), one)).fold(0.0, f64::max);
        assert!((0.8..=1.0 + 1e-6).contains(&most), "{most} at {radius}");
    }
}

#[test]
fn a_circle_of_chords_asks_no_motor_for_more_than_it_has() {
    for radius in [1.0, 5.0, 20.0, 100.0, 400.0] {
        let planned = plan_circle(&torque(), radius, 2.0, 1000, false);
        for one in &planned {
            check_torque(&torque(), one);
        }
        let most = most_asked_between(&torque(), &planned);
        assert!((0.8..=1.0 + 1e-6).contains(&most), "{most} at {radius}");
        // Over many pieces at once, too.
        let far = |axis: usize, [a, b]: [&PlannedMove; 2]| {
            let [start, end] = [a, b].map(|one| one.start_velocity * one.direction[axis]);
            asked(&torque(), 0.5 * (start + end), (end - start) / (b.start_time - a.start_time))
        };
        for pair in planned.windows(9) {
            let most = (0..2).map(|axis| far(axis, [&pair[0], &pair[8]])).fold(0.0, f64::max);
            assert!(most <= 1.02, "{most} at {radius}");
        }
    }
}

#[test]
fn a_long_move_goes_to_the_top_that_the_torque_leaves_and_no_further() {
    let torque = torque();
    let ability = torque.ability().unwrap();
    let planned = plan(&torque, &[([3000.0, 0.0, 0.0, 0.0], 5000.0)], limits());
    assert!((planned[0].cruise_velocity - ability.top().0).abs() < 1e-9);
    // Below 4000 steps/s, at which 0.6 times 0.2 N·m does not overcome the load.
    assert!(ability.top().0 < 800.0 && ability.top().0 > 600.0, "{:?}", ability.top());
    check_torque(&torque, &planned[0]);
    // Slowing down is stronger, and shorter.
    assert!(planned[0].decel_time < planned[0].accel_time);
    let driven: f64 =
        planned[0].phases().map(|phase| phase.distance_at(phase.duration) - phase.start_distance).sum();
    assert!((driven - 3000.0).abs() < 1e-6);
}

#[test]
fn a_way_that_turns_back_ends_each_move_where_it_should() {
    // The moves up to a batch are released before the way turns, with a last one that just about can slow down.
    for last in 1..=300 {
        let out = (1..16).map(|step| 5.0 * f64::from(step)).chain([75.0 + 0.001 * f64::from(last)]);
        let points: Vec<_> = out.chain([0.0]).map(|x| ([x, 0.0, 0.0, 0.0], 100.0)).collect();
        let planned = plan(&torque(), &points, limits());
        for planned in &planned {
            check_torque(&torque(), planned);
            assert!(planned.gap_mm() < 1e-9, "with {last}: {planned:?}");
        }
        for pair in planned.windows(2) {
            assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
        }
    }
}

#[test]
fn a_diagonal_asks_each_motor_for_its_share() {
    let torque = torque();
    let straight = plan(&torque, &[([3000.0, 0.0, 0.0, 0.0], 5000.0)], limits());
    let diagonal = plan(&torque, &[([3000.0, 3000.0, 0.0, 0.0], 5000.0)], limits());
    let root = 2.0_f64.sqrt();
    assert!((diagonal[0].cruise_velocity - root * straight[0].cruise_velocity).abs() < 1e-6);
    assert!((diagonal[0].duration() - straight[0].duration()).abs() < 1e-6);
    check_torque(&torque, &diagonal[0]);
}

#[test]
fn the_time_of_a_ramp_is_the_integral_over_the_torque_that_is_left() {
    // t(f₁) = J·∫ dω/(T − T_L), by the midpoint rule over the lines of the table.
    let torque = Torque { load: 0.1, ..torque() };
    let planned = plan(&torque, &[([3000.0, 0.0, 0.0, 0.0], 300.0)], limits());
    let step_rad = TAU / 200.0;
    let (from, to) = (planned[0].start_velocity * 5.0, 300.0 * 5.0);
    let parts = 100_000;
    let width = (to - from) / f64::from(parts);
    let exact: f64 = (0..parts)
        .map(|part| {
            let rate = from + (f64::from(part) + 0.5) * width;
            torque.inertia * step_rad * width / (torque.margin * table(&torque, rate) - torque.load)
        })
        .sum();
    let ratio = planned[0].accel_time / exact;
    assert!((1.0..1.01).contains(&ratio), "{ratio}");
}

#[test]
fn a_curve_of_tiny_pieces_asks_no_motor_for_more_than_a_straight_way() {
    let torque = torque();
    let radius = 10.0;
    let points: Vec<_> = (1..=2000)
        .map(|index| {
            let angle = 0.005 * f64::from(index);
            ([radius * libm::sin(angle), radius - radius * libm::cos(angle), 0.0, 0.0], 2000.0)
        })
        .collect();
    let planned = plan(&torque, &points, limits());
    let top = planned.iter().map(|one| one.cruise_velocity).fold(0.0, f64::max);
    let ability = torque.ability().unwrap();
    // Where an axis turns round, all of the path's v²/R is its own.
    let can = ability.accel_at(MmPerS(0.0), Demand::Speed).0;
    assert!(top * top / radius <= can * 1.01, "{top} {can}");
    assert!(top > 50.0, "{top}");
}

#[test]
fn nothing_cruises_in_a_band_of_resonance() {
    // 20 ..= 40 steps/s are 4 ..= 8 mm/s.
    let torque = Torque { resonances: vec![(20.0, 40.0), (39.0, 60.0)], ..torque() };
    let slow = plan(&torque, &[([100.0, 0.0, 0.0, 0.0], 6.0)], limits());
    assert!((slow[0].cruise_velocity - 4.0).abs() < 1e-9);
    let both = plan(&torque, &[([100.0, 0.0, 0.0, 0.0], 11.0)], limits());
    assert!((both[0].cruise_velocity - 4.0).abs() < 1e-9);
    let above = plan(&torque, &[([100.0, 0.0, 0.0, 0.0], 100.0)], limits());
    assert!((above[0].cruise_velocity - 100.0).abs() < 1e-9);
}

/// The limits of a usual printer.
fn usual() -> Limits {
    Limits {
        max_velocity: MmPerS(300.0),
        max_accel: MmPerS2(3000.0),
        minimum_cruise_ratio: 0.5,
        max_z_velocity: MmPerS(15.0),
        max_z_accel: MmPerS2(200.0),
        ..limits()
    }
}

/// How long a move goes along evenly at a speed at which x or y lies in one of these bands (mm/s), s.
fn shakes(planned: &PlannedMove, bands: &[(f64, f64)]) -> f64 {
    let lies_within = |speed: f64| {
        let shares = [0, 1].map(|axis| planned.direction[axis].abs() * speed);
        shares.iter().any(|at| bands.iter().any(|&(low, high)| low + 1e-9 < *at && *at < high - 1e-9))
    };
    let is_even = |phase: &Phase| phase.accel == 0.0 && lies_within(phase.velocity);
    planned.phases().filter(is_even).map(|phase| phase.duration).sum()
}

#[test]
fn what_is_calm_for_one_motor_is_not_a_band_of_another() {
    let torque = Torque { resonances: vec![(20.0, 40.0)], ..torque() };
    // 12 mm/s are 7.2 of y, whose band begins at 6.7 of the path. There x goes 5.3, and its band begins at 5 of the path.
    let both = plan(&torque, &[([80.0, 60.0, 0.0, 0.0], 12.0)], limits());
    assert!((both[0].cruise_velocity * 0.8 - 4.0).abs() < 1e-9, "{}", both[0].cruise_velocity);
    let mut bound = Bound::new(motors(&torque));
    let request = MoveRequest { from: [0.0; 4], to: [80.0, 60.0, 0.0, 0.0], feed: MmPerS(12.0), tag: 0 };
    bound.push(&request, &limits());
    bound.stop();
    let ratio = both[0].duration() / bound.total().0;
    assert!((1.0 - 1e-3..1.005).contains(&ratio), "{ratio}");
}

#[test]
fn a_short_move_does_not_go_along_in_a_band_of_resonance() {
    // 400 ..= 600 steps/s are 80 ..= 120 mm/s. The virtual profile's peak is at 95.9.
    let torque = Torque { resonances: vec![(400.0, 600.0)], ..torque() };
    let short = plan(&torque, &[([6.0, 0.0, 0.0, 0.0], 300.0)], usual());
    assert!((short[0].cruise_velocity - 80.0).abs() < 1e-9, "{}", short[0].cruise_velocity);
    assert!(short[0].gap_mm() < 1e-9);
    // Of many pieces as of one.
    let pieces: Vec<_> = (1..=60).map(|piece| ([0.1 * f64::from(piece), 0.0, 0.0, 0.0], 300.0)).collect();
    let planned = plan(&torque, &pieces, usual());
    let time: f64 = planned.iter().map(PlannedMove::duration).sum();
    assert!((time - short[0].duration()).abs() < 1e-9, "{time}");
    // Without a ratio the peak is none to stay at.
    let sharp = Limits { minimum_cruise_ratio: 0.0, ..usual() };
    let peak = plan(&torque, &[([4.0, 0.0, 0.0, 0.0], 300.0)], sharp);
    assert!((108.0..112.0).contains(&peak[0].cruise_velocity), "{}", peak[0].cruise_velocity);
}

#[test]
fn a_move_that_starts_in_a_band_of_resonance_crosses_it() {
    // Y shakes at 10 ..= 25 mm/s. The way turns into that at a corner, and the virtual profile's peak is at 20 of it.
    let band = (10.0, 25.0);
    let motor = Torque { resonances: vec![(50.0, 125.0)], ..torque() }.ability().unwrap();
    let limits = Limits { square_corner_velocity: MmPerS(500.0), ..usual() };
    let mut look_ahead = LookAhead::with_motors(limits, vec![None, Some(motor), None, None]).unwrap();
    let [start, corner, end] = [[0.0; 4], [100.0, 0.0, 0.0, 0.0], [100.0 + 0.6 * 0.31, 0.8 * 0.31, 0.0, 0.0]];
    look_ahead.push(&MoveRequest { from: start, to: corner, feed: MmPerS(90.0), tag: 0 }).unwrap();
    look_ahead.push(&MoveRequest { from: corner, to: end, feed: MmPerS(300.0), tag: 1 }).unwrap();
    look_ahead.flush();
    let second = std::iter::from_fn(|| look_ahead.pop()).last().unwrap();
    assert!((band.0..band.1).contains(&(0.8 * second.start_velocity)), "{}", second.start_velocity);
    assert!(0.8 * second.cruise_velocity > band.1, "{}", second.cruise_velocity);
    assert!(shakes(&second, &[band]) < 1e-9 && second.gap_mm() < 1e-9);
}

#[test]
fn the_first_move_takes_its_time_where_the_way_turns_back_at_once() {
    let start = torque().ability().unwrap().start().0;
    for way in [0.001, 0.01, 0.05, 0.08, 0.5] {
        let points = [way, 0.0].map(|x| ([x, 0.0, 0.0, 0.0], 100.0));
        let planned = plan(&torque(), &points, usual());
        assert!(planned.iter().all(|one| one.gap_mm() < 1e-9 && one.duration() > 0.0), "{way}");
        let mean = way / planned[0].duration();
        // It starts as fast as it can stop.
        assert!(mean >= 0.49 * start.min((2.0 * 3000.0 * way).sqrt()), "{way}: {mean}");
    }
    // Nor does a slow run before it hold it up.
    let mut look_ahead = LookAhead::with_motors(usual(), motors(&torque())).unwrap();
    let mut go = |[from, to]: [f64; 2], feed: f64| {
        let [from, to] = [from, to].map(|x| [x, 0.0, 0.0, 0.0]);
        look_ahead.push(&MoveRequest { from, to, feed: MmPerS(feed), tag: 0 }).unwrap();
        if to[0] != 1.05 {
            look_ahead.flush();
        }
        std::iter::from_fn(|| look_ahead.pop()).map(|planned| planned.duration()).collect::<Vec<_>>()
    };
    assert_eq!(go([0.0, 1.0], 0.1).len(), 1);
    go([1.0, 1.05], 100.0);
    assert!(go([1.05, 0.0], 100.0)[0] < 0.02);
}

#[test]
fn what_no_motor_has_is_refused() {
    for wrong in [
        Torque { load: 3.0, ..torque() },
        Torque { inertia: 0.0, ..torque() },
        Torque { margin: 1.5, ..torque() },
        Torque { margin: f64::NAN, ..torque() },
        Torque { pull_out: vec![(0.0, 1.0)], ..torque() },
        Torque { pull_out: vec![(1.0, 1.0), (2.0, 1.0)], ..torque() },
        Torque { pull_out: vec![(0.0, 1.0), (0.0, 1.0)], ..torque() },
        Torque { pull_out: vec![(0.0, 1.0), (f64::INFINITY, 1.0)], ..torque() },
        Torque { resonances: vec![(0.0, 1.0)], ..torque() },
    ] {
        assert!(wrong.ability().is_err(), "{wrong:?}");
    }
}

fn any_torque() -> impl Strategy<Value = Torque> {
    let points = proptest::collection::vec((1.0..2000.0_f64, 0.0..3.0_f64), 1..8);
    (points, 0.0..0.3_f64, 1e-5..1e-2_f64, 0.3..0.9_f64, 0.5..3.0_f64).prop_map(
        |(steps, load, inertia, margin, first)| {
            let mut rate = 0.0;
            let mut pull_out = vec![(0.0, first)];
            for (gap, torque) in steps {
                rate += gap;
                pull_out.push((rate, torque));
            }
            Torque { pull_out, load, inertia, margin, ..torque() }
        },
    )
}

proptest! {
    #[test]
    fn no_motor_is_ever_asked_for_more_than_it_has(
        torque in any_torque(),
        points in proptest::collection::vec((-200.0..200.0_f64, -200.0..200.0_f64, 5.0..2000.0_f64), 1..40),
    ) {
        let Ok(ability) = torque.ability() else { return Ok(()) };
        let points: Vec<_> = points.iter().map(|&(x, y, feed)| ([x, y, 0.0, 0.0], feed)).collect();
        let planned = plan(&torque, &points, limits());
        let mut at = 0.0;
        let mut before: Option<&PlannedMove> = None;
        for one in &planned {
            check_torque(&torque, one);
            prop_assert!((one.start_time - at).abs() < 1e-9);
            at = one.end_time();
            let mut speed = one.start_velocity;
            let mut distance = 0.0;
            for phase in one.phases() {
                prop_assert!((phase.velocity - speed).abs() < 1e-6);
                prop_assert!((phase.start_distance - distance).abs() < 1e-9);
                speed = phase.velocity_at(phase.duration);
                distance = phase.end_distance;
                prop_assert!((phase.distance_at(phase.duration) - distance).abs() < 1e-6);
            }
            prop_assert!((speed - one.end_velocity).abs() < 1e-6);
            prop_assert_eq!(distance, one.length);
            for axis in 0..2 {
                let jump = one.start_velocity * one.direction[axis]
                    - before.map_or(0.0, |before| before.end_velocity * before.direction[axis]);
                prop_assert!(jump.abs() <= ability.start().0 * (1.0 + 1e-9), "{} {:?}", jump, ability.start());
            }
            before = Some(one);
        }
    }

    #[test]
    fn no_circle_asks_a_motor_for_more_than_it_has(
        torque in any_torque(),
        radius in 0.5..300.0_f64,
        turns in 0.05..2.0_f64,
        pieces in 100_u32..800,
    ) {
        if torque.ability().is_err() {
            return Ok(());
        }
        for planned in plan_circle(&torque, radius, turns, pieces, true) {
            let most = most_asked(&torque, &planned);
            prop_assert!(most <= 1.0 + 1e-6, "{} {:?}", most, planned);
            prop_assert!(planned.gap_mm() < 1e-9);
        }
        let chords = plan_circle(&torque, radius, turns, pieces, false);
        prop_assert!(chords.iter().all(|one| most_asked(&torque, one) <= 1.0 + 1e-9 && one.gap_mm() < 1e-9));
        let most = most_asked_between(&torque, &chords);
        prop_assert!(most <= 1.0 + 1e-6, "{}", most);
    }

    #[test]
    fn along_a_line_nothing_ever_stays_in_a_band(
        bands in proptest::collection::vec((10.0..1500.0_f64, 1.0..400.0_f64), 1..4),
        steps in proptest::collection::vec((0.01..20.0_f64, 1.0..300.0_f64), 1..60),
        ratio in prop_oneof![Just(0.0), 0.0..0.95_f64],
        heading in 0.0..TAU,
    ) {
        let resonances: Vec<_> = bands.iter().map(|&(low, width)| (low, low + width)).collect();
        let bands: Vec<_> = resonances.iter().map(|&(low, high)| (0.2 * low, 0.2 * high)).collect();
        let torque = Torque { resonances, ..torque() };
        let mut at = 0.0;
        let points = steps.iter().map(|&(length, feed)| {
            at += length;
            ([at * libm::cos(heading), at * libm::sin(heading), 0.0, 0.0], feed)
        });
        let points: Vec<_> = points.collect();
        for planned in plan(&torque, &points, Limits { minimum_cruise_ratio: ratio, ..usual() }) {
            prop_assert!(planned.gap_mm() < 1e-9);
            prop_assert!(shakes(&planned, &bands) < 1e-9, "{:?}", planned);
        }
    }

    #[test]
    fn the_staircase_lies_below_the_line_and_near_it(torque in any_torque(), share in 0.0..1.0_f64) {
        let Ok(ability) = torque.ability() else { return Ok(()) };
        let speed = ability.top().0 * share;
        let steps_mm = f64::from(torque.full_steps) / torque.turn.0;
        let left = torque.margin * table(&torque, speed * steps_mm) - torque.load;
        let exact = left / torque.inertia * torque.turn.0 / TAU;
        let stair = ability.accel_at(MmPerS(speed), Demand::Speed).0;
        prop_assert!(stair <= exact * (1.0 + 1e-9) + 1e-9);
        prop_assert!(stair >= exact * 0.96 - 1e-9, "{} {}", stair, exact);
    }
}
