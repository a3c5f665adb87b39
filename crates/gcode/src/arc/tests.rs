use proptest::prelude::*;

use super::*;

fn at(x: f64, y: f64, z: f64, e: f64) -> Position {
    Position { x, y, z, e }
}

fn arc(from: Position, to: Position, plane: Plane, clockwise: bool, centre: Centre) -> Result<Arc, ArcError> {
    let turn = Turn { plane, clockwise, centre, extra_turns: 0.0 };
    Arc::new(LineNumber(1), from, to, MmPerS(10.0), turn).map(|(arc, _)| arc)
}

/// The point in the middle of the arc, which tells both its side and its direction.
fn middle(arc: &Arc) -> [f64; 3] {
    let [x, y, z, _] = arc.chords(Mm(1e-4)).point(0.5).to_array();
    [x, y, z].map(|v| (v * 10.0).round() / 10.0)
}

#[test]
fn a_quarter_turn_has_the_length_and_the_side_it_should() {
    let quarter =
        arc(at(10.0, 0.0, 0.0, 0.0), at(0.0, 10.0, 0.0, 1.0), Plane::Xy, false, Centre::Offset([-10.0, 0.0]));
    let quarter = quarter.unwrap();
    assert!((quarter.angle - PI / 2.0).abs() < 1e-12);
    assert!((quarter.length().0 - 5.0 * PI).abs() < 1e-9);
    assert_eq!(middle(&quarter), [7.1, 7.1, 0.0]);
    let other_way = arc(quarter.from, quarter.to, Plane::Xy, true, Centre::Offset([-10.0, 0.0])).unwrap();
    assert!((other_way.angle + 1.5 * PI).abs() < 1e-12);
    assert_eq!(middle(&other_way), [-7.1, -7.1, 0.0]);
}

#[test]
fn the_same_end_is_a_full_circle_and_turns_add_to_it() {
    let start = at(10.0, 5.0, 1.0, 0.0);
    let end = at(10.0, 5.0, 3.0, 0.0);
    for (clockwise, sign) in [(true, -1.0), (false, 1.0)] {
        let turn =
            Turn { plane: Plane::Xy, clockwise, centre: Centre::Offset([-10.0, 0.0]), extra_turns: 2.0 };
        let (helix, accurate) = Arc::new(LineNumber(1), start, end, MmPerS(1.0), turn).unwrap();
        assert!(accurate && (helix.angle - sign * 3.0 * TAU).abs() < 1e-12);
        assert_eq!(helix.chords(CHORD_TOLERANCE).last().unwrap().to, end);
    }
}

#[test]
fn planes_turn_as_seen_from_the_end_of_their_normals() {
    // In Z-X, from +Z a quarter turn counter-clockwise ends at +X; in Y-Z, from +Y at +Z.
    let zx =
        arc(at(0.0, 0.0, 1.0, 0.0), at(1.0, 0.0, 0.0, 0.0), Plane::Zx, false, Centre::Offset([-1.0, 0.0]));
    assert!((zx.unwrap().angle - PI / 2.0).abs() < 1e-12);
    let yz =
        arc(at(0.0, 1.0, 0.0, 0.0), at(0.0, 0.0, 1.0, 0.0), Plane::Yz, false, Centre::Offset([-1.0, 0.0]));
    assert!((yz.unwrap().angle - PI / 2.0).abs() < 1e-12);
}

#[test]
fn the_sign_of_a_radius_chooses_between_the_short_and_the_long_way() {
    let (from, to) = (at(10.0, 0.0, 0.0, 0.0), at(0.0, 10.0, 0.0, 0.0));
    for (clockwise, radius, angle) in
        [(false, 10.0, 0.5 * PI), (true, 10.0, -0.5 * PI), (false, -10.0, 1.5 * PI), (true, -10.0, -1.5 * PI)]
    {
        let arc = arc(from, to, Plane::Xy, clockwise, Centre::Radius(radius)).unwrap();
        assert!((arc.angle - angle).abs() < 1e-9, "{clockwise} {radius}: {}", arc.angle);
    }
    // A half circle whose radius was rounded down.
    let half =
        arc(at(0.0, 0.0, 0.0, 0.0), at(20.0, 0.0, 0.0, 0.0), Plane::Xy, true, Centre::Radius(9.999)).unwrap();
    assert!((half.angle + PI).abs() < 1e-9);
}

#[test]
fn what_is_no_arc_is_said() {
    let (o, p) = (at(0.0, 0.0, 0.0, 0.0), at(10.0, 0.0, 0.0, 0.0));
    let xy = |to, centre| arc(o, to, Plane::Xy, true, centre).unwrap_err();
    assert_eq!(xy(p, Centre::Offset([0.0, 0.0])), ArcError::NoRadius);
    assert_eq!(xy(p, Centre::Offset([2.0, 0.0])), ArcError::RadiiDiffer(2.0, 8.0));
    assert_eq!(xy(p, Centre::Offset([10.0, 0.0])), ArcError::RadiiDiffer(10.0, 0.0));
    assert_eq!(xy(o, Centre::Radius(5.0)), ArcError::FullCircleByRadius);
    assert_eq!(xy(p, Centre::Radius(3.0)), ArcError::RadiusTooSmall);
    assert_eq!(xy(p, Centre::Radius(1e9)), ArcError::RadiusTooLarge);
    assert_eq!(xy(p, Centre::Offset([1e9, 0.0])), ArcError::RadiusTooLarge);
}

proptest! {
    #[test]
    fn chords_stay_within_the_tolerance_and_join_up(
        radius in 0.01f64..500.0,
        start in -PI..PI,
        sweep in 0.01f64..6.25,
        clockwise: bool,
        rise in -5.0f64..5.0,
        tolerance in 0.0005f64..0.5,
    ) {
        let turned = start + if clockwise { -sweep } else { sweep };
        let from = at(radius * libm::cos(start), radius * libm::sin(start), 0.0, 5.0);
        let to = at(radius * libm::cos(turned), radius * libm::sin(turned), rise, 6.0);
        let arc = arc(from, to, Plane::Xy, clockwise, Centre::Offset([-from.x, -from.y])).unwrap();
        prop_assert!((arc.angle.abs() - sweep).abs() < 1e-6);
        let mut last = from;
        let mut filament = 0.0;
        let (mut low, mut high) = ([0, 1, 2].map(|_| f64::INFINITY), [0, 1, 2].map(|_| f64::NEG_INFINITY));
        for chord in arc.chords(Mm(0.0005)) {
            for end in [chord.from, chord.to] {
                low = core::array::from_fn(|axis| low[axis].min(end.to_array()[axis]));
                high = core::array::from_fn(|axis| high[axis].max(end.to_array()[axis]));
            }
        }
        for (bounds, chords) in arc.bounds().iter().zip([low, high]) {
            prop_assert!(bounds.iter().zip(chords).all(|(a, b)| (a - b).abs() < 0.001), "{bounds:?} {chords:?}");
        }
        for chord in arc.chords(Mm(tolerance)) {
            prop_assert_eq!(chord.from, last);
            last = chord.to;
            filament += chord.to.e - chord.from.e;
            let middle = libm::hypot(chord.from.x.midpoint(chord.to.x), chord.from.y.midpoint(chord.to.y));
            prop_assert!((radius - middle).abs() <= tolerance * 1.000_001 + 1e-9);
            prop_assert!((libm::hypot(chord.to.x, chord.to.y) - radius).abs() < 1e-9);
        }
        prop_assert_eq!(last, to);
        prop_assert!((filament - 1.0).abs() < 1e-9);
    }

    #[test]
    fn no_more_chords_than_the_tolerance_needs(radius in 1.0f64..100.0) {
        let from = at(radius, 0.0, 0.0, 0.0);
        let circle = arc(from, from, Plane::Xy, true, Centre::Offset([-radius, 0.0])).unwrap();
        let step = 2.0 * libm::acos(1.0 - 0.005 / radius);
        prop_assert!(circle.chords(CHORD_TOLERANCE).count() as f64 <= (TAU / step).ceil() + 1.0);
    }
}

#[test]
fn dust_from_adding_up_relative_moves_neither_loses_nor_makes_a_full_circle() {
    // Ends a hundredth of a nanometre apart on either side of the start are meant to be the start.
    for dust in [-1e-11, 0.0, 1e-11] {
        for clockwise in [false, true] {
            let turn =
                Turn { plane: Plane::Xy, clockwise, centre: Centre::Offset([-5.0, 0.0]), extra_turns: 0.0 };
            let (from, to) = (at(10.0, 0.0, 0.0, 0.0), at(10.0, dust, 0.0, 1.0));
            let (arc, _) = Arc::new(LineNumber(1), from, to, MmPerS(10.0), turn).unwrap();
            assert!((arc.angle.abs() - TAU).abs() < 1e-9, "{dust} {clockwise}: {}", arc.angle);
        }
    }
}

#[test]
fn an_arcs_pieces_go_on_from_each_other_and_its_extremes_are_its_bounds() {
    for (plane, clockwise, end) in
        [(Plane::Xy, false, at(-3.0, 4.0, 2.0, 1.0)), (Plane::Xy, true, at(5.0, 0.0, 0.0, 1.0))]
    {
        let arc = arc(at(5.0, 0.0, 0.0, 0.0), end, plane, clockwise, Centre::Offset([-5.0, 0.0])).unwrap();
        let mut chords = arc.chords(CHORD_TOLERANCE);
        let (mut turned, mut count, mut at_angle) = (0.0, 0, chords.start_angle);
        while let Some(piece) = chords.next_piece() {
            assert_eq!(piece.is_first, count == 0);
            assert!((piece.start_angle - at_angle).abs() < 1e-12);
            assert!(piece.radii.iter().all(|radius| (radius - 5.0).abs() < 1e-12));
            at_angle += piece.turn;
            turned += piece.turn;
            count += 1;
        }
        assert!((turned - arc.angle).abs() < 1e-12);
        assert_eq!(count, arc.chords(CHORD_TOLERANCE).count());
        let mut reach = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for place in arc.extremes().chain([arc.from, arc.to]) {
            let [x, y, z, _] = place.to_array();
            for (axis, value) in [x, y, z].into_iter().enumerate() {
                reach[0][axis] = reach[0][axis].min(value);
                reach[1][axis] = reach[1][axis].max(value);
            }
        }
        for (found, bound) in reach.as_flattened().iter().zip(arc.bounds().as_flattened()) {
            assert!((found - bound).abs() < 1e-9, "{reach:?} {:?}", arc.bounds());
        }
    }
}
