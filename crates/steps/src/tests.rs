//! Every step of random prints against crossings found by bisection, and the edges of what the wire can say.

use crate::{
    Cartesian, IDLE_TICKS_MAX, MotorStats, PushError, RUN_SPAN_MAX, STEP_HOLD_MAX, SpecError, StepCommand,
    StepCommandKind, StepGenerator, StepSearch, StepperSpec,
};
use motion::{ExtruderLimits, Limits, LookAhead, MoveRequest, PlannedMove};
use proptest::prelude::*;
use units::{Hertz, Mm, MmPerS, MmPerS2, Seconds, StepCount, Ticks};

pub(crate) const CLOCK: Hertz = Hertz(12_000_000);
pub(crate) const STEP_DISTANCES: [f64; 4] = [0.0125, 0.0125, 0.0025, 0.007_087_172_218_75];

pub(crate) fn limits() -> Limits {
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

pub(crate) fn generator(clock: Hertz) -> StepGenerator {
    searching(clock, StepSearch::Usual)
}

fn searching(clock: Hertz, search: StepSearch) -> StepGenerator {
    let specs = STEP_DISTANCES.map(|distance| StepperSpec { search, ..StepperSpec::new(Mm(distance)) });
    StepGenerator::new(clock, &specs, Cartesian).unwrap()
}

fn plan(from: [f64; 4], points: &[([f64; 4], f64)]) -> Vec<PlannedMove> {
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let mut at = from;
    for &(to, feed) in points {
        look_ahead.push(&MoveRequest { from: at, to, feed: MmPerS(feed), tag: 0 }).unwrap();
        at = to;
    }
    look_ahead.flush();
    std::iter::from_fn(|| look_ahead.pop()).collect()
}

/// All commands of a run; `eager` takes them after each move.
pub(crate) fn commands(
    generator: &mut StepGenerator,
    planned: &[PlannedMove],
    eager: bool,
) -> Vec<StepCommand> {
    let mut out = Vec::new();
    generator.begin_run(planned.first().map_or([0.0; 4], |first| first.from)).unwrap();
    for one in planned {
        generator.push(one).unwrap();
        if eager {
            out.extend(std::iter::from_fn(|| generator.pop()));
            let settled = generator.settled().0 as f64;
            let held = one.end_time() * f64::from(CLOCK.0) - settled;
            let held_max = STEP_HOLD_MAX.0 + RUN_SPAN_MAX.0 + 1e-3;
            assert!(held <= held_max * f64::from(CLOCK.0), "steps are held back for {held} ticks");
        }
    }
    generator.end_run().unwrap();
    out.extend(std::iter::from_fn(|| generator.pop()));
    out
}

/// The clock and direction of each step of `motor`, as a board would make them.
pub(crate) fn decompress(commands: &[StepCommand], motor: usize) -> Vec<(u64, bool)> {
    let mut steps = Vec::new();
    let mut forward = None;
    let mut clock = 0_u64;
    for command in commands.iter().filter(|command| command.motor == motor) {
        assert_eq!(command.start, Ticks(clock), "a command starts where the one before it ended");
        match command.kind {
            StepCommandKind::SetDir { forward: now } => {
                assert_ne!(forward, Some(now), "a direction is told once");
                assert_eq!(command.end, command.start);
                forward = Some(now);
            }
            StepCommandKind::QueueStep { interval, count, add } => {
                assert!(count > 0 && interval > 0);
                let mut interval = i64::from(interval);
                for _ in 0..count {
                    assert!(interval > 0, "{command:?}");
                    if command.end.0 - command.start.0 > IDLE_TICKS_MAX {
                        assert_eq!(count, 1);
                        assert_eq!((command.end.0 - command.start.0) as u32, interval as u32);
                        interval = (command.end.0 - command.start.0) as i64;
                    }
                    clock += interval as u64;
                    interval += i64::from(add);
                    steps.push((clock, forward.unwrap()));
                }
                assert_eq!(command.end, Ticks(clock));
            }
        }
    }
    steps
}

/// The grid position of a place in mm, rounded as the crate does it: half-way goes up.
fn nearest(position: f64, motor: usize) -> f64 {
    (position * (1.0 / STEP_DISTANCES[motor]) + 0.5).floor()
}

/// The exact time (in ticks) and direction of each crossing, by bisection over the planned moves.
fn crossings(planned: &[PlannedMove], motor: usize, clock: Hertz) -> Vec<(f64, bool)> {
    let distance = STEP_DISTANCES[motor];
    let back_within = crate::compressor::gap_min_ticks(f64::from(clock.0));
    let mut count = nearest(planned[0].from[motor], motor);
    let mut out: Vec<(f64, bool)> = Vec::new();
    for one in planned {
        let forward = one.to[motor] > one.from[motor];
        let sign = if forward { 1.0 } else { -1.0 };
        let target = nearest(one.to[motor], motor);
        while (target - count) * sign > 0.0 {
            let edge = (count + 0.5 * sign) * distance;
            let (mut low, mut high) = (0.0, one.duration());
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                let at = one.from[motor] + one.direction[motor] * one.distance_at(middle);
                if (at - edge) * sign < 0.0 { low = middle } else { high = middle }
            }
            let time = (one.start_time + high) * f64::from(clock.0);
            let taken_back =
                out.last().is_some_and(|&(last, way)| way != forward && time - last < back_within);
            if taken_back {
                out.pop();
            } else {
                out.push((time, forward));
            }
            count += sign;
        }
    }
    out
}

/// Each step against its crossing: count, direction, and time within 25 µs and a quarter of the gaps.
fn check(planned: &[PlannedMove], commands: &[StepCommand], clock: Hertz) {
    for motor in 0..4 {
        let steps = decompress(commands, motor);
        let due = crossings(planned, motor, clock);
        assert_eq!(steps.len(), due.len(), "steps of motor {motor}");
        let allowed = 25e-6 * f64::from(clock.0);
        for (index, (&(at, way), &(time, forward))) in steps.iter().zip(&due).enumerate() {
            assert_eq!(way, forward);
            let gap_before = index.checked_sub(1).map_or(f64::INFINITY, |before| time - due[before].0);
            let gap_after = due.get(index + 1).map_or(f64::INFINITY, |after| after.0 - time);
            let allowed = allowed.min(0.25 * gap_before).min(0.25 * gap_after);
            let error = (at as f64 - time).abs();
            // The first step of a run may have to wait for an interval. Where the path comes to rest, the last bit of a position
            // is worth some nanoseconds.
            let first = if index == 0 { 7.0 } else { 0.05 + 2e-8 * f64::from(clock.0) };
            assert!(
                error <= allowed + first,
                "step {index} of motor {motor}: {error} ticks off, {allowed} allowed"
            );
        }
    }
}

/// Points of every kind: travel, lines in small pieces, z, the filament alone, there and back.
pub(crate) fn any_points() -> impl Strategy<Value = Vec<([f64; 4], f64)>> {
    let grid = || (-160..160_i32).prop_map(|k| f64::from(k) * 0.00625);
    let delta = prop_oneof![
        2 => (-20.0..20.0_f64, -20.0..20.0_f64, Just(0.0), 0.0..0.5_f64),
        2 => (grid(), grid(), Just(0.0), Just(0.0)),
        1 => (-1.0..1.0_f64, Just(0.0), -0.5..0.5_f64, Just(0.0)),
        1 => (Just(0.0), Just(0.0), Just(0.0), -2.0..2.0_f64),
        3 => (-0.05..0.3_f64, -0.05..0.1_f64, Just(0.0), 0.0..0.02_f64),
    ];
    proptest::collection::vec((delta, 0.5..400.0_f64), 1..40).prop_map(|moves| {
        let mut at = START;
        let step = |((x, y, z, e), feed): ((f64, f64, f64, f64), f64)| {
            at = [at[0] + x, at[1] + y, at[2] + z, at[3] + e];
            (at, feed)
        };
        moves.into_iter().map(step).collect()
    })
}

fn any_search() -> impl Strategy<Value = StepSearch> {
    prop_oneof![Just(StepSearch::Usual), Just(StepSearch::Ahead)]
}

pub(crate) const START: [f64; 4] = [100.0, 50.003, 0.2, 1234.5];

proptest! {
    #[test]
    fn every_step_comes_when_it_is_due(
        points in any_points(),
        mhz in prop_oneof![Just(12), Just(72), Just(180), Just(1)],
        search in any_search(),
    ) {
        let clock = Hertz(mhz * 1_000_000);
        let planned = plan(START, &points);
        prop_assume!(!planned.is_empty());
        let mut generator = searching(clock, search);
        let commands = commands(&mut generator, &planned, false);
        if mhz > 1 {
            check(&planned, &commands, clock);
        } else {
            // Slow clocks cannot tell all crossings apart; the commands must still be whole.
            for motor in 0..4 {
                decompress(&commands, motor);
            }
        }
        let end = planned[planned.len() - 1].to;
        for motor in 0..4 {
            let expected = nearest(end[motor], motor) as i64;
            prop_assert_eq!(generator.motor_steps(motor), StepCount(expected));
            let start = nearest(START[motor], motor) as i64;
            let made: i64 = decompress(&commands, motor).iter().map(|&(_, way)| if way { 1 } else { -1 }).sum();
            prop_assert_eq!(start + made, expected);
        }
    }

    #[test]
    fn when_commands_are_taken_does_not_change_them(points in any_points(), search in any_search()) {
        let planned = plan(START, &points);
        let mut generator = searching(CLOCK, search);
        let late = commands(&mut generator, &planned, false);
        let early = commands(&mut generator, &planned, true);
        for motor in 0..4 {
            let of = |all: &[StepCommand]| all.iter().copied().filter(|c| c.motor == motor).collect::<Vec<_>>();
            prop_assert_eq!(of(&late), of(&early));
        }
        prop_assert_eq!(late, early);
    }

    #[test]
    fn any_planned_move_at_all_is_taken_or_refused(raw in proptest::collection::vec(any::<[f64; 10]>(), 0..20)) {
        let mut generator = generator(CLOCK);
        let mut at = [0.0; 4];
        let mut count = 0_u64;
        for [x, y, length, start_time, accel_time, cruise_time, decel_time, start_velocity, cruise_velocity, accel] in raw {
            let planned = PlannedMove {
                tag: 0, from: at, to: [x, y, at[2], at[3]], direction: [0.6, 0.8, 0.0, 0.0], length, start_time,
                accel_time, cruise_time, decel_time, start_velocity, cruise_velocity, end_velocity: 0.0, accel, shape: None, bend: None,
            };
            if generator.push(&planned).is_ok() {
                at = planned.to;
            }
            // Long moves are honest work: only look at their beginning.
            while count < 10_000 && generator.pop().is_some() {
                count += 1;
            }
        }
    }
}

#[test]
fn a_motor_that_rested_for_minutes_steps_once_and_goes_on() {
    // x moves, then y for 400 s, then x again: 4.8 · 10⁹ ticks, more than 32 bits.
    let points =
        [([1.0, 0.0, 0.0, 0.0], 10.0), ([1.0, 400.0, 0.0, 0.0], 1.0), ([2.0, 400.0, 0.0, 0.0], 10.0)];
    let planned = plan([0.0; 4], &points);
    let mut generator = generator(CLOCK);
    let commands = commands(&mut generator, &planned, true);
    check(&planned, &commands, CLOCK);
    let long = commands.iter().filter(|c| c.end.0 - c.start.0 > IDLE_TICKS_MAX).collect::<Vec<_>>();
    let [StepCommand { motor: 0, kind: StepCommandKind::QueueStep { count: 1, add: 0, .. }, .. }] = long[..]
    else {
        panic!("one step after the rest: {long:?}")
    };
}

#[test]
fn commands_come_in_the_order_of_their_first_steps() {
    let points: Vec<_> = (0..200)
        .map(|i| ([f64::from(i % 7), f64::from(i % 5), f64::from(i) * 0.01, f64::from(i) * 0.1], 40.0))
        .collect();
    let planned = plan([0.0; 4], &points);
    let mut last = 0;
    for command in commands(&mut generator(CLOCK), &planned, true) {
        if let StepCommandKind::QueueStep { interval, .. } = command.kind {
            let first = command.start.0 + u64::from(interval);
            // The order is that of the true times; each may be 25 µs off.
            assert!(first + 600 > last, "{first} after {last}");
            last = first;
        }
    }
}

#[test]
fn steps_are_held_back_only_briefly() {
    let mut generator = generator(CLOCK);
    generator.begin_run([0.0; 4]).unwrap();
    let planned = plan([0.0; 4], &[([0.5, 0.0, 0.0, 0.0], 10.0), ([0.5, 0.0, 9.0, 0.0], 5.0)]);
    for one in &planned {
        generator.push(one).unwrap();
    }
    let mut until = [0; 2];
    while let Some(command) = generator.pop() {
        until[usize::from(command.motor != 0)] = command.end.0;
    }
    let x_end = planned[0].end_time() * f64::from(CLOCK.0);
    assert!(until[0] as f64 > x_end - 0.02 * f64::from(CLOCK.0), "x is out before the run ends");
    let held = planned[1].end_time() * f64::from(CLOCK.0) - until[1] as f64;
    assert!(held < 0.6 * f64::from(CLOCK.0), "z lags by {held} ticks");
}

#[test]
fn steady_motion_packs_thousands_of_steps_a_second_into_a_few_commands() {
    let planned = plan([0.0; 4], &[([300.0, 0.0, 0.0, 0.0], 100.0)]);
    let mut generator = generator(CLOCK);
    let commands = commands(&mut generator, &planned, false);
    check(&planned, &commands, CLOCK);
    let MotorStats { steps, queue_steps, direction_changes, peak_steps_per_s, max_error } =
        generator.stats()[0];
    assert_eq!((steps, direction_changes), (24_000, 1));
    assert!(queue_steps < 30, "{queue_steps} commands");
    assert!((peak_steps_per_s - 8000.0).abs() < 1.0, "{peak_steps_per_s}");
    assert!(max_error.0 <= 25e-6, "{max_error}");
}

#[test]
fn looking_ahead_saves_bytes() {
    // A ring of short lines at an even speed, as curves are sliced.
    let points: Vec<_> = (1..400)
        .map(|i| {
            let (sin, cos) = libm::sincos(f64::from(i) * 0.03);
            ([30.0 * cos, 30.0 * sin, 0.2, f64::from(i) * 0.03], 60.0)
        })
        .collect();
    let planned = plan([30.0, 0.0, 0.2, 0.0], &points);
    let bytes = |search: StepSearch| {
        let all = commands(&mut searching(CLOCK, search), &planned, false);
        check(&planned, &all, CLOCK);
        all.iter()
            .map(|command| match command.kind {
                StepCommandKind::SetDir { .. } => 3,
                StepCommandKind::QueueStep { interval, count, add } => {
                    crate::stabbing::Fit { interval, add, count: u32::from(count) }.bytes()
                }
            })
            .sum::<u32>()
    };
    let (usual, ahead) = (bytes(StepSearch::Usual), bytes(StepSearch::Ahead));
    assert!(f64::from(ahead) < 0.985 * f64::from(usual), "{ahead} bytes instead of {usual}");
}

#[test]
fn exactly_half_way_belongs_to_the_upper_step() {
    // Up to 40.5 steps, which is step 41, and back: the step is taken back from where it was made.
    let half = 40.5 * 0.0125;
    for (to, steps) in [(half, 41), (half - 1e-9, 40)] {
        let mut generator = generator(CLOCK);
        let planned = plan([0.0; 4], &[([to, 0.0, 0.0, 0.0], 10.0), ([to, 1.0, 0.0, 0.0], 10.0)]);
        let there = commands(&mut generator, &planned, false);
        assert_eq!(decompress(&there, 0).len(), steps);
        assert_eq!(generator.motor_steps(0), StepCount(steps as i64));
    }
}

#[test]
fn a_step_that_is_taken_back_at_once_never_was() {
    // To exactly half-way, back from there, and up again slowly.
    let turn =
        [([100.75625, 0.0, 0.0, 0.0], 370.0), ([100.75, 0.0, 0.0, 0.0], 0.5), ([100.93, 0.0, 0.0, 0.0], 0.5)];
    // A run that ends on a crossing: its last step comes when the move is over.
    let stop = [([100.95625, -0.6, 0.0, 0.0], 240.0)];
    for points in [&turn[..], &stop[..]] {
        let planned = plan([100.0, 0.0, 0.0, 0.0], points);
        let mut generator = generator(CLOCK);
        let late = commands(&mut generator, &planned, false);
        check(&planned, &late, CLOCK);
        assert_eq!(late, commands(&mut generator, &planned, true));
    }
}

#[test]
fn impossible_machines_and_moves_are_refused() {
    let good = StepperSpec::new(Mm(0.0125));
    let new = |specs: &[StepperSpec]| StepGenerator::new(CLOCK, specs, Cartesian).map(|_| ());
    assert_eq!(new(&[good; 3]), Err(SpecError::Motors { needed: 4, given: 3 }));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
        let spec = StepperSpec::new(Mm(bad));
        assert_eq!(new(&[good, spec, good, good]), Err(SpecError::StepDistance { motor: 1 }));
    }
    let lax = StepperSpec { max_error: Seconds(1.0), ..good };
    assert_eq!(new(&[good, good, lax, good]), Err(SpecError::MaxError { motor: 2 }));

    let fine = StepperSpec::new(Mm(1e-5));
    let mut generator = StepGenerator::new(CLOCK, &[good, good, good, fine], Cartesian).unwrap();
    generator.begin_run([0.0; 4]).unwrap();
    let fast = plan([0.0; 4], &[([0.0, 0.0, 0.0, 50.0], 70.0)]);
    assert_eq!(generator.push(&fast[0]), Err(PushError::StepRate { motor: 3 }));
    let elsewhere = plan([5.0; 4], &[([6.0; 4], 1.0)]);
    assert_eq!(generator.push(&elsewhere[0]), Err(PushError::Gap { motor: 0 }));
    assert_eq!(generator.begin_run([0.0, f64::NAN, 0.0, 0.0]), Err(PushError::Range { motor: 1 }));
    generator.end_run().unwrap();
    assert_eq!(generator.pop(), None);
    assert_eq!(generator.push(&fast[0]), Err(PushError::Ended));
}

#[test]
fn a_motor_that_waits_for_its_neighbour_never_blocks_a_busy_one() {
    // Y steps once and rests. X goes on in pieces of one step each, thousands of them before Y's step is final.
    let mut generator = generator(CLOCK);
    generator.begin_run([0.0; 4]).unwrap();
    let speed = 600.0;
    let moving = |tag: u32, from: [f64; 4], to: [f64; 4], start_time: f64| {
        let length = (to[0] - from[0]).abs() + (to[1] - from[1]).abs();
        let direction = [(to[0] - from[0]) / length, (to[1] - from[1]) / length, 0.0, 0.0];
        PlannedMove {
            tag,
            from,
            to,
            direction,
            length,
            start_time,
            accel_time: 0.0,
            cruise_time: length / speed,
            decel_time: 0.0,
            start_velocity: speed,
            cruise_velocity: speed,
            end_velocity: speed,
            accel: 1000.0,
            shape: None,
            bend: None,
        }
    };
    let mut at = [0.0, 0.0125, 0.0, 0.0];
    let mut time = 0.0;
    let mut out = Vec::new();
    let first = moving(0, [0.0; 4], at, time);
    generator.push(&first).unwrap();
    time = first.end_time();
    let steps = 20_000;
    for tag in 1..=steps {
        let to = [at[0] + 0.0125, at[1], 0.0, 0.0];
        let planned = moving(tag, at, to, time);
        if generator.push(&planned) == Err(PushError::Full) {
            out.extend(std::iter::from_fn(|| generator.pop()));
            generator.push(&planned).expect("room, once everything possible was taken");
        }
        (at, time) = (to, planned.end_time());
    }
    generator.end_run().unwrap();
    out.extend(std::iter::from_fn(|| generator.pop()));
    assert_eq!(decompress(&out, 0).len(), steps as usize);
    assert_eq!(decompress(&out, 1).len(), 1);
}

#[test]
fn a_fast_straight_line_of_tiny_pieces_flows_however_it_is_taken() {
    // Both motors run at a steady pace, the fast one with a piece of the path for every step: commands stay open for long.
    let mut look_ahead = LookAhead::new(limits()).unwrap();
    let mut planned = Vec::new();
    for i in 1..20_000 {
        let at = |i: i32| [f64::from(i) * 0.013, f64::from(i) * 0.002, 0.0, 0.0];
        look_ahead.push(&MoveRequest { from: at(i - 1), to: at(i), feed: MmPerS(300.0), tag: 0 }).unwrap();
        planned.extend(std::iter::from_fn(|| look_ahead.pop()));
    }
    look_ahead.flush();
    planned.extend(std::iter::from_fn(|| look_ahead.pop()));
    let taken = |every: usize, search: StepSearch| {
        let mut generator = searching(CLOCK, search);
        generator.begin_run([0.0; 4]).unwrap();
        let mut out = Vec::new();
        for (index, one) in planned.iter().enumerate() {
            if generator.push(one) == Err(PushError::Full) {
                out.extend(std::iter::from_fn(|| generator.pop()));
                generator.push(one).expect("room, once everything possible was taken");
            }
            if index % every == 0 {
                out.extend(std::iter::from_fn(|| generator.pop()));
            }
        }
        generator.end_run().unwrap();
        out.extend(std::iter::from_fn(|| generator.pop()));
        out
    };
    for search in [StepSearch::Usual, StepSearch::Ahead] {
        let out = taken(1, search);
        check(&planned, &out, CLOCK);
        assert_eq!(taken(100, search), out);
        assert_eq!(taken(usize::MAX, search), out);
    }
}
