//! Arcs as smooth ways: their speeds, their ends, and the bound of the same model.

use crate::{
    Bend, Bound, ExtruderLimits, Limits, LookAhead, MotorAbility, MoveError, MoveRequest, PlannedMove,
    Profile, Torque,
};
use core::f64::consts::{PI, TAU};
use proptest::prelude::*;
use units::{Mm, MmPerS, MmPerS2, MmPerS3};

const ACCEL: f64 = 3000.0;

fn limits() -> Limits {
    Limits {
        max_velocity: MmPerS(300.0),
        max_accel: MmPerS2(ACCEL),
        square_corner_velocity: MmPerS(5.0),
        minimum_cruise_ratio: 0.0,
        max_z_velocity: MmPerS(300.0),
        max_z_accel: MmPerS2(ACCEL),
        max_xy_velocity: Limits::ANY_VELOCITY,
        max_xy_accel: Limits::ANY_ACCEL,
        junction_deviation: None,
        extruder: ExtruderLimits::for_nozzle(Mm(0.4), Mm(1.75), MmPerS(300.0), MmPerS2(ACCEL)),
    }
}

type Piece = (MoveRequest, Option<Bend>);

/// A way that grows by lines and arcs.
struct Way {
    pieces: Vec<Piece>,
    at: [f64; 4],
}

impl Way {
    fn new(at: [f64; 4]) -> Self {
        Self { pieces: Vec::new(), at }
    }

    fn line(mut self, to: [f64; 4], feed: f64) -> Self {
        self.pieces.push((MoveRequest { from: self.at, to, feed: MmPerS(feed), tag: 0 }, None));
        self.at = to;
        self
    }

    /// An arc around a centre, in pieces that turn by no more than `step`.
    fn arc(
        mut self,
        normal: u8,
        centre: [f64; 2],
        turn: f64,
        [rise, e]: [f64; 2],
        feed: f64,
        step: f64,
    ) -> Self {
        let [first, second, third] = [0, 1, 2].map(|place| (usize::from(normal) + 1 + place) % 3);
        let (across, up) = (self.at[first] - centre[0], self.at[second] - centre[1]);
        let (radius, angle) = (libm::hypot(across, up), libm::atan2(up, across));
        let count = (turn.abs() / step).ceil().max(1.0) as u32;
        let whole = libm::hypot(radius * turn, rise);
        let start = self.at;
        for index in 0..count {
            let [low, high] = [index, index + 1].map(|index| f64::from(index) / f64::from(count));
            let mut to = start;
            to[first] = centre[0] + radius * libm::cos(angle + turn * high);
            to[second] = centre[1] + radius * libm::sin(angle + turn * high);
            to[third] = start[third] + rise * high;
            to[3] = start[3] + e * high;
            let bend = Bend {
                normal,
                centre,
                start_angle: angle + turn * low,
                turn: turn * (high - low),
                radii: [radius; 2],
                rise: to[third] - self.at[third],
                continues: index > 0,
                arc_length: whole,
            };
            self.pieces.push((MoveRequest { from: self.at, to, feed: MmPerS(feed), tag: 1 }, Some(bend)));
            self.at = to;
        }
        self
    }

    fn plan(&self, limits: Limits, profile: Profile) -> Vec<PlannedMove> {
        let mut look_ahead = LookAhead::with_profile(limits, profile).unwrap();
        let mut out = Vec::new();
        for (request, bend) in &self.pieces {
            look_ahead.push_along(request, bend.as_ref()).unwrap();
            out.extend(std::iter::from_fn(|| look_ahead.pop()));
        }
        look_ahead.flush();
        out.extend(std::iter::from_fn(|| look_ahead.pop()));
        out
    }

    fn bound(&self, limits: &Limits, motors: Vec<Option<MotorAbility>>) -> f64 {
        let mut bound = Bound::new(motors);
        for (request, bend) in &self.pieces {
            bound.push_along(request, bend.as_ref(), limits);
        }
        bound.stop();
        bound.total().0
    }
}

fn time(planned: &[PlannedMove]) -> f64 {
    planned.last().map_or(0.0, PlannedMove::end_time)
}

#[test]
fn a_circle_is_driven_at_the_root_of_acceleration_times_radius() {
    for radius in [0.3, 2.0, 10.0, 25.0] {
        for turn in [4.0 * TAU, -4.0 * TAU] {
            let way = Way::new([radius, 0.0, 0.0, 0.0]).arc(2, [0.0; 2], turn, [0.0, 5.0], 1000.0, 0.07);
            let planned = way.plan(limits(), Profile::default());
            let top = (ACCEL * radius).sqrt();
            let ramp = 0.5 * radius;
            let mut distance = 0.0;
            let mut steady = 0;
            for one in &planned {
                assert!(one.cruise_velocity <= top * (1.0 + 1e-12), "{} {top}", one.cruise_velocity);
                let length = 4.0 * TAU * radius;
                if distance > ramp * 1.01 && distance + one.length < length - ramp * 1.01 {
                    for speed in [one.start_velocity, one.cruise_velocity, one.end_velocity] {
                        assert!((speed / top - 1.0).abs() < 1e-6, "{radius} {speed} {top}");
                    }
                    steady += 1;
                }
                distance += one.length;
            }
            assert!((distance - 4.0 * TAU * radius).abs() < 1e-9 * distance);
            assert!(steady > 250, "{steady}");
            let expected = 4.0 * TAU * radius / top + top / ACCEL;
            assert!((time(&planned) - expected).abs() < 1e-6 * expected, "{} {expected}", time(&planned));
        }
    }
}

#[test]
fn from_a_line_into_an_arc_and_out_again_nothing_slows_down() {
    // A stadium's end: the feed is below what turning allows.
    for normal in 0..3_u8 {
        let mut from = [0.0; 4];
        let [first, second] = [1, 2].map(|place| (usize::from(normal) + place) % 3);
        from[first] = -50.0;
        from[second] = -10.0;
        let mut entry = [0.0; 4];
        entry[second] = -10.0;
        let mut end = [0.0; 4];
        (end[first], end[second]) = (-50.0, 10.0);
        let way = Way::new(from)
            .line(entry, 100.0)
            .arc(normal, [0.0; 2], PI, [0.0; 2], 100.0, 0.06)
            .line(end, 100.0);
        let planned = way.plan(limits(), Profile::default());
        assert!(planned.len() > 50);
        for one in &planned[1..planned.len() - 1] {
            for speed in [one.start_velocity, one.cruise_velocity, one.end_velocity] {
                assert!((speed - 100.0).abs() < 1e-9, "{speed}");
            }
        }
        assert_eq!(planned[0].end_velocity, planned[1].start_velocity);
    }
}

#[test]
fn an_arc_that_starts_at_a_corner_is_entered_at_the_corners_speed() {
    // At a right angle, as two lines would meet.
    let way = Way::new([0.0, -50.0, 0.0, 0.0])
        .line([0.0, -10.0, 0.0, 0.0], 100.0)
        .arc(2, [0.0; 2], PI, [0.0; 2], 100.0, 0.06)
        .line([50.0, 10.0, 0.0, 0.0], 100.0);
    let planned = way.plan(limits(), Profile::default());
    assert!((planned[0].end_velocity - 5.0).abs() < 1e-9, "{}", planned[0].end_velocity);
    // And where it goes back, the machine stops.
    assert!(planned[planned.len() - 2].end_velocity < 1e-3);
}

#[test]
fn each_axis_keeps_to_its_own_limits_on_an_arc() {
    let own = Limits {
        max_xy_velocity: [MmPerS(50.0), MmPerS(f64::INFINITY)],
        max_xy_accel: [MmPerS2(f64::INFINITY), MmPerS2(500.0)],
        max_z_velocity: MmPerS(8.0),
        ..limits()
    };
    let way = Way::new([10.0, 0.0, 0.0, 0.0]).arc(2, [0.0; 2], 2.0 * TAU, [40.0, 0.0], 200.0, 0.06);
    let planned = way.plan(own, Profile::default());
    let mut fastest = [0.0_f64; 3];
    for one in &planned {
        let bend = one.bend.as_ref().unwrap();
        for share in [0.0, 0.5, 1.0] {
            let slopes = [bend.slope(0, share), bend.slope(1, share), bend.tangent(false)[2]];
            for (fastest, slope) in fastest.iter_mut().zip(slopes) {
                *fastest = fastest.max(one.cruise_velocity * slope.abs());
            }
        }
        // What turning takes of y.
        let [_, y, _, _] = one.from;
        let asked = one.cruise_velocity * one.cruise_velocity * bend.curvature() * (y / 10.0).abs();
        assert!(asked <= 500.0 * 1.001, "{asked}");
    }
    assert!(fastest[0] <= 50.0 * (1.0 + 1e-9) && fastest[2] <= 8.0 * (1.0 + 1e-9), "{fastest:?}");
    assert!(fastest[2] > 7.9, "{fastest:?}");
}

#[test]
fn the_cruise_ratio_caps_a_short_arc() {
    // Alone, its virtual profile at half the acceleration peaks at v² = d·a/2; turning would allow more.
    let way = Way::new([50.0, 0.0, 0.0, 0.0]).arc(2, [0.0; 2], 0.1, [0.0; 2], 300.0, 0.01);
    let planned = way.plan(Limits { minimum_cruise_ratio: 0.5, ..limits() }, Profile::default());
    let top = planned.iter().map(|one| one.cruise_velocity).fold(0.0, f64::max);
    assert!((top - (5.0 * 0.5 * ACCEL).sqrt()).abs() < 1e-6, "{top}");
}

#[test]
fn jerk_and_torque_know_arcs() {
    let way = Way::new([-30.0, -10.0, 0.0, 0.0])
        .line([0.0, -10.0, 0.0, 1.0], 200.0)
        .arc(2, [0.0; 2], PI, [0.0, 1.0], 200.0, 0.06)
        .line([-80.0, 10.0, 0.0, 4.0], 200.0);
    let plain = time(&way.plan(limits(), Profile::default()));

    let jerk = Profile { max_jerk: Some(MmPerS3(1e5)), ..Profile::default() };
    let planned = way.plan(limits(), jerk);
    assert!(time(&planned) > plain);
    let mut accel = 0.0;
    for phase in planned.iter().flat_map(PlannedMove::phases) {
        assert!(phase.jerk.abs() <= 1e5 * (1.0 + 1e-9));
        assert!((phase.accel - accel).abs() < 1.0, "the acceleration jumps by {}", phase.accel - accel);
        accel = phase.accel + phase.jerk * phase.duration;
    }
    // The seams of line and arc are no corners: the speed is that of the arc's pieces.
    assert!(planned.iter().filter(|one| one.bend.is_some()).all(|one| one.end_velocity > 100.0));

    let torque = Torque {
        pull_out: vec![(0.0, 0.4), (1000.0, 0.35), (4000.0, 0.1)],
        pull_out_slowing: None,
        load: 0.02,
        inertia: 2e-5,
        margin: 0.6,
        full_steps: 200,
        turn: Mm(40.0),
        resonances: Vec::new(),
    };
    let motor = torque.ability().unwrap();
    let motors = vec![Some(motor.clone()), Some(motor), None, None];
    let strong = Limits { max_accel: MmPerS2(20_000.0), ..limits() };
    let profile = Profile { motors: motors.clone(), max_jerk: None };
    let planned = way.plan(strong, profile);
    let (found, least) = (time(&planned), way.bound(&strong, motors));
    assert!(found >= least * 0.999 && found <= least * 1.02, "{found} {least}");
}

#[test]
fn a_piece_that_does_not_fit_its_ends_is_refused() {
    let way = Way::new([10.0, 0.0, 0.0, 0.0]).arc(2, [0.0; 2], 1.0, [0.0; 2], 50.0, 0.1);
    let (request, bend) = way.pieces[0];
    let bend = bend.unwrap();
    for wrong in [
        Bend { centre: [0.1, 0.0], ..bend },
        Bend { turn: bend.turn + 0.01, ..bend },
        Bend { radii: [10.0, f64::NAN], ..bend },
        Bend { rise: 1.0, ..bend },
        Bend { normal: 3, ..bend },
        Bend { turn: f64::INFINITY, ..bend },
        Bend { arc_length: f64::INFINITY, ..bend },
    ] {
        let mut look_ahead = LookAhead::new(limits()).unwrap();
        assert_eq!(look_ahead.push_along(&request, Some(&wrong)), Err(MoveError::Gap), "{wrong:?}");
        look_ahead.push_along(&request, Some(&bend)).unwrap();
    }
}

proptest! {
    #[test]
    fn a_plan_of_lines_and_arcs_is_as_fast_as_its_bound(
        parts in proptest::collection::vec(
            (0..3_u8, [-30.0..30.0_f64, -30.0..30.0], -9.0..9.0_f64, -5.0..5.0_f64, 10.0..300.0_f64, any::<bool>()),
            1..8,
        ),
        own in any::<bool>(),
    ) {
        let mut way = Way::new([0.0; 4]);
        for (normal, centre, turn, rise, feed, straight) in parts {
            if straight {
                let to = [centre[0], centre[1], way.at[2] + rise, way.at[3] + 0.1];
                way = way.line(to, feed);
                continue;
            }
            let [first, second] = [1, 2].map(|place| (usize::from(normal) + place) % 3);
            prop_assume!(libm::hypot(way.at[first] - centre[0], way.at[second] - centre[1]) > 0.01);
            way = way.arc(normal, centre, turn, [rise, 0.1], feed, 0.1);
        }
        let mut limits = limits();
        if own {
            limits.max_xy_velocity = [MmPerS(60.0), MmPerS(90.0)];
            limits.max_xy_accel = [MmPerS2(900.0), MmPerS2(2500.0)];
        }
        let planned = way.plan(limits, Profile::default());
        let (found, least) = (time(&planned), way.bound(&limits, Vec::new()));
        prop_assert!(found >= least * (1.0 - 1e-4), "{} {}", found, least);
        prop_assert!(found <= least * 1.002 + 1e-6, "{} {}", found, least);
        for pair in planned.windows(2) {
            prop_assert_eq!(pair[0].end_velocity, pair[1].start_velocity);
            prop_assert_eq!(pair[0].to, pair[1].from);
        }
        // Distance is the arcs' own.
        let length: f64 = planned.iter().map(|one| one.length).sum();
        let driven: f64 =
            planned.iter().flat_map(PlannedMove::phases).map(|phase| phase.end_distance - phase.start_distance).sum();
        prop_assert!((length - driven).abs() < 1e-9 * length.max(1.0));
    }

    #[test]
    fn a_bends_tangents_are_its_slope(
        normal in 0..3_u8, angle in -7.0..7.0_f64, turn in 0.001..1.5_f64, radius in 0.05..1e4_f64,
        growth in -0.02..0.02_f64, rise in -2.0..2.0_f64, clockwise in any::<bool>(),
    ) {
        let bend = Bend {
            normal, centre: [3.0, -4.0], start_angle: angle, turn: if clockwise { -turn } else { turn },
            radii: [radius, radius * (1.0 + growth)], rise, continues: false, arc_length: 0.0,
        };
        let h = 1e-5;
        for share in [h, 0.3, 0.7, 1.0 - h] {
            let step = |coordinate| (bend.turning(coordinate, share + h) - bend.turning(coordinate, share - h)) / (2.0 * h);
            let way = [step(0), step(1), rise];
            let length = way.iter().map(|part| part * part).sum::<f64>().sqrt();
            for (coordinate, part) in way[..2].iter().enumerate() {
                prop_assert!((bend.slope(coordinate, share) - part / length).abs() < 1e-5);
            }
            // The mean of what it is at each place.
            prop_assert!((length / bend.length() - 1.0).abs() < 0.03);
        }
        let largest = bend.shares();
        for one in [bend.tangent(false), bend.tangent(true)] {
            prop_assert!((one.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-12);
            for axis in 0..3 {
                prop_assert!(one[axis].abs() <= largest[axis] + 1e-12);
            }
        }
    }
}
