//! Arcs against the exact circle: the polynomials between their seams, and every pulse.

use crate::bent::{bent_segments, turning_axis};
use crate::tests::{CLOCK, STEP_DISTANCES, commands, decompress, generator, limits};
use crate::{Filters, Segment, Shaper, ShaperKind};
use core::f64::consts::TAU;
use motion::{Bend, Limits, LookAhead, MoveRequest, PlannedMove, Profile};
use proptest::prelude::*;
use units::{MmPerS, MmPerS3, Seconds};

/// A whole arc.
#[derive(Clone, Copy, Debug)]
struct Arc {
    normal: u8,
    centre: [f64; 2],
    radius: f64,
    angle: f64,
    turn: f64,
    rise: f64,
    filament: f64,
}

impl Arc {
    fn axes(&self) -> [usize; 3] {
        [0, 1, 2].map(|place| (usize::from(self.normal) + 1 + place) % 3)
    }

    fn length(&self) -> f64 {
        libm::hypot(self.radius * self.turn, self.rise)
    }

    /// The place after a share of its length.
    fn at(&self, share: f64) -> [f64; 4] {
        let [first, second, third] = self.axes();
        let angle = self.angle + self.turn * share;
        let mut out = [0.0, 0.0, 0.0, self.filament * share];
        out[first] = self.centre[0] + self.radius * libm::cos(angle);
        out[second] = self.centre[1] + self.radius * libm::sin(angle);
        out[third] = self.rise * share;
        out
    }

    /// Its pieces under a look-ahead, as a file's.
    fn plan(
        &self,
        limits: Limits,
        profile: Profile,
        feed: f64,
        step: f64,
        lead: Seconds,
    ) -> Vec<PlannedMove> {
        let mut look_ahead = LookAhead::with_profile(limits, profile).unwrap();
        look_ahead.dwell(lead);
        let count = (self.turn.abs() / step).ceil().max(1.0) as u32;
        let mut out = Vec::new();
        for index in 0..count {
            let [low, high] = [index, index + 1].map(|index| f64::from(index) / f64::from(count));
            let bend = Bend {
                normal: self.normal,
                centre: self.centre,
                start_angle: self.angle + self.turn * low,
                turn: self.turn * (high - low),
                radii: [self.radius; 2],
                rise: self.rise * (high - low),
                continues: index > 0,
                arc_length: self.length(),
            };
            let request =
                MoveRequest { from: self.at(low), to: self.at(high), feed: MmPerS(feed), tag: index };
            look_ahead.push_along(&request, Some(&bend)).unwrap();
            out.extend(std::iter::from_fn(|| look_ahead.pop()));
        }
        look_ahead.flush();
        out.extend(std::iter::from_fn(|| look_ahead.pop()));
        out
    }
}

/// Where a plan of one arc is at a time, exactly.
fn exact(arc: &Arc, planned: &[PlannedMove], time: f64) -> [f64; 4] {
    let index = planned.partition_point(|one| one.end_time() <= time);
    let before = index as f64 / planned.len() as f64;
    let within = planned.get(index).map_or(0.0, |one| one.distance_at(time - one.start_time));
    arc.at(before + within / arc.length())
}

fn any_arc() -> impl Strategy<Value = (Arc, f64)> {
    let radius = prop_oneof![0.02..1.0_f64, 1.0..50.0, 50.0..1000.0];
    let arc =
        (0..3_u8, [-100.0..100.0_f64, -100.0..100.0], radius, -7.0..7.0_f64, 0.01..7.0_f64, -2.0..2.0_f64);
    (arc, any::<bool>(), 1.0..300.0_f64).prop_map(
        |((normal, centre, radius, angle, turn, rise), back, feed)| {
            let turn = if back { -turn } else { turn };
            (Arc { normal, centre, radius, angle, turn, rise, filament: 1.0 }, feed)
        },
    )
}

/// The largest turn of a piece whose chord is 0.005 mm from the arc.
fn step(radius: f64) -> f64 {
    (4.0 * libm::asin((0.005 / (2.0 * radius)).min(1.0).sqrt())).min(core::f64::consts::FRAC_PI_4)
}

proptest! {
    #[test]
    fn the_polynomials_follow_the_arc_without_a_jump((arc, feed) in any_arc(), jerk in any::<bool>()) {
        let own = Limits { max_z_velocity: MmPerS(300.0), max_z_accel: limits().max_accel, ..limits() };
        let profile = Profile { max_jerk: jerk.then_some(MmPerS3(1e5)), ..Profile::default() };
        let planned = arc.plan(own, profile, feed, step(arc.radius), Seconds(0.0));
        for axis in 0..3 {
            let mut before: Option<Segment> = None;
            for one in &planned {
                let Some(turning) = turning_axis(one, axis) else {
                    prop_assert_eq!(axis, arc.axes()[2]);
                    continue;
                };
                let mut all = Vec::new();
                bent_segments(one, turning, [one.from[axis], one.to[axis]], &mut |segment| all.push(segment));
                prop_assert_eq!(all.last().unwrap().end, one.to[axis]);
                prop_assert!((all.last().unwrap().end_time() - one.end_time()).abs() < 1e-12);
                for segment in all {
                    let [c1, c2, c3, ..] = segment.powers;
                    for part in [0.2, 0.5, 0.8, 1.0] {
                        let t = segment.duration * part;
                        let off = segment.start + segment.way(t) - exact(&arc, &planned, segment.start_time + t)[axis];
                        prop_assert!(off.abs() < 1.01e-6, "{} mm off: {:?} {:?}", off, segment, one);
                    }
                    if let Some(before) = before {
                        let [b1, b2, b3, ..] = before.powers;
                        let t = before.duration;
                        let arrives = b1 + (2.0 * b2 + 3.0 * b3 * t) * t;
                        // Two positions whose last digits are 1e-13 mm, over the time between them.
                        let dust = 1e-6 + 1e-12 * arc.radius.max(100.0) * (1.0 / t + 1.0 / segment.duration);
                        prop_assert!((c1 - arrives).abs() < dust, "{} {}: {:?} {:?}", arrives, c1, before, segment);
                        prop_assert_eq!(before.end, segment.start);
                    }
                    prop_assert!(c2.is_finite() && c3.is_finite());
                    before = Some(segment);
                }
            }
        }
    }

    #[test]
    fn every_pulse_of_an_arc_comes_where_it_is_due((arc, feed) in any_arc()) {
        prop_assume!(arc.radius < 60.0);
        check_pulses(&arc, &arc.plan(limits(), Profile::default(), feed, step(arc.radius), Seconds(0.0)))?;
    }
}

/// A ramp shorter than the digits of its own way makes no speed up.
#[test]
fn a_ramp_of_dust_has_the_speed_of_its_ends() {
    let arc = Arc {
        normal: 2,
        centre: [171.870_566_014_983_9, 225.223_890_785_962_45],
        radius: 5.151_659_991_966_331,
        angle: -0.710_573_319_240_453_1,
        turn: 0.084_455_398_078_084_79,
        rise: 0.0,
        filament: 0.0,
    };
    let mut planned = arc.plan(limits(), Profile::default(), 20.0, 1.0, Seconds(0.0));
    let one = &mut planned[0];
    one.decel_time = 1.7e-18;
    one.end_velocity = one.cruise_velocity;
    for axis in 0..2 {
        let turning = turning_axis(one, axis).unwrap();
        bent_segments(one, turning, [one.from[axis], one.to[axis]], &mut |segment| {
            assert!(segment.powers[0].abs() < 20.1, "{segment:?}");
        });
    }
}

/// Each step of each motor: at its time the exact path is half-way between two steps, but for the time's own error.
fn check_pulses(arc: &Arc, planned: &[PlannedMove]) -> Result<(), TestCaseError> {
    let commands = commands(&mut generator(CLOCK), planned, false);
    let path_speed = planned.iter().map(|one| one.cruise_velocity).fold(0.0, f64::max);
    for (motor, distance) in STEP_DISTANCES.into_iter().enumerate() {
        let speed = path_speed * if motor == 3 { arc.filament / arc.length() } else { 1.0 };
        let mut count = (planned[0].from[motor] / distance + 0.5).floor();
        let mut last = 0;
        for (at, forward) in decompress(&commands, motor) {
            let edge = (count + if forward { 0.5 } else { -0.5 }) * distance;
            let off = exact(arc, planned, at as f64 / f64::from(CLOCK.0))[motor] - edge;
            prop_assert!(off.abs() <= speed * 26e-6 + 2e-6, "motor {} at {}: {} mm off", motor, at, off);
            prop_assert!(at >= last);
            last = at;
            count += if forward { 1.0 } else { -1.0 };
        }
        let end = planned[planned.len() - 1].to[motor];
        prop_assert_eq!(count, (end / distance + 0.5).floor());
    }
    Ok(())
}

/// What the pulses of x and y draw, place by place.
fn drawn(planned: &[PlannedMove], filters: &Filters) -> Vec<[f64; 2]> {
    let mut generator = generator(CLOCK);
    generator.set_filters(filters);
    let commands = commands(&mut generator, planned, false);
    let mut steps = Vec::new();
    for motor in 0..2 {
        steps.extend(decompress(&commands, motor).into_iter().map(|(at, forward)| (at, motor, forward)));
    }
    steps.sort_unstable();
    let mut counts = [0, 1].map(|motor| (planned[0].from[motor] / STEP_DISTANCES[motor] + 0.5).floor());
    let place = |(_, motor, forward): (u64, usize, bool)| {
        counts[motor] += if forward { 1.0 } else { -1.0 };
        [counts[0] * STEP_DISTANCES[0], counts[1] * STEP_DISTANCES[1]]
    };
    steps.into_iter().map(place).collect()
}

fn circle(radius: f64) -> Arc {
    Arc { normal: 2, centre: [100.0, 80.0], radius, angle: 0.3, turn: TAU, rise: 0.0, filament: 3.0 }
}

#[test]
fn at_every_pulse_of_a_circle_the_head_is_within_a_microstep_of_it() {
    for radius in [0.5, 10.0, 40.0] {
        let arc = circle(radius);
        let planned = arc.plan(limits(), Profile::default(), 150.0, step(radius), Seconds(0.0));
        let places = drawn(&planned, &Filters::default());
        // Each motor goes there and back by the diameter.
        assert!(places.len() as f64 > 7.9 * radius / STEP_DISTANCES[0], "{}", places.len());
        for [x, y] in places {
            let off = (libm::hypot(x - 100.0, y - 80.0) - radius).abs();
            assert!(off <= STEP_DISTANCES[0], "{off} mm from the circle");
        }
    }
}

#[test]
fn a_shaped_circle_is_a_circle_of_the_same_size_but_for_what_shaping_takes() {
    let arc = circle(20.0);
    let shaper = Shaper::new(ShaperKind::Mzv, 50.0, 0.1);
    let filters = Filters { shapers: [shaper, shaper, None], smooth_time: None };
    let mut lead = generator(CLOCK);
    lead.set_filters(&filters);
    let planned = arc.plan(limits(), Profile::default(), 80.0, step(20.0), lead.lead());
    let places = drawn(&planned, &filters);
    assert!(places.len() > 10_000);
    for [x, y] in places {
        // Means over a window of 20 ms cut a circle of 4 rad/s by less than r·(ω·T)²/8 inward, and never lead outward.
        let off = libm::hypot(x - 100.0, y - 80.0) - 20.0;
        assert!(off <= STEP_DISTANCES[0] && off > -0.02 - STEP_DISTANCES[0], "{off} mm from the circle");
    }
}
