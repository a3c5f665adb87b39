//! Exact motion, and every way to miss it.

use super::*;
use gcode::{Action, Interpreter, LineNumber, Settings};
use units::Mm;

const CLOCK: Hertz = Hertz(1_000_000);
const STEP_MM: f64 = 0.0125;

fn check() -> PathCheck {
    PathCheck::new([STEP_MM, STEP_MM, 0.0025, 0.007], CLOCK, Seconds::ZERO)
}

fn span(line: u32, start: u64, end: u64, from: [f64; 2], to: [f64; 2]) -> Span {
    Span {
        line,
        start: Ticks(start),
        end: Ticks(end),
        from: [from[0], from[1], 0.0, 0.0],
        to: [to[0], to[1], 0.0, 0.0],
        arc: None,
        homing: false,
    }
}

/// The pulses of exact motion at constant speed along spans: each motor steps where it crosses half-way.
fn pulses(spans: &[Span]) -> Vec<(u64, usize, i64)> {
    let mut pulses = Vec::new();
    let mut counts = [0i64; 2];
    for span in spans {
        let ticks = span.end.0 - span.start.0;
        for tick in 0..=ticks {
            let part = tick as f64 / ticks as f64;
            for (axis, count) in counts.iter_mut().enumerate() {
                let at = span.from[axis] + (span.to[axis] - span.from[axis]) * part;
                let wanted = (at / STEP_MM).round() as i64;
                while *count != wanted {
                    *count += (wanted - *count).signum();
                    pulses.push((span.start.0 + tick, axis, *count));
                }
            }
        }
    }
    pulses
}

fn square() -> Vec<Span> {
    vec![
        span(1, 1000, 101_000, [0.0, 0.0], [10.0, 0.0]),
        span(2, 101_000, 201_000, [10.0, 0.0], [10.0, 10.0]),
        span(3, 201_000, 301_000, [10.0, 10.0], [0.0, 0.0]),
    ]
}

fn run(spans: &[Span], pulses: &[(u64, usize, i64)]) -> PathCheck {
    let mut check = check();
    for span in spans {
        check.expect(span).unwrap();
    }
    for &(at, motor, count) in pulses {
        check.pulse(motor, Ticks(at), count);
    }
    check.finish();
    check
}

#[test]
fn exact_pulses_stay_within_half_a_step_of_each_axis() {
    let spans = square();
    let check = run(&spans, &pulses(&spans));
    let half_step_diagonal = STEP_MM / 2.0 * std::f64::consts::SQRT_2;
    assert!(check.worst().distance_mm <= half_step_diagonal + 1e-9, "{:?}", check.worst());
    assert!(check.worst().distance_mm > 0.0);
    assert_eq!(check.strays().0, 0);
    assert!(check.position_mm(0).abs() < 1e-9 && check.position_mm(1).abs() < 1e-9);
}

#[test]
fn a_print_that_stops_early_is_as_wrong_as_what_is_missing() {
    let spans = square();
    let all = pulses(&spans);
    let drawn: Vec<_> = all.iter().copied().filter(|&(at, ..)| at < 150_000).collect();
    let check = run(&spans, &drawn);
    assert!(check.worst().distance_mm > 4.9, "{:?}", check.worst());
}

#[test]
fn a_line_whose_pulses_never_come_is_named() {
    let spans = square();
    let drawn: Vec<_> = pulses(&spans[..1]);
    let mut check = check();
    for span in &spans {
        check.expect(span).unwrap();
    }
    for (at, motor, count) in drawn {
        check.pulse(motor, Ticks(at), count);
    }
    check.settle(Ticks(150_000));
    assert!(check.worst().distance_mm < 0.01);
    check.settle(Ticks(202_000));
    assert_eq!(check.worst(), Worst { distance_mm: 10.0, line: 2 });
}

#[test]
fn the_right_place_at_the_wrong_time_is_wrong() {
    let spans = square();
    // Everything comes 20 ms late: the head is still on line 1 while line 2 is executed.
    let late: Vec<_> =
        pulses(&spans).into_iter().map(|(at, motor, count)| (at + 20_000, motor, count)).collect();
    assert!(run(&spans, &late).worst().distance_mm > 1.9);
}

#[test]
fn steps_may_be_off_by_the_tolerance_and_no_more() {
    // The corner is taken at full speed, 0.1 mm a ms.
    let spans = square();
    let half_step_diagonal = STEP_MM / 2.0 * std::f64::consts::SQRT_2;
    for (shift, good) in [(20, true), (-20, true), (1500, false), (-1500, false)] {
        let moved: Vec<_> = pulses(&spans)
            .into_iter()
            .map(|(at, motor, count)| (at.saturating_add_signed(shift), motor, count))
            .collect();
        let check = run(&spans, &moved);
        let worst = check.worst();
        assert_eq!(worst.distance_mm <= half_step_diagonal + 1e-9, good, "{shift}: {worst:?}");
        assert_eq!(check.strays().0 == 0, good, "{shift}");
    }
}

#[test]
fn homing_is_not_measured_and_sets_the_origin() {
    let mut check = check();
    let mut homing = span(0, 0, 100_000, [0.0, 0.0], [-300.0, 0.0]);
    homing.homing = true;
    check.expect(&homing).unwrap();
    for count in 1..=80 {
        check.pulse(0, Ticks(count as u64 * 10), -count);
    }
    check.settle(Ticks(200_000));
    check.set_position(0, 0.0);
    assert_eq!(check.position_mm(0), 0.0);
    check.expect(&span(7, 300_000, 400_000, [0.0, 0.0], [STEP_MM * 4.0, 0.0])).unwrap();
    for count in 1..=4 {
        check.pulse(0, Ticks(300_000 + count as u64 * 20_000), -80 + count);
    }
    check.finish();
    assert!(check.worst().distance_mm < 1e-9, "{:?}", check.worst());
    assert_eq!(check.strays(), (0, None));
}

#[test]
fn pulses_between_lines_are_strays() {
    let mut check = check();
    check.pulse(0, Ticks(5), 1);
    check.expect(&span(1, 1000, 2000, [0.0, 0.0], [0.1, 0.0])).unwrap();
    check.pulse(0, Ticks(900), 2);
    assert_eq!(check.strays(), (2, Some(Ticks(5))));
}

#[test]
fn an_arc_is_measured_against_itself() {
    // A sixth of a circle as one piece: its middle is 0.13 mm from the chord.
    let mut words = Interpreter::new(Settings::default());
    let (mut actions, mut found) = (Vec::new(), Vec::new());
    words.line(LineNumber(1), b"G1 X1 F600", &mut actions, &mut found);
    words.line(LineNumber(2), b"G3 X0.5 Y0.86602540378 I-1 J0", &mut actions, &mut found);
    let Some(Action::Arc(arc)) = actions.get(1) else { panic!("{actions:?} {found:?}") };
    let mut pieces = arc.chords(Mm(1.0));
    let distance = |place: [f64; 2]| {
        let mut check = check();
        let mut pieces = pieces.clone();
        let mut start = 0;
        while let Some(piece) = pieces.next_piece() {
            let [from, to] = [piece.chord.from, piece.chord.to].map(|at| [at.x, at.y]);
            let way = ArcWay::new(&piece);
            check.expect(&Span { arc: Some(way), ..span(2, start, start + 100_000, from, to) }).unwrap();
            start += 100_000;
        }
        check.set_position(1, place[1]);
        check.set_position(0, place[0] - STEP_MM);
        check.pulse(0, Ticks(50_000), 1);
        check.worst().distance_mm
    };
    let (sin, cos) = libm::sincos(0.4);
    assert!(distance([cos, sin]) < 1e-9);
    assert!((distance([1.05 * cos, 1.05 * sin]) - 0.05).abs() < 1e-9);
    assert!(pieces.next_piece().is_some());
}

#[test]
fn lines_that_are_shorter_than_the_tolerance_are_no_trouble() {
    let mut spans = Vec::new();
    for index in 0..2000u32 {
        let (from, to) = (f64::from(index) * 0.001, f64::from(index + 1) * 0.001);
        let start = u64::from(index) * 10;
        spans.push(span(index + 1, start, start + 10, [from, 0.0], [to, 0.0]));
    }
    let check = run(&spans, &pulses(&spans));
    assert!(check.worst().distance_mm <= STEP_MM / 2.0 + 0.0026, "{:?}", check.worst());
    assert_eq!(check.strays().0, 0);
}

#[test]
fn a_homing_move_that_its_trigger_cuts_short_hides_nothing_behind_it() {
    let mut homing = span(1, 0, 1_000_000, [300.0, 0.0], [0.0, 0.0]);
    homing.homing = true;
    let line = span(2, 50_000, 60_000, [0.0, 0.0], [STEP_MM, 0.0]);
    let next = span(3, 60_000, 90_000, [STEP_MM, 0.0], [0.0, 0.0]);
    let announce = || {
        let mut check = check();
        for span in [homing, line, next] {
            check.expect(&span).unwrap();
        }
        check
    };
    let mut good = announce();
    good.pulse(0, Ticks(55_000), 1);
    good.pulse(0, Ticks(75_000), 0);
    good.finish();
    assert!(good.worst().distance_mm < 1e-9, "{:?}", good.worst());
    let mut bad = announce();
    for count in 1..=8 {
        bad.pulse(0, Ticks(51_000 + count as u64 * 1000), count);
    }
    assert_eq!(bad.worst().line, 2);
    assert!(bad.worst().distance_mm > 6.0 * STEP_MM, "{:?}", bad.worst());
}
