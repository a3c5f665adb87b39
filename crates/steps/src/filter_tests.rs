//! Pressure advance against integrals done by number, shapers against a simulated resonator, motors that follow two axes.

use crate::filter::Filter;
use crate::tests::{CLOCK, START, STEP_DISTANCES, any_points, decompress, limits};
use crate::{
    AXES, Advance, Cartesian, Filters, Kinematics, Nonlinear, PushError, Segment, Shaper, ShaperKind,
    StepCommand, StepGenerator, StepperSpec,
};
use motion::{LookAhead, MoveRequest, PlannedMove};
use proptest::prelude::*;
use units::{Mm, MmPerS, Seconds, StepCount};

const SMOOTH: Seconds = Seconds(0.04);
const EXTRUDER: usize = 3;

pub(crate) fn plan(from: [f64; 4], points: &[([f64; 4], f64)], lead: Seconds) -> Vec<PlannedMove> {
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    look_ahead.dwell(lead);
    let mut at = from;
    for &(to, feed) in points {
        look_ahead.push(&MoveRequest { from: at, to, feed: MmPerS(feed), tag: 0 }).unwrap();
        at = to;
    }
    look_ahead.flush();
    std::iter::from_fn(|| look_ahead.pop()).collect()
}

pub(crate) fn generator<K: Kinematics>(
    kinematics: K,
    filters: &Filters,
    advance: &Advance,
) -> StepGenerator<K> {
    let specs = STEP_DISTANCES.map(|distance| StepperSpec::new(Mm(distance)));
    let mut generator = StepGenerator::new(CLOCK, &specs, kinematics).unwrap();
    generator.set_filters(filters);
    generator.set_advance(advance);
    generator
}

pub(crate) fn commands<K: Kinematics>(
    generator: &mut StepGenerator<K>,
    planned: &[PlannedMove],
    eager: bool,
) -> Vec<StepCommand> {
    let mut out = Vec::new();
    generator.begin_run(planned.first().map_or([0.0; 4], |first| first.from)).unwrap();
    for one in planned {
        generator.push(one).unwrap();
        if eager {
            out.extend(std::iter::from_fn(|| generator.pop()));
        }
    }
    generator.end_run().unwrap();
    out.extend(std::iter::from_fn(|| generator.pop()));
    out
}

/// Position and speed of an axis along a plan.
pub(crate) fn state(planned: &[PlannedMove], axis: usize, time: f64) -> (f64, f64, bool) {
    let index = planned.partition_point(|one| one.end_time() <= time);
    let Some(one) = planned.get(index) else {
        return (planned.last().map_or(0.0, |last| last.to[axis]), 0.0, false);
    };
    let t = time - one.start_time;
    if t < 0.0 {
        return (one.from[axis], 0.0, false);
    }
    let ratio = one.direction[axis];
    let (mut velocity, mut left) = (one.end_velocity, t);
    for phase in one.phases() {
        if left < phase.duration {
            velocity = phase.velocity_at(left);
            break;
        }
        left -= phase.duration;
    }
    let draws = ratio > 0.0 && (one.direction[0] != 0.0 || one.direction[1] != 0.0);
    (one.from[axis] + ratio * one.distance_at(t), ratio * velocity, draws)
}

/// The mean of the advanced path over the window, by the midpoint rule between all seams.
fn smoothed(planned: &[PlannedMove], advance: &dyn Fn(f64) -> f64, smooth: f64, time: f64) -> f64 {
    let half = 0.5 * smooth;
    let mut seams = vec![time - half, time, time + half];
    for one in planned {
        let decel = one.start_time + one.accel_time + one.cruise_time;
        seams.extend([one.start_time, one.start_time + one.accel_time, decel, one.end_time()]);
    }
    seams.retain(|seam| (time - half..=time + half).contains(seam));
    seams.sort_by(f64::total_cmp);
    let parts = 400;
    let mut sum = 0.0;
    for pair in seams.windows(2) {
        let width = (pair[1] - pair[0]) / f64::from(parts);
        for part in 0..parts {
            let at = pair[0] + (f64::from(part) + 0.5) * width;
            let (position, velocity, draws) = state(planned, EXTRUDER, at);
            let ahead = if draws { advance(velocity) } else { 0.0 };
            sum += (position + ahead) * (half - (at - time).abs()) * width;
        }
    }
    sum / (half * half)
}

/// Every pulse of the extruder against the smoothed path: half a step from it, but for its time's error.
fn check_advance(planned: &[PlannedMove], advance: &Advance, model: &dyn Fn(f64) -> f64, slack: f64) {
    let filters = Filters { smooth_time: Some(SMOOTH), ..Filters::default() };
    let mut generator = generator(Cartesian, &filters, advance);
    let commands = commands(&mut generator, planned, false);
    let steps = decompress(&commands, EXTRUDER);
    let distance = STEP_DISTANCES[EXTRUDER];
    let mut count = (planned[0].from[EXTRUDER] / distance + 0.5).floor();
    let stride = (steps.len() / 40).max(1);
    let mut checked = 0;
    for (index, &(clock, forward)) in steps.iter().enumerate() {
        let sign = if forward { 1.0 } else { -1.0 };
        let edge = (count + 0.5 * sign) * distance;
        count += sign;
        if index % stride != 0 {
            continue;
        }
        let time = clock as f64 / f64::from(CLOCK.0);
        let at = |time: f64| smoothed(planned, model, SMOOTH.0, time);
        let ends = [at(time - 25.5e-6), at(time), at(time + 25.5e-6)];
        let low = ends.iter().copied().fold(f64::INFINITY, f64::min) - slack;
        let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max) + slack;
        assert!((low..=high).contains(&edge), "step {index}: {edge} not in {low} ..= {high}");
        checked += 1;
    }
    assert!(checked > 0 || steps.is_empty());
    let end = planned[planned.len() - 1].to[EXTRUDER];
    assert_eq!(count, (end / distance + 0.5).floor(), "the run ends where the filament was asked to be");
    assert_eq!(generator.motor_steps(EXTRUDER), StepCount(count as i64));
    let last = steps.last().map_or(0.0, |&(clock, _)| clock as f64 / f64::from(CLOCK.0));
    assert!(last <= planned[planned.len() - 1].end_time() + generator.tail().0 + 25.5e-6);
}

fn drawing() -> Vec<([f64; 4], f64)> {
    let mut at = [100.0, 50.0, 0.2, 1234.5];
    let mut points = Vec::new();
    for turn in 0..12 {
        let (x, y) = [(5.0, 0.0), (0.0, 3.0), (-5.0, 0.4), (-0.3, -3.0)][turn % 4];
        at = [at[0] + x, at[1] + y, at[2], at[3] + 0.035 * libm::hypot(x, y)];
        points.push((at, [60.0, 150.0, 20.0][turn % 3]));
        if turn % 5 == 4 {
            // Back, away, and forth.
            at[3] -= 0.8;
            points.push((at, 35.0));
            at[0] += 30.0;
            points.push((at, 250.0));
            at[3] += 0.8;
            points.push((at, 35.0));
        }
    }
    points
}

#[test]
fn the_filament_is_as_far_ahead_as_the_pressure_needs() {
    let lead = Seconds(0.5 * SMOOTH.0);
    let planned = plan([100.0, 50.0, 0.2, 1234.5], &drawing(), lead);
    let linear = Advance::Linear { pressure_advance: 0.045 };
    check_advance(&planned, &linear, &|v| 0.045 * v, 1e-5);
    let model = Nonlinear { linear_advance: 0.02, nonlinear_offset: 0.1, linearization_velocity: 1.5 };
    let tanh = |v: f64| 0.02 * v + 0.1 * libm::tanh(v / 1.5);
    check_advance(&planned, &Advance::Tanh(model), &tanh, 3e-4);
    let reciprocal = |v: f64| 0.02 * v + 0.1 * (1.0 - 1.0 / (1.0 + v / 1.5));
    check_advance(&planned, &Advance::Reciprocal(model), &reciprocal, 3e-4);
}

#[test]
fn without_advance_the_filament_is_where_the_path_is_at_every_pulse() {
    let planned = plan([100.0, 50.0, 0.2, 1234.5], &drawing(), Seconds(0.0));
    let commands = commands(&mut generator(Cartesian, &Filters::default(), &Advance::NONE), &planned, false);
    let distance = STEP_DISTANCES[EXTRUDER];
    let mut count = (planned[0].from[EXTRUDER] / distance + 0.5).floor();
    for (clock, forward) in decompress(&commands, EXTRUDER) {
        let (due, _, _) = state(&planned, EXTRUDER, clock as f64 / f64::from(CLOCK.0));
        let before = count;
        count += if forward { 1.0 } else { -1.0 };
        for steps in [before, count] {
            assert!((steps * distance - due).abs() <= distance, "{steps} steps at {due} mm");
        }
    }
}

/// A filter on one axis: all of the path that it gives.
fn filtered(mut filter: Filter, segments: &[Segment], end: (f64, f64)) -> Vec<Segment> {
    let mut out = Vec::new();
    filter.begin(segments[0].start);
    for segment in segments {
        filter.path().rest_until(segment.start_time);
        filter.path().push(*segment);
        filter.drain(&mut out);
    }
    filter.finish(end.0, end.1, &mut out);
    out
}

fn position(segments: &[Segment], time: f64) -> f64 {
    let index = segments.partition_point(|segment| segment.end_time() <= time);
    match segments.get(index) {
        Some(segment) if segment.start_time <= time => segment.start + segment.way(time - segment.start_time),
        Some(segment) => segment.start,
        None => segments[segments.len() - 1].end,
    }
}

/// Amplitude of a resonator that follows `path`, when the path's end has just passed.
fn vibration(path: &[Segment], frequency: f64, damping: f64) -> f64 {
    let omega = 2.0 * core::f64::consts::PI * frequency;
    let end = path[path.len() - 1].end_time();
    let steps = (end * frequency * 400.0).ceil();
    let width = end / steps;
    let slope =
        |t: f64, x: f64, v: f64| (v, omega * omega * (position(path, t) - x) - 2.0 * damping * omega * v);
    let (mut x, mut v) = (path[0].start, 0.0);
    for step in 0..steps as u64 {
        let t = step as f64 * width;
        let a = slope(t, x, v);
        let b = slope(t + 0.5 * width, x + 0.5 * width * a.0, v + 0.5 * width * a.1);
        let c = slope(t + 0.5 * width, x + 0.5 * width * b.0, v + 0.5 * width * b.1);
        let d = slope(t + width, x + width * c.0, v + width * c.1);
        x += width / 6.0 * (a.0 + 2.0 * (b.0 + c.0) + d.0);
        v += width / 6.0 * (a.1 + 2.0 * (b.1 + c.1) + d.1);
    }
    let off = x - path[path.len() - 1].end;
    let damped = omega * (1.0 - damping * damping).sqrt();
    libm::hypot(off, (v + damping * omega * off) / damped)
}

#[test]
fn a_shaped_stop_leaves_the_vibration_that_the_formula_says() {
    for kind in ShaperKind::ALL {
        for damping in [0.0, 0.1] {
            let design = 47.0;
            let shaper = Shaper::new(kind, design, damping).unwrap();
            let lead = Filter::shaper(&shaper).lead();
            // A sudden stop after the vibrations of the start are gone.
            let start = Segment::rest(0.0, lead + 0.2, 10.0);
            let powers = [200.0, 0.0, 0.0, 0.0, 0.0];
            // Slow enough a start to leave nothing: 200 mm/s in whole periods of the resonator below.
            for share in [0.9, 1.0, 1.1] {
                let frequency = design * share;
                let periods = 8.0 / frequency;
                let half_accel = 100.0 / periods;
                let ramp = Segment {
                    start_time: start.end_time(),
                    duration: periods,
                    start: 10.0,
                    end: 10.0 + half_accel * periods * periods,
                    powers: [0.0, half_accel, 0.0, 0.0, 0.0],
                };
                let cruise = Segment {
                    start_time: ramp.end_time(),
                    duration: if damping == 0.0 { 0.3 } else { 1.0 },
                    start: ramp.end,
                    end: ramp.end + 200.0 * if damping == 0.0 { 0.3 } else { 1.0 },
                    powers,
                };
                let path = [start, ramp, cruise];
                let end = (cruise.end_time(), cruise.end);
                let unshaped = vibration(&path, frequency, damping);
                let mut shaped = filtered(Filter::shaper(&shaper), &path, end);
                // From time 0 on.
                shaped.insert(0, Segment::rest(0.0, shaped[0].start_time, 10.0));
                let ratio = vibration(&shaped, frequency, damping) / unshaped;
                let formula = shaper.residual_vibration(frequency, damping);
                let allowed = (0.05 * formula).max(0.005);
                assert!(
                    (ratio - formula).abs() <= allowed,
                    "{} at {frequency} Hz, damping {damping}: {ratio}, by the formula {formula}",
                    kind.name()
                );
            }
        }
    }
}

#[test]
fn shapers_are_what_the_papers_say() {
    for kind in ShaperKind::ALL {
        let shaper = Shaper::new(kind, 50.0, 0.0).unwrap();
        let sum: f64 = shaper.impulses().iter().map(|(weight, _)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let tolerance = match kind {
            ShaperKind::Ei | ShaperKind::ThreeHumpEi => 0.05,
            // That of two humps is zero between them.
            _ => 0.0,
        };
        let left = shaper.residual_vibration(50.0, 0.0);
        assert!((left - tolerance).abs() < 2e-3, "{} leaves {left}", kind.name());
    }
    for (frequency, damping) in [(0.0, 0.1), (f64::NAN, 0.1), (50.0, 1.0), (50.0, -0.1), (1e9, 0.1)] {
        assert_eq!(Shaper::new(ShaperKind::Zv, frequency, damping), None);
    }
}

/// X and Y by the sum and the difference of two motors.
#[derive(Clone, Copy, Debug)]
struct Crossed;

impl Kinematics for Crossed {
    fn motors(&self) -> usize {
        4
    }

    fn axes(&self, motor: usize) -> [bool; AXES] {
        core::array::from_fn(|axis| if motor < 2 { axis < 2 } else { axis == motor })
    }

    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64 {
        match motor {
            0 => position[0] + position[1],
            1 => position[0] - position[1],
            _ => position[motor],
        }
    }

    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>) {
        let [x, y, ..] = *stretch;
        let sign = if motor == 0 { 1.0 } else { -1.0 };
        out.push(match motor {
            0 | 1 => Segment {
                start: x.start + sign * y.start,
                end: x.end + sign * y.end,
                powers: core::array::from_fn(|power| x.powers[power] + sign * y.powers[power]),
                ..x
            },
            _ => stretch[motor],
        });
    }
}

pub(crate) fn all_filters() -> Filters {
    let shaper = |kind, frequency| Shaper::new(kind, frequency, 0.1);
    Filters {
        shapers: [shaper(ShaperKind::Mzv, 52.0), shaper(ShaperKind::TwoHumpEi, 41.0), None],
        smooth_time: Some(SMOOTH),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn filters_never_lose_a_step_nor_depend_on_when_commands_are_taken(points in any_points(), crossed in any::<bool>()) {
        fn judge<K: Kinematics + Copy>(kinematics: K, points: &[([f64; 4], f64)]) -> Result<(), TestCaseError> {
            let advance = Advance::Linear { pressure_advance: 0.07 };
            let mut generator = generator(kinematics, &all_filters(), &advance);
            let planned = plan(START, points, generator.lead());
            prop_assume!(!planned.is_empty());
            let late = commands(&mut generator, &planned, false);
            prop_assert_eq!(&late, &commands(&mut generator, &planned, true));
            let end = planned[planned.len() - 1].to;
            for (motor, distance) in STEP_DISTANCES.iter().enumerate() {
                let count = |at: [f64; 4]| {
                    (kinematics.motor_position(motor, &at) * (1.0 / distance) + 0.5).floor() as i64
                };
                let steps = decompress(&late, motor);
                let made: i64 = steps.iter().map(|&(_, way)| if way { 1 } else { -1 }).sum();
                prop_assert_eq!(count(START) + made, count(end), "motor {}", motor);
                prop_assert_eq!(generator.motor_steps(motor), StepCount(count(end)));
            }
            Ok(())
        }
        if crossed { judge(Crossed, &points)? } else { judge(Cartesian, &points)? }
    }

    #[test]
    fn any_planned_move_at_all_is_taken_or_refused_with_filters(raw in proptest::collection::vec(any::<[f64; 10]>(), 0..12)) {
        let advance = Advance::Tanh(Nonlinear { linear_advance: 0.1, nonlinear_offset: 1.0, linearization_velocity: 3.0 });
        let mut generator = generator(Crossed, &all_filters(), &advance);
        generator.begin_run([0.0; 4]).unwrap();
        let mut at = [0.0; 4];
        let mut count = 0_u64;
        for [x, y, length, start_time, accel_time, cruise_time, decel_time, start_velocity, cruise_velocity, accel] in raw {
            let planned = PlannedMove {
                tag: 0, from: at, to: [x, y, at[2], at[3] + 1.0], direction: [0.6, 0.8, 0.0, 0.1], length, start_time,
                accel_time, cruise_time, decel_time, start_velocity, cruise_velocity, end_velocity: 0.0, accel, shape: None, bend: None,
            };
            if generator.push(&planned).is_ok() {
                at = planned.to;
            }
            while count < 10_000 && generator.pop().is_some() {
                count += 1;
            }
        }
        let _ = generator.end_run();
    }
}

#[test]
fn a_file_of_dust_stays_within_its_bounds() {
    // A million moves of 10 nm: 10 mm in all, thousands in the window of a filter.
    let mut generator = generator(Cartesian, &all_filters(), &Advance::Linear { pressure_advance: 0.05 });
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    look_ahead.dwell(generator.lead());
    generator.begin_run([0.0; 4]).unwrap();
    let mut steps = 0_u64;
    let mut take = |generator: &mut StepGenerator, look_ahead: &mut LookAhead| {
        while let Some(one) = look_ahead.pop() {
            if generator.push(&one) == Err(PushError::Full) {
                steps += std::iter::from_fn(|| generator.pop()).count() as u64;
                generator.push(&one).unwrap();
            }
        }
        steps += std::iter::from_fn(|| generator.pop()).count() as u64;
    };
    for i in 1..200_000 {
        let at = |i: i32| [f64::from(i) * 1e-5, f64::from(i % 3) * 1e-6, 0.0, f64::from(i) * 1e-7];
        look_ahead.push(&MoveRequest { from: at(i - 1), to: at(i), feed: MmPerS(300.0), tag: 0 }).unwrap();
        if i % 64 == 0 {
            take(&mut generator, &mut look_ahead);
            assert!(generator.segments_held() <= crate::SEGMENTS_HELD_MAX);
        }
    }
    look_ahead.flush();
    take(&mut generator, &mut look_ahead);
    generator.end_run().unwrap();
    assert!(std::iter::from_fn(|| generator.pop()).count() > 0);
}

/// The slowest shapers that there are, and lines of a step each: while X is not known, Y's way piles up.
#[test]
fn the_slowest_shapers_take_what_a_fast_machine_is_given() {
    for (kind, damping) in [(ShaperKind::ThreeHumpEi, 0.0), (ShaperKind::TwoHumpEi, 0.1)] {
        let filters = Filters { shapers: [Shaper::new(kind, 5.0, damping), None, None], smooth_time: None };
        let mut generator = generator(Cartesian, &filters, &Advance::NONE);
        let speed = 700.0;
        let step = STEP_DISTANCES[1];
        let time = step / speed;
        let lead = generator.lead().0;
        assert!(lead > 0.1, "{lead}");
        generator.begin_run([0.0; 4]).unwrap();
        let lines = (0.5 / time) as u32;
        let mut steps = [0_u64; AXES];
        let mut take = |generator: &mut StepGenerator| {
            for command in std::iter::from_fn(|| generator.pop()) {
                if let crate::StepCommandKind::QueueStep { count, .. } = command.kind {
                    steps[command.motor] += u64::from(count);
                }
            }
        };
        // Evenly, however it came to that speed: X goes along slowly.
        let at = |line: u32| [f64::from(line) * step * 0.1, f64::from(line) * step, 0.0, 0.0];
        for line in 0..lines {
            let (from, to) = (at(line), at(line + 1));
            let length = libm::hypot(to[0] - from[0], to[1] - from[1]);
            let direction = core::array::from_fn(|axis| (to[axis] - from[axis]) / length);
            let start_time = lead + f64::from(line) * time;
            let speed = length / time;
            let one = PlannedMove {
                tag: line,
                from,
                to,
                direction,
                length,
                start_time,
                accel_time: 0.0,
                cruise_time: time,
                decel_time: 0.0,
                start_velocity: speed,
                cruise_velocity: speed,
                end_velocity: speed,
                accel: 1000.0,
                shape: None,
                bend: None,
            };
            generator.push(&one).unwrap_or_else(|error| panic!("{error} in line {line} of {lines}"));
            take(&mut generator);
        }
        generator.end_run().unwrap();
        take(&mut generator);
        assert_eq!(steps[1], u64::from(lines));
    }
}

/// An axis that stands still takes one segment for that, however short the moves are meanwhile.
#[test]
fn standing_still_through_dust_takes_no_memory() {
    let mut filter = Filter::shaper(&Shaper::new(ShaperKind::ThreeHumpEi, 5.0, 0.1).unwrap());
    filter.begin(1.5);
    let mut out = Vec::new();
    for move_of_1_us in 1..100_000_u32 {
        filter.path().rest_at(1.0 + 1e-6 * f64::from(move_of_1_us), 1.5);
        filter.drain(&mut out);
        assert!(filter.held() <= 2, "{}", filter.held());
    }
    assert!(out.is_empty());
}

#[test]
fn a_move_before_its_filters_is_refused() {
    let mut generator = generator(Cartesian, &all_filters(), &Advance::NONE);
    generator.begin_run(START).unwrap();
    let early = plan(START, &[([101.0, 50.0, 0.2, 1234.5], 50.0)], Seconds(0.0));
    assert_eq!(generator.push(&early[0]), Err(PushError::TooEarly));
}
